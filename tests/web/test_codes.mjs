// Completion of a block that is typed (web/console/codes.js).
import assert from "node:assert/strict";
import { test } from "node:test";
import { completed, completions } from "./web/console/codes.js";

const CODES = ["G0", "G1", "G10", "G2", "G28", "G38.2", "G90", "M3", "M30"].map((code) => ({ code, text: "" }));
const of = (block) => completions(CODES, block).map(({ code }) => code);

test("what begins as the last word does, in the order of numbers", () => {
  assert.deepEqual(of("G1"), ["G1", "G10"]);
  assert.deepEqual(of("g2"), ["G2", "G28"]);
  assert.deepEqual(of("G90 M"), ["M3", "M30"]);
  assert.deepEqual(of("G38."), ["G38.2"]);
});

test("nothing for what is whole, for no word, for words that are no codes, and in comments", () => {
  for (const block of ["", "G90", "G90 ", "X10", "G7", "(G", "; m", "G1 X"]) assert.deepEqual(of(block), [], block);
});

test("never more than a few", () => {
  const many = Array.from({ length: 40 }, (_, number) => ({ code: `G${number}`, text: "" }));
  assert.equal(completions(many, "G").length, 8);
});

test("only the last word is made whole", () => {
  assert.equal(completed("G90 g3", { code: "G38.2", text: "" }), "G90 G38.2 ");
  assert.equal(completed("M", { code: "M30", text: "" }), "M30 ");
});
