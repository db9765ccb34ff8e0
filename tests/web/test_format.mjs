// What is shown and saved (web/lib/format.js): in a table for a spreadsheet nothing is a formula.
import assert from "node:assert/strict";
import { test } from "node:test";
import { csv } from "./web/lib/format.js";

const cell = (/** @type {unknown} */ value) => csv(["a"], [{ a: value }]).split("\r\n").slice(1, -1).join("\r\n");

test("a text that a spreadsheet would compute is made a text", () => {
  for (const text of ["=1", "+1", "-1", "@A1", "＝1", "＋1", "－1", "＠A1", " =1", "\t=1", "\tx", "\u200b=1", "\ufeff＝1"]) assert.equal(cell(text), `'${text}`);
  for (const text of ["\rx", "\n=1"]) assert.equal(cell(text), `"'${text}"`);
});

test("numbers and other texts stay as they are", () => {
  assert.equal(cell(-1.5), "-1.5");
  for (const text of ["G1 X-1", "part=2.nc", "", "１＋１"]) assert.equal(cell(text), text);
  assert.equal(cell(null), "");
  assert.equal(cell('a "b", c'), '"a ""b"", c"');
  assert.equal(cell({ x: 1 }), '"{""x"":1}"');
});
