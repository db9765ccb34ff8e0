// The lines of a program by pages, fetched as they are wanted. The rule: a bounded number of pages is kept, and a page
// that could not be fetched is asked for again.

import { get } from "../net/http.js";

const PAGE = 400; // lines in one request
const PAGES_KEPT = 40;

/** Of one program. */
export class Lines {
  /** @param {string} id @param {number} count @param {() => void} arrived */
  constructor(id, count, arrived) {
    this.id = id;
    this.count = count;
    this.arrived = arrived;
    /** @type {Map<number, string[] | null>} */
    this.pages = new Map();
  }

  /** @param {number} line from 1 @returns {string | null} null while it is on its way */
  text(line) {
    const page = this.pages.get(Math.floor((line - 1) / PAGE));
    return page ? (page[(line - 1) % PAGE] ?? "") : null;
  }

  /** @param {number} first @param {number} last lines from 1 */
  want(first, last) {
    for (let page = Math.floor((first - 1) / PAGE); page * PAGE < last; page++) {
      if (page < 0) continue;
      const known = this.pages.get(page);
      this.pages.delete(page); // set again: the ones looked at last are the last to go
      this.pages.set(page, known ?? null);
      if (known !== undefined) continue;
      const from = page * PAGE + 1, to = Math.min(this.count, from + PAGE - 1);
      get(`/programs/${this.id}/source?from=${from}&to=${to}`).then(({ lines }) => {
        this.pages.set(page, lines.map((/** @type {{text: string}} */ one) => one.text));
        for (const old of this.pages.keys()) if (this.pages.size > PAGES_KEPT && old !== page) this.pages.delete(old);
        this.arrived();
      }, () => this.pages.delete(page));
    }
  }
}
