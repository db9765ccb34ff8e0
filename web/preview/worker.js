// Fetches a toolpath, makes what is drawn of it and draws it, beside the page, which stays quick meanwhile. A module worker.
// The rule: first the smallest level, so that there is something to see at once; then finer ones, as fine as this device
// draws in good time.

import { CHORD_MM, decodeToolpath } from "../toolpath.js";
import { boundsOf, drawingOf, framesOf, layersOf, levelWithin, toolsOf, turningOf } from "./path.js";

/**
 * @typedef {"coarse" | "fine"} Quality
 * @typedef {{path: import("../toolpath.js").Toolpath, layers: import("./path.js").Layers}} Known
 * @typedef {{type: "open", url: string, most: number, canvas: OffscreenCanvas | null, size: import("./scene.js").Size,
 *   colours: Record<string, string>}} Open `url` lacks the level; `most` corners; without a canvas only the figures are read
 */

const SMALLEST = 4; // the last of all levels; docs/toolpath.md
const CHORDS_ACROSS = 8000; // nobody sees a chord that is off by less than this part of the whole
const PATIENCE_MS = 250; // for one picture that stands still
const AT_ONCE = 30; // times as many corners as those that were measured, no more

const page = /** @type {any} */ (self);
/** @type {Map<Quality, Known>} */
const known = new Map();
/** @type {import("./path.js").Wish} */
let wish = { tools: null, lowest: null, highest: null, rapids: true };
/** @type {import("./scene.js").Scene | null} */
let scene = null;
/** What was told before the scene was there. @type {Map<string, any>} */
const waiting = new Map();

page.onmessage = (/** @type {{data: any}} */ { data }) => {
  if (data.type === "open") open(data).catch((error) => page.postMessage({ type: "failed", message: error.message }));
  else if (data.type === "wish") filter(data.wish);
  else if (scene) TELL[data.type](scene, data);
  else waiting.set(data.type, data);
};

/** @type {Record<string, (scene: import("./scene.js").Scene, data: any) => void>} */
const TELL = {
  eye: (on, { eye, turning }) => on.setEye(eye, turning),
  size: (on, { size }) => on.setSize(size),
  colours: (on, { colours }) => on.setColours(colours),
  line: (on, { line }) => on.setLine(line),
  tool: (on, { at }) => on.setTool(at),
  reach: (on, { box }) => on.setReach(box),
};

/** @param {Open} asked */
async function open(asked) {
  const { url } = asked;
  const coarse = await read(url, SMALLEST, CHORD_MM);
  const { head, origin } = coarse.path, bounds = boundsOf(head);
  known.set("coarse", coarse);
  tell(coarse);
  scene = await sceneOf(asked).catch(() => null);
  if (!scene) return page.postMessage({ type: "blind" });
  scene.begin(origin, bounds);
  for (const data of waiting.values()) TELL[data.type](scene, data);
  show("coarse", coarse);
  const across = Math.hypot(...bounds.map((range) => (range ? range[1] - range[0] : 0)));
  return refine(scene, url, coarse, Math.max(CHORD_MM, across / CHORDS_ACROSS), asked.most);
}

/** @param {import("./scene.js").Scene} on @param {string} url @param {Known} coarse @param {number} chordMm @param {number} most */
async function refine(on, url, coarse, chordMm, most) {
  const { levels } = coarse.path.head;
  let now = coarse, quality = /** @type {Quality} */ ("coarse");
  for (;;) {
    const tookMs = await on.measure(quality), corners = now.path.edges.length;
    const may = Math.min(most, corners * Math.min(AT_ONCE, PATIENCE_MS / Math.max(tookMs, 0.1)));
    const next = levelWithin(levels, may);
    if (next >= now.path.head.level) break;
    now = await read(url, next, chordMm);
    quality = "fine";
    known.set(quality, now);
    show(quality, now);
    tell(now);
  }
  page.postMessage({ type: "complete", level: now.path.head.level });
}

/** @param {Open} asked three.js is loaded here, and only now */
async function sceneOf({ canvas, size, colours }) {
  if (!canvas) return null;
  const { Scene } = await import("./scene.js");
  const made = new Scene(canvas, size, (quality, count) => page.postMessage({ type: "drawn", quality, count }));
  canvas.addEventListener("webglcontextlost", () => page.postMessage({ type: "blind" }));
  made.setColours(colours);
  return made;
}

/** @param {string} url @param {number} level @param {number} chordMm @returns {Promise<Known>} */
async function read(url, level, chordMm) {
  const response = await fetch(`${url}&level=${level}`);
  if (!response.ok) throw new Error((await response.json().catch(() => ({}))).detail ?? `HTTP ${response.status}`);
  const path = decodeToolpath(await response.arrayBuffer(), { chordMm });
  return { path, layers: layersOf(path) };
}

/** What is known of the path, for the page. @param {Known} read */
function tell({ path, layers }) {
  const { head } = path;
  page.postMessage({
    type: "facts", bounds: boundsOf(head), segments: head.segments, tools: toolsOf(path), heights: layers.heights,
    frames: framesOf(path), turning: turningOf(path),
  });
}

/** @param {Quality} quality @param {Known} read */
function show(quality, { path, layers }) {
  scene?.setPath(quality, path.positions, drawingOf(path, layers, wish));
}

/** @param {import("./path.js").Wish} wished */
function filter(wished) {
  wish = wished;
  for (const [quality, { path, layers }] of known) scene?.setDrawing(quality, drawingOf(path, layers, wished));
}
