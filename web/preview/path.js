// What is drawn of a decoded toolpath: edges by kind, by tool, by layer, and how many of them are done. Pure.
// Not the reading (toolpath.js), not the drawing (scene.js). The rule: edges stay in the order of the program, so what
// is done is always the first part of them.

import { HOMING, RAPID } from "../toolpath.js";

export const MOST_LAYERS = 100; // more heights than that are cut into so many slices
const NONE = 255;
const HIDDEN = 0, CUT = 1, MOVE = 2;
const KIND = 0x7f;

/**
 * @typedef {{heights: number[], of: Uint8Array}} Layers `heights`: where each begins, mm, ascending; `of`: by vertex
 * @typedef {{tools: number[] | null, lowest: number | null, highest: number | null, rapids: boolean}} Wish layers from
 *   `lowest` to `highest` mm; null: every tool, no bound
 * @typedef {{index: Uint32Array, lines: Uint32Array}} Edges two places in the positions for each edge; its line
 * @typedef {{cut: Edges, rapid: Edges}} Drawing
 * @typedef {{line: number, offset: number[]}} Frame from this line on
 */

/** @param {number} kind */
const moves = (kind) => (kind & KIND) === RAPID || (kind & KIND) === HOMING;

/** The tools that some edge is made with, ascending; -1: not known. @param {import("../toolpath.js").Toolpath} path */
export function toolsOf({ edges, tools }) {
  const found = new Set();
  for (let v = 1; v < edges.length; v++) if (edges[v]) found.add(tools[v]);
  return [...found].sort((one, other) => one - other);
}

/** The rotary axes that turn; one that only has a place turns nothing. @param {import("../toolpath.js").Toolpath} path */
export function turningOf({ rotary }) {
  return Object.keys(rotary).filter((axis) => rotary[axis].some((/** @type {number} */ at) => !Object.is(at, rotary[axis][0])));
}

/**
 * A cut belongs to the layer of its lower end, so a plunge belongs to where it leads.
 * @param {import("../toolpath.js").Toolpath} path @returns {Layers}
 */
export function layersOf({ edges, kinds, positions, origin }) {
  const z = (/** @type {number} */ v) => Math.round(1000 * (Math.min(positions[3 * v - 1], positions[3 * v + 2]) + origin[2]));
  const of = new Uint8Array(edges.length).fill(NONE), found = new Set();
  let low = Infinity, high = -Infinity;
  for (let v = 1; v < edges.length; v++) {
    if (!edges[v] || moves(kinds[v])) continue;
    const here = z(v);
    low = Math.min(low, here);
    high = Math.max(high, here);
    if (found.size <= MOST_LAYERS) found.add(here);
  }
  const sliced = found.size > MOST_LAYERS, thick = (high - low) / MOST_LAYERS;
  const counts = sliced ? Array.from({ length: MOST_LAYERS }, (_, slice) => low + slice * thick) : [...found].sort((a, b) => a - b);
  const places = new Map(counts.map((height, place) => [height, place]));
  for (let v = 1; v < edges.length; v++) {
    if (!edges[v] || moves(kinds[v])) continue;
    of[v] = sliced ? Math.min(MOST_LAYERS - 1, Math.floor((z(v) - low) / thick)) : /** @type {number} */ (places.get(z(v)));
  }
  return { heights: counts.map((height) => height / 1000), of };
}

/**
 * The edges that are wished for.
 * @param {import("../toolpath.js").Toolpath} path @param {Layers} layers @param {Wish} wish @returns {Drawing}
 */
export function drawingOf({ edges, kinds, tools, lines }, layers, wish) {
  const looks = new Uint8Array(edges.length), counts = [0, 0, 0], wanted = wish.tools && new Set(wish.tools);
  const seen = layers.heights.map((height) => height >= (wish.lowest ?? -Infinity) && height <= (wish.highest ?? Infinity));
  for (let v = 1; v < edges.length; v++) {
    if (!edges[v] || (wanted && !wanted.has(tools[v]))) continue;
    if (moves(kinds[v])) looks[v] = wish.rapids ? MOVE : HIDDEN;
    else looks[v] = seen[layers.of[v]] ? CUT : HIDDEN;
    counts[looks[v]] += 1;
  }
  const made = [CUT, MOVE].map((look) => ({ index: new Uint32Array(2 * counts[look]), lines: new Uint32Array(counts[look]) }));
  const next = [0, 0];
  for (let v = 1; v < edges.length; v++) {
    if (!looks[v]) continue;
    const which = looks[v] - CUT, at = next[which]++, { index, lines: its } = made[which];
    index[2 * at] = v - 1;
    index[2 * at + 1] = v;
    its[at] = lines[v];
  }
  return { cut: made[0], rapid: made[1] };
}

/** How many of these edges are done when `line` is. @param {Uint32Array} lines ascending @param {number} line */
export function doneOf(lines, line) {
  let low = 0, high = lines.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (lines[middle] <= line) low = middle + 1;
    else high = middle;
  }
  return low;
}

/**
 * Where the program moves its zero: program coordinate = drawn coordinate − offset.
 * @param {import("../toolpath.js").Toolpath} path @returns {Frame[]}
 */
export function framesOf({ frames, lines, head }) {
  const letters = ["X", "Y", "Z"].map((letter) => head.axes.indexOf(letter));
  /** @type {Frame[]} */
  const found = [];
  for (let v = 0; v < frames.length; v++) {
    if (v > 0 && frames[v] === frames[v - 1]) continue;
    found.push({ line: lines[v], offset: letters.map((axis) => (axis < 0 ? 0 : (head.frames[frames[v]]?.[axis] ?? 0))) });
  }
  return found;
}

/** The offset that holds behind `line`. @param {Frame[]} frames @param {number} line @returns {number[]} */
export function offsetAt(frames, line) {
  let found = frames[0]?.offset ?? [0, 0, 0];
  for (const frame of frames) if (frame.line <= line) found = frame.offset;
  return found;
}

/** Lowest and highest of X, Y, Z in mm, null where there is none. @param {import("../toolpath.js").Toolpath["head"]} head */
export function boundsOf(head) {
  return ["X", "Y", "Z"].map((letter) => {
    const [low, high] = head.bounds[head.axes.indexOf(letter)] ?? [NaN, NaN];
    return Number.isFinite(low) && Number.isFinite(high) ? [low, high] : null;
  });
}

/**
 * The finest level that is no more than `most` corners, arcs counted as what becomes of them; else the coarsest.
 * @param {import("../toolpath.js").Level[]} levels @param {number} most
 */
export function levelWithin(levels, most) {
  const CHORDS = 8; // of an arc, about
  const fits = levels.findIndex(({ vertices, arcs }) => vertices + CHORDS * arcs <= most);
  return fits < 0 ? levels.length - 1 : fits;
}
