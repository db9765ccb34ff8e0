// The memory of the plots (web/telemetry/ring.js): bounded, in order, with gaps where nothing was said.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Ring, sampleOf } from "./web/telemetry/ring.js";

test("the oldest goes when it is full, and the order stays", () => {
  const ring = new Ring(5);
  for (let at = 0; at < 12; at++) ring.push(at / 2, { feed: at });
  assert.deepEqual(ring.rows(["feed"], -Infinity, Infinity), [[3.5, 4, 4.5, 5, 5.5], [7, 8, 9, 10, 11]]);
  assert.equal(ring.last, 5.5);
});

test("only what is asked for, with the sample before it, and the newest holds until now", () => {
  const ring = new Ring(10);
  for (let at = 0; at < 6; at++) ring.push(at / 2, { feed: at });
  assert.deepEqual(ring.rows(["feed"], 1.9, 4), [[1.5, 2, 2.5, 4], [3, 4, 5, 5]]);
  assert.deepEqual(ring.rows(["feed"], 1, 2.2), [[0.5, 1, 1.5, 2, 2.2], [1, 2, 3, 4, 4]]);
  assert.deepEqual(new Ring(10).rows(["feed"], 0, 4), [[], []]);
});

test("between two messages the old value holds", () => {
  const ring = new Ring(10);
  ring.push(10, { feed: 1 });
  ring.push(20, { feed: 9 });
  assert.deepEqual(ring.rows(["feed"], 0, Infinity), [[10, 19.999, 20], [1, 1, 9]]);
});

test("what was not said is a gap, and what is never said has no plot", () => {
  const ring = new Ring(10);
  ring.push(1, sampleOf({ link: "connected", feed: 5, spindle: null, position: { work: { x: 1.5 } }, ack_s: 0.02, batch_s: null }));
  ring.push(1.5, sampleOf({ link: "connecting", feed: 5, position: { work: { x: 1.5 } } }));
  assert.deepEqual(ring.rows(["feed", "x", "ack"], 0, Infinity).slice(1), [[5, null], [1.5, null], [20, null]]);
  assert.deepEqual(["feed", "x", "ack", "spindle", "y", "batch"].map((name) => ring.has(name)), [true, true, true, false, false, false]);
});

test("a clock that was set back writes nothing out of order", () => {
  const ring = new Ring(10);
  for (const at of [5, 4, 4.9, 5.5]) ring.push(at, { feed: at });
  assert.deepEqual(ring.rows(["feed"], 0, Infinity), [[5, 5.5], [5, 5.5]]);
});
