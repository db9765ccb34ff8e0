// Mouse, pen and fingers on the drawing: one turns it, two (or the right button, or shift) move it, pinch and wheel zoom.
// The rule: it knows nothing of what is drawn; it makes a new eye of the one before.

import { moved, turned, zoomed } from "./eye.js";

const WHEEL = 0.0015; // of a pixel of the wheel
const STILL_MS = 180; // the wheel has no end of its own

/**
 * @param {HTMLElement} host @param {() => import("./eye.js").Eye} eye @param {(eye: import("./eye.js").Eye, busy: boolean) => void} onEye
 * @returns {() => void} how to let go
 */
export function takeHold(host, eye, onEye) {
  /** @type {Map<number, {x: number, y: number}>} */
  const fingers = new Map();
  let still = 0;
  const middle = () => {
    const all = [...fingers.values()], box = host.getBoundingClientRect();
    const x = all.reduce((sum, one) => sum + one.x, 0) / all.length, y = all.reduce((sum, one) => sum + one.y, 0) / all.length;
    const wide = all.length > 1 ? Math.hypot(all[0].x - all[1].x, all[0].y - all[1].y) : 0;
    return { x: x - box.left - box.width / 2, y: y - box.top - box.height / 2, wide };
  };
  const down = (/** @type {PointerEvent} */ event) => {
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    host.setPointerCapture(event.pointerId);
  };
  const move = (/** @type {PointerEvent} */ event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = middle();
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const after = middle(), dx = after.x - before.x, dy = after.y - before.y;
    const shift = fingers.size > 1 || event.shiftKey || (event.buttons & 6) !== 0;
    let next = shift ? moved(eye(), dx, dy) : turned(eye(), dx, dy);
    if (before.wide && after.wide) next = zoomed(next, after.wide / before.wide, after.x, after.y);
    onEye(next, true);
  };
  const up = (/** @type {PointerEvent} */ event) => {
    if (fingers.delete(event.pointerId) && fingers.size === 0) onEye(eye(), false);
  };
  const wheel = (/** @type {WheelEvent} */ event) => {
    event.preventDefault();
    const box = host.getBoundingClientRect(), px = event.deltaY * (event.deltaMode === 1 ? 24 : 1);
    onEye(zoomed(eye(), Math.exp(-px * WHEEL), event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2), true);
    clearTimeout(still);
    still = setTimeout(() => onEye(eye(), false), STILL_MS);
  };
  const menu = (/** @type {Event} */ event) => event.preventDefault();
  host.addEventListener("pointerdown", down);
  host.addEventListener("pointermove", move);
  host.addEventListener("pointerup", up);
  host.addEventListener("pointercancel", up);
  host.addEventListener("wheel", wheel, { passive: false });
  host.addEventListener("contextmenu", menu);
  return () => {
    clearTimeout(still);
    host.removeEventListener("pointerdown", down);
    host.removeEventListener("pointermove", move);
    host.removeEventListener("pointerup", up);
    host.removeEventListener("pointercancel", up);
    host.removeEventListener("wheel", wheel);
    host.removeEventListener("contextmenu", menu);
  };
}
