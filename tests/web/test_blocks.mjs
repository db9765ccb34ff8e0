// What differs between protocols at the buttons of the page (web/machine/blocks.js).
import assert from "node:assert/strict";
import { test } from "node:test";
import { axesOf, blocksOf } from "./web/machine/blocks.js";

test("a lathe has no Y, whether it has said where it stands or not; a machine with more axes has them all", () => {
  assert.deepEqual(axesOf("ncframe", []), ["x", "z"]);
  assert.deepEqual(axesOf("ncframe", ["x", "z"]), ["x", "z"]);
  assert.deepEqual(axesOf("grbl", []), ["x", "y", "z"]);
  assert.deepEqual(axesOf("elvinto", ["x", "y", "z", "a"]), ["x", "y", "z", "a"]);
});

test("each controller is told in its own words where zero is, and one that has none has no button", () => {
  assert.deepEqual(blocksOf("elvinto").zero(["x", "y"]), ["G92 X0 Y0"]);
  assert.deepEqual(blocksOf("grbl").zero(["z"]), ["G10 L20 P0 Z0"]);
  assert.equal(blocksOf("ncframe"), null);
});
