// Where the machine is in the drawing of a program: its tool, its reach, and what lies beyond that. Pure.
// The rule: a drawing begins at the zero of the program; the machine's own coordinates are shifted by what it says of both,
// and where it does not say both nothing is shown.

/** @typedef {import("../types.js").State["position"]} Position */
/** @typedef {{low: number[], high: number[]}} Box */

const AXES = ["x", "y", "z"];
const SLACK_MM = 0.0005;

/**
 * The tool in the drawing, null where X or Y is not known; a Z that is not known is 0.
 * @param {Position} position @param {number[]} offset that the program has set itself at its present line
 */
export function toolAt({ work }, offset) {
  if (work.x === undefined || work.y === undefined) return null;
  return AXES.map((axis, place) => (work[axis] ?? 0) + offset[place]);
}

/**
 * The reach of the machine in the drawing; null where X or Y is not known. An axis without a configured travel takes
 * that of the program.
 * @param {Record<string, number[]>} travel machine coordinates @param {Position} position
 * @param {number[]} offset @param {(number[] | null)[]} bounds of the program @returns {Box | null}
 */
export function reachIn(travel, { work, machine }, offset, bounds) {
  const ranges = AXES.map((axis, place) => {
    if (!travel[axis] || work[axis] === undefined || machine[axis] === undefined) return null;
    const shift = work[axis] - machine[axis] + offset[place];
    return travel[axis].map((end) => end + shift);
  });
  if (!ranges[0] || !ranges[1]) return null;
  const whole = ranges.map((range, place) => range ?? bounds[place] ?? [0, 0]);
  return { low: whole.map(([low]) => low), high: whole.map(([, high]) => high) };
}

/** The axes along which the program goes beyond. @param {(number[] | null)[]} bounds @param {Box} reach */
export function beyond(bounds, { low, high }) {
  return AXES.filter((_, place) => {
    const range = bounds[place];
    return range !== null && (range[0] < low[place] - SLACK_MM || range[1] > high[place] + SLACK_MM);
  });
}
