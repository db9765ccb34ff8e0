// From where the drawing is looked at: turning, moving, zooming, fitting. Pure; parallel projection, Z up.
// The rule: what is under the finger stays under the finger.

/**
 * @typedef {{target: number[], azimuth: number, polar: number, mmPerPx: number}} Eye radians: azimuth 0 from the front,
 *   a quarter turn from the right; polar 0 from above
 * @typedef {"iso" | "top" | "front" | "side"} View
 */

const QUARTER = Math.PI / 2;
const RAD_PER_PX = 0.008;
const ROOM = 0.88; // of the picture for what is shown
const FINEST_MM = 1e-4, COARSEST_MM = 100; // a pixel

/** @type {Record<View, number[]>} azimuth, polar */
export const VIEWS = { iso: [0.62, 0.96], top: [0, 0], front: [0, QUARTER], side: [QUARTER, QUARTER] };

/** Right and up on the screen, and towards the eye, in the drawing. @param {Eye} eye */
export function basis({ azimuth, polar }) {
  const [ca, sa, cp, sp] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(polar), Math.sin(polar)];
  return { right: [ca, sa, 0], up: [-cp * sa, cp * ca, sp], back: [sp * sa, -sp * ca, cp] };
}

/** @param {number[]} one @param {number[]} other */
const dot = (one, other) => one[0] * other[0] + one[1] * other[1] + one[2] * other[2];

/** @param {Eye} eye @param {number} dx px @param {number} dy px, down @returns {Eye} */
export function turned(eye, dx, dy) {
  const polar = Math.min(Math.PI, Math.max(0, eye.polar - dy * RAD_PER_PX));
  return { ...eye, azimuth: eye.azimuth - dx * RAD_PER_PX, polar };
}

/** @param {Eye} eye @param {number} dx px @param {number} dy px, down @returns {Eye} */
export function moved(eye, dx, dy) {
  const { right, up } = basis(eye);
  return { ...eye, target: eye.target.map((at, axis) => at + (dy * up[axis] - dx * right[axis]) * eye.mmPerPx) };
}

/** @param {Eye} eye @param {number} times @param {number} x px right of the middle @param {number} y px below it @returns {Eye} */
export function zoomed(eye, times, x = 0, y = 0) {
  const mmPerPx = Math.min(COARSEST_MM, Math.max(FINEST_MM, eye.mmPerPx / times));
  const { right, up } = basis(eye), gone = eye.mmPerPx - mmPerPx;
  return { ...eye, mmPerPx, target: eye.target.map((at, axis) => at + (x * right[axis] - y * up[axis]) * gone) };
}

/**
 * All of it in the picture. @param {View} name @param {(number[] | null)[]} bounds mm
 * @param {number} width px @param {number} height px @returns {Eye}
 */
export function fitted(name, bounds, width, height) {
  const [azimuth, polar] = VIEWS[name];
  const ranges = bounds.map((range) => range ?? [0, 0]);
  const target = ranges.map(([low, high]) => (low + high) / 2), half = ranges.map(([low, high]) => (high - low) / 2);
  const eye = { target, azimuth, polar, mmPerPx: 1 }, { right, up } = basis(eye);
  const reach = (/** @type {number[]} */ way) => dot(half, way.map(Math.abs));
  const mmPerPx = Math.max((2 * reach(right)) / width, (2 * reach(up)) / height, 0.001) / ROOM;
  return { ...eye, mmPerPx };
}
