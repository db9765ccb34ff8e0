// What is drawn of a path (web/preview/path.js), where the machine is in it (place.js), how it is looked at (eye.js).
import assert from "node:assert/strict";
import { test } from "node:test";
import { basis, fitted, moved, turned, zoomed } from "./web/preview/eye.js";
import { doneOf, drawingOf, framesOf, layersOf, levelWithin, MOST_LAYERS, offsetAt, toolsOf, turningOf } from "./web/preview/path.js";
import { beyond, reachIn, toolAt } from "./web/preview/place.js";

const RAPID = 0, FEED = 1, HOMING = 5;
const ALL = { tools: null, lowest: null, highest: null, rapids: true };

/** A path through corners [z, kind, tool, line]; the first is where it begins. */
function path(corners) {
  return {
    positions: Float32Array.from(corners.flatMap(([z], at) => [at, 0, z])), origin: [0, 0, 0],
    edges: Uint8Array.from(corners, (_, at) => (at ? 1 : 0)), kinds: Uint8Array.from(corners, ([, kind]) => kind),
    tools: Int32Array.from(corners, ([, , tool]) => tool), lines: Uint32Array.from(corners, ([, , , line]) => line),
    frames: new Uint32Array(corners.length), head: { axes: "XYZ", frames: [[0, 0, 0]] },
  };
}

const PART = path([[5, RAPID, 1, 1], [5, RAPID, 1, 2], [-1, FEED, 1, 3], [-1, FEED, 1, 4], [5, RAPID, 1, 5], [5, HOMING, 2, 6], [-2, FEED, 2, 7], [-2, FEED, 2, 8]]);

test("an axis that stands where it is turns nothing", () => {
  const rotary = { A: Float64Array.of(0, 0, 90), B: Float64Array.of(5, 5, 5), C: Float64Array.of(NaN, NaN) };
  assert.deepEqual(turningOf({ ...PART, rotary }), ["A"]);
});

test("cuts and rapids are apart, each in the order of the program, homing among the rapids", () => {
  const { cut, rapid } = drawingOf(PART, layersOf(PART), ALL);
  assert.deepEqual([...cut.lines], [3, 4, 7, 8]);
  assert.deepEqual([...rapid.lines], [2, 5, 6]);
  assert.deepEqual([...cut.index], [1, 2, 2, 3, 5, 6, 6, 7]);
});

test("what is not there is not drawn", () => {
  const broken = { ...PART, edges: Uint8Array.from([0, 1, 1, 0, 1, 1, 1, 1]) };
  assert.deepEqual([...drawingOf(broken, layersOf(broken), ALL).cut.lines], [3, 7, 8]);
});

test("a plunge belongs to the layer that it leads to", () => {
  const layers = layersOf(PART);
  assert.deepEqual(layers.heights, [-2, -1]);
  assert.deepEqual([...drawingOf(PART, layers, { ...ALL, lowest: -1 }).cut.lines], [3, 4]);
  assert.deepEqual([...drawingOf(PART, layers, { ...ALL, highest: -2 }).cut.lines], [7, 8]);
});

test("tools and rapids can be left out", () => {
  assert.deepEqual(toolsOf(PART), [1, 2]);
  const { cut, rapid } = drawingOf(PART, layersOf(PART), { ...ALL, tools: [2], rapids: false });
  assert.deepEqual([[...cut.lines], rapid.lines.length], [[7, 8], 0]);
});

test("more heights than anybody can choose from become slices, none of them lost", () => {
  const relief = path(Array.from({ length: 5000 }, (_, at) => [Math.sin(at) * 3, FEED, 1, at]));
  const layers = layersOf(relief);
  assert.equal(layers.heights.length, MOST_LAYERS);
  assert.equal(drawingOf(relief, layers, ALL).cut.lines.length, 4999);
  const half = layers.heights[MOST_LAYERS / 2];
  const below = drawingOf(relief, layers, { ...ALL, highest: half }).cut.lines.length;
  const above = drawingOf(relief, layers, { ...ALL, lowest: layers.heights[MOST_LAYERS / 2 + 1] }).cut.lines.length;
  assert.equal(below + above, 4999);
  assert.ok(below > 1000 && above > 500);
});

test("a program without cuts has no layers", () => {
  const rapids = path([[5, RAPID, 1, 1], [1, RAPID, 1, 2]]);
  const layers = layersOf(rapids);
  assert.deepEqual(layers.heights, []);
  assert.equal(drawingOf(rapids, layers, ALL).rapid.lines.length, 1);
});

test("what is done is the first part, the line itself included", () => {
  const lines = Uint32Array.from([2, 2, 5, 7]);
  assert.deepEqual([0, 2, 4, 5, 7, 99].map((line) => doneOf(lines, line)), [0, 2, 2, 3, 4, 4]);
  assert.equal(doneOf(new Uint32Array(0), 5), 0);
});

