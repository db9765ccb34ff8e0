// The last minutes of a machine as columns of numbers, for plots. Pure; bounded: the oldest goes when it is full.
// The rule: what was not said is a gap (null in a plot), and between two messages the old value holds.

export const COLUMNS = ["feed", "spindle", "x", "y", "z", "a", "b", "c", "batch", "ack"];
export const CAPACITY = 18_000; // 15 minutes at 20 states a second: 1.6 MB a machine
const HOLDS_S = 1; // after so long without a message the old value is written once more before the new one

/** @typedef {Record<string, number | null | undefined>} Sample by column */

export class Ring {
  /** @param {number} [capacity] */
  constructor(capacity = CAPACITY) {
    this.capacity = capacity;
    this.count = 0;
    this.at = new Float64Array(capacity); // s
    this.columns = COLUMNS.map(() => new Float64Array(capacity).fill(NaN));
  }

  /** The newest time, null while there is none. */
  get last() {
    return this.count ? this.at[(this.count - 1) % this.capacity] : null;
  }

  /** @param {number} at s, never before the one before @param {Sample} sample */
  push(at, sample) {
    const { last } = this;
    if (last !== null && at < last) return; // a clock that was set back: wait until it has caught up
    if (last !== null && at - last > HOLDS_S) this.write(at - 0.001, (column) => column[(this.count - 1) % this.capacity]);
    this.write(at, (_, place) => sample[COLUMNS[place]] ?? NaN);
  }

  /** @param {number} at @param {(column: Float64Array, place: number) => number} value */
  write(at, value) {
    const to = this.count % this.capacity;
    this.columns.forEach((column, place) => { column[to] = value(column, place); });
    this.at[to] = at;
    this.count += 1;
  }

  /** Whether a column has ever been said, as far as is remembered. @param {string} name */
  has(name) {
    return this.columns[COLUMNS.indexOf(name)].some((value) => !Number.isNaN(value));
  }

  get oldest() {
    return Math.max(0, this.count - this.capacity);
  }

  /** The first sample for which it is not so. @param {(at: number) => boolean} before */
  placeOf(before) {
    let low = this.oldest, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (before(this.at[middle % this.capacity])) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /**
   * The samples from `from` to `to`, and the one before them, oldest first; the newest value holds until `to`, unless that
   * is Infinity.
   * @param {string[]} names @param {number} from s @param {number} to s
   * @returns {(number | null)[][]} times, then a row for each name
   */
  rows(names, from, to) {
    const first = Math.max(this.oldest, this.placeOf((at) => at < from) - 1), size = this.placeOf((at) => at <= to) - first;
    const read = (/** @type {Float64Array} */ column) => Array.from({ length: size }, (_, place) => column[(first + place) % this.capacity]);
    const times = read(this.at), rows = names.map((name) => read(this.columns[COLUMNS.indexOf(name)]).map((value) => (Number.isNaN(value) ? null : value)));
    if (size && times[size - 1] < to && to !== Infinity) {
      times.push(to);
      for (const row of rows) row.push(row[size - 1]);
    }
    return [times, ...rows];
  }
}

/** What a message about the state holds for a plot. @param {any} data @returns {Sample} */
export function sampleOf(data) {
  if (data.link !== undefined && data.link !== "connected") return {};
  const { feed, spindle, position, ack_s: ack, batch_s: batch } = data;
  return { feed, spindle, ...position?.work, batch, ack: typeof ack === "number" ? ack * 1000 : null };
}
