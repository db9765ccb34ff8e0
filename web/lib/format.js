// Figures in words people read: coordinates, durations, sizes, what is left of a job. Pure.
// The rule: a figure never pretends to be more certain than it is.

const NARROW = 0.2; // a range no wider than this part of the estimate is shown as one figure

/** A coordinate. A point as in the program, whatever the language: it is what stands in the G-code. @param {number} value */
export function coordinate(value) {
  const text = value.toFixed(3);
  return text === "-0.000" ? "0.000" : text;
}

/** 12:05, 1:02:05. @param {number} seconds */
export function clock(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  const pad = (/** @type {number} */ part) => String(part).padStart(2, "0");
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  return hours ? `${hours}:${pad(minutes)}:${pad(whole % 60)}` : `${minutes}:${pad(whole % 60)}`;
}

/**
 * What is left: one figure, or two while it is uncertain; null while nothing is known.
 * @param {import("../types.js").Progress} progress
 * @returns {string | null}
 */
export function remaining({ seconds_left: left, seconds_left_min: least, seconds_left_max: most }) {
  if (left === null || least === null || most === null) return null;
  const narrow = most - least <= Math.max(2, NARROW * left) || clock(least) === clock(most);
  return narrow ? `≈ ${clock(left)}` : `${clock(least)} – ${clock(most)}`;
}

/** How much of what was asked for is certainly done. @param {import("../types.js").Job} job */
export function percent({ progress, start_line: start }) {
  const all = Math.max(1, progress.lines - start + 1);
  return { all, percent: Math.min(100, Math.floor((100 * progress.acknowledged_lines) / all)) };
}

/** @param {number} bytes */
export function size(bytes) {
  if (bytes < 1024) return `${bytes} B`;
  const units = ["KiB", "MiB", "GiB"];
  let value = bytes / 1024, unit = 0;
  for (; value >= 1024 && unit < units.length - 1; unit++) value /= 1024;
  return `${value < 10 ? value.toFixed(1) : Math.round(value)} ${units[unit]}`;
}

/** Blanks before it or not; the wide signs are computed by spreadsheets that are set to Chinese or Japanese. */
const FORMULA = /^(?:[\t\r\n]|[\s\u200b-\u200f\u2060]*[=+\-@＝＋－＠])/;

/**
 * Rows as CSV (RFC 4180). A cell that a spreadsheet would take for a formula is made a text.
 * @param {string[]} columns
 * @param {Record<string, unknown>[]} rows
 */
export function csv(columns, rows) {
  const cell = (/** @type {unknown} */ value) => {
    const text = value === null || value === undefined ? "" : typeof value === "object" ? JSON.stringify(value) : String(value);
    const safe = typeof value === "string" && FORMULA.test(text) ? `'${text}` : text;
    return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
  };
  return [columns, ...rows.map((row) => columns.map((column) => row[column]))]
    .map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
}