test("a zero that the program moves shifts the tool from its line on", () => {
  const shifted = { ...PART, frames: Uint32Array.from([0, 0, 0, 0, 1, 1, 1, 1]), head: { axes: "XYZ", frames: [[0, 0, 0], [10, 0, -1]] } };
  const frames = framesOf(shifted);
  assert.deepEqual(frames, [{ line: 1, offset: [0, 0, 0] }, { line: 5, offset: [10, 0, -1] }]);
  assert.deepEqual([offsetAt(frames, 4), offsetAt(frames, 6), offsetAt([], 6)], [[0, 0, 0], [10, 0, -1], [0, 0, 0]]);
  assert.deepEqual(toolAt({ work: { x: 1, y: 2, z: 3 }, machine: {} }, offsetAt(frames, 6)), [11, 2, 2]);
});

test("the finest level that may be drawn, arcs counted as their chords, else the coarsest", () => {
  const levels = [[1000, 100], [300, 10], [90, 0]].map(([vertices, arcs]) => ({ vertices, arcs }));
  assert.deepEqual([5000, 1799, 379, 10].map((most) => levelWithin(levels, most)), [0, 1, 2, 2]);
});

test("the tool is nowhere until the machine has said where it is", () => {
  assert.equal(toolAt({ work: { x: 1 }, machine: {} }, [0, 0, 0]), null);
  assert.deepEqual(toolAt({ work: { x: 1, y: 2 }, machine: {} }, [0, 0, 0]), [1, 2, 0]);
});

test("the reach is shifted by the present zero, and told only where both coordinates are known", () => {
  const position = { work: { x: 10, y: 20, z: 0 }, machine: { x: -90, y: -80, z: -30 } };
  const reach = reachIn({ x: [-200, 0], y: [-200, 0], z: [-60, 0] }, position, [0, 0, 0], [null, null, null]);
  assert.deepEqual(reach, { low: [-100, -100, -30], high: [100, 100, 30] });
  assert.deepEqual(beyond([[0, 100.0004], [-101, 0], [-30, 31]], reach), ["y", "z"]);
  assert.equal(reachIn({ x: [-200, 0] }, position, [0, 0, 0], [null, null, null]), null);
  assert.equal(reachIn({ x: [0, 1], y: [0, 1] }, { work: { x: 1, y: 1 }, machine: {} }, [0, 0, 0], [null, null, null]), null);
  assert.deepEqual(reachIn({ x: [-200, 0], y: [-200, 0] }, position, [0, 0, 0], [null, null, [-5, 5]])?.low[2], -5);
});

const EYE = { target: [0, 0, 0], azimuth: 0, polar: 0, mmPerPx: 0.5 };
const near = (one, other) => one.every((value, axis) => Math.abs(value - other[axis]) < 1e-9);

test("from above Y is up, from the front Z is, and the three ways stay square however it is turned", () => {
  assert.ok(near(basis(EYE).up, [0, 1, 0]) && near(basis(EYE).back, [0, 0, 1]));
  const front = fitted("front", [[0, 10], [0, 10], [0, 10]], 100, 100);
  assert.ok(near(basis(front).up, [0, 0, 1]) && near(basis(front).right, [1, 0, 0]));
  const { right, up, back } = basis(turned(turned(EYE, 37, -80), -500, -21));
  const dot = (one, other) => one.reduce((sum, value, axis) => sum + value * other[axis], 0);
  for (const [one, other, wanted] of [[right, up, 0], [up, back, 0], [right, back, 0], [right, right, 1], [up, up, 1]]) {
    assert.ok(Math.abs(dot(one, other) - wanted) < 1e-12);
  }
});

test("what is under the finger stays there while it is moved and zoomed", () => {
  const eye = turned(EYE, 40, -60);
  const at = ({ target, mmPerPx }, x, y) => target.map((value, axis) => value + (x * basis(eye).right[axis] - y * basis(eye).up[axis]) * mmPerPx);
  assert.ok(near(at(eye, 30, -12), at(moved(eye, 7, 5), 37, -7)));
  assert.ok(near(at(eye, 30, -12), at(zoomed(eye, 3, 30, -12), 30, -12)));
});

test("all of it is in the picture from every side, also a flat or an empty path", () => {
  for (const view of ["iso", "top", "front", "side"]) {
    for (const bounds of [[[0, 100], [-50, 50], [-5, 5]], [[3, 3], [3, 3], null]]) {
      const eye = fitted(view, bounds, 300, 200), { right, up } = basis(eye);
      assert.ok(eye.mmPerPx > 0 && Number.isFinite(eye.mmPerPx));
      for (const corner of [0, 1, 2, 3, 4, 5, 6, 7]) {
        const way = bounds.map((range, axis) => (range ?? [0, 0])[(corner >> axis) & 1] - eye.target[axis]);
        const px = [right, up].map((axis) => Math.abs(way.reduce((sum, value, at) => sum + value * axis[at], 0)) / eye.mmPerPx);
        assert.ok(px[0] <= 150 && px[1] <= 100);
      }
    }
  }
});
