// Scrolling through more rows than a browser can stack: which rows are in sight, for a million lines as for ten. Pure.
// The rule: a page is never higher than every browser can do; beyond, the bar is a scale, while wheel and keys go on
// moving by rows.

export const ROW_PX = 24;
export const HIGHEST_PX = 5_000_000; // Firefox ends near 17 million, others near 33 million

/**
 * @param {number} rows
 * @param {number} viewPx
 */
export function measures(rows, viewPx) {
  const truePx = rows * ROW_PX;
  const pagePx = Math.min(truePx, HIGHEST_PX);
  const scale = pagePx > viewPx ? (truePx - viewPx) / (pagePx - viewPx) : 1;
  return { truePx, pagePx, scale: Math.max(1, scale) };
}

/**
 * The rows from the first to the last in sight, one more at each end.
 * @param {number} offsetPx into the true height
 * @param {number} viewPx
 * @param {number} rows
 */
export function inSight(offsetPx, viewPx, rows) {
  const first = Math.max(0, Math.floor(offsetPx / ROW_PX) - 1);
  const last = Math.min(rows - 1, Math.ceil((offsetPx + viewPx) / ROW_PX) + 1);
  return { first, last };
}

/** @param {number} offsetPx @param {number} viewPx @param {number} rows */
export function within(offsetPx, viewPx, rows) {
  return Math.min(Math.max(0, offsetPx), Math.max(0, rows * ROW_PX - viewPx));
}
