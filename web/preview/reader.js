// The worker that reads and draws a path, as the page sees it: what it has found, as signals, and what it is told.
// The rule: the page waits for nothing; what is not there yet is null.

import { signal } from "../lib/ui.js";
import { API } from "../net/http.js";

/**
 * @typedef {{
 *   bounds: (number[] | null)[], segments: number, tools: number[], heights: number[], frames: import("./path.js").Frame[],
 *   turning: string[],
 * }} Found
 */

const MOST_CORNERS = 2_500_000; // some 60 MB on the graphics card
const MOST_CORNERS_SMALL = 500_000; // of a phone or a tablet
const SMALL_GB = 4;
const SHARPEST = 2; // device pixels a pixel
const COLOURS = ["cut", "cut-done", "rapid", "rapid-done", "grid", "reach", "tool", "x", "y", "z"];

const small = () =>
  (/** @type {any} */ (navigator).deviceMemory ?? 2 * SMALL_GB) < SMALL_GB || matchMedia("(pointer: coarse)").matches;

/** @param {HTMLElement} host */
export const sizeOf = (host) => ({
  width: Math.max(host.clientWidth, 1), height: Math.max(host.clientHeight, 1), ratio: Math.min(devicePixelRatio, SHARPEST),
});

/** The colours of the page, which is light or dark. @param {HTMLElement} host @returns {Record<string, string>} */
export function coloursOf(host) {
  const style = getComputedStyle(host);
  return Object.fromEntries(COLOURS.map((name) => [name.replace("-", "_"), style.getPropertyValue(`--path-${name}`).trim()]));
}

/** @param {HTMLElement} host gets the canvas */
function canvasIn(host) {
  if (!("OffscreenCanvas" in window) || !document.createElement("canvas").getContext("webgl2")) return null;
  const canvas = document.createElement("canvas");
  host.append(canvas);
  return canvas.transferControlToOffscreen();
}

/** @param {HTMLElement} host @param {string} program @param {string | null} machine whose profile reads it */
export function readPath(host, program, machine) {
  const found = signal(/** @type {Found | null} */ (null)), problem = signal(""), blind = signal(false);
  const drawn = signal({ quality: "", count: 0, complete: false, level: 0 });
  const worker = new Worker("/web/preview/worker.js", { type: "module" });
  worker.addEventListener("message", ({ data }) => {
    if (data.type === "facts") found.value = data;
    else if (data.type === "drawn") drawn.value = { ...drawn.peek(), quality: data.quality, count: data.count };
    else if (data.type === "complete") drawn.value = { ...drawn.peek(), complete: true, level: data.level };
    else if (data.type === "blind") blind.value = true;
    else problem.value = data.message;
  });
  worker.addEventListener("error", (event) => { problem.value = event.message || "worker"; });
  const url = `${API}/programs/${program}/toolpath?${new URLSearchParams(machine ? { machine } : {})}`;
  const canvas = canvasIn(host), most = small() ? MOST_CORNERS_SMALL : MOST_CORNERS;
  worker.postMessage({ type: "open", url, most, canvas, size: sizeOf(host), colours: coloursOf(host) }, canvas ? [canvas] : []);
  return {
    found, problem, blind, drawn,
    tell: (/** @type {string} */ type, /** @type {object} */ what) => worker.postMessage({ type, ...what }),
    close() {
      worker.terminate();
      host.replaceChildren();
    },
  };
}
