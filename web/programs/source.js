// The source of a program, however long: only the lines in sight are fetched and drawn.
// The rule: a line is shown as it stands in the file, as text; a million of them open as fast as ten.

import { html, useEffect, useLayoutEffect, useRef, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { get } from "../net/http.js";
import { inSight, measures, ROW_PX, within } from "./scroll.js";

const PAGE = 400; // lines in one request
const PAGES_KEPT = 40;
const SETTLE_MS = 70; // while the bar is dragged, nothing is fetched

/** The lines of a program by pages, the ones used last kept. */
class Lines {
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
      if (page < 0 || this.pages.has(page)) continue;
      this.pages.set(page, null);
      const from = page * PAGE + 1, to = Math.min(this.count, from + PAGE - 1);
      get(`/programs/${this.id}/source?from=${from}&to=${to}`).then(({ lines }) => {
        this.pages.set(page, lines.map((/** @type {{text: string}} */ one) => one.text));
        for (const old of this.pages.keys()) if (this.pages.size > PAGES_KEPT && old !== page) this.pages.delete(old);
        this.arrived();
      }, () => this.pages.delete(page));
    }
  }
}

/**
 * @param {{program: import("../types.js").Program, findings: any, line: import("../vendor/signals.js").Signal<number>, current: number}} props
 * `line`: the one to show, set by a touch on a finding; `current`: the last one done, 0 without a job
 */
export function Source({ program, findings, line, current }) {
  const [, redraw] = useState(0);
  const again = () => redraw((n) => n + 1);
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  const offset = useRef(0);
  const [lines] = useState(() => new Lines(program.id, program.lines, again));
  const [follow, setFollow] = useState(false);
  const viewPx = box.current?.clientHeight ?? 480;
  const { pagePx, scale } = measures(program.lines, viewPx);
  const { first, last } = inSight(offset.current, viewPx, program.lines);

  function move(/** @type {number} */ px) {
    offset.current = within(px, box.current?.clientHeight ?? viewPx, program.lines);
    if (box.current) box.current.scrollTop = offset.current / scale;
    again();
  }
  const show = (/** @type {number} */ wanted) => move((wanted - 1) * ROW_PX - viewPx / 3);
  function scrolled() {
    const top = box.current?.scrollTop ?? 0;
    // What `move` has set comes back rounded; only a person's own scrolling is more than that.
    if (Math.abs(top - offset.current / scale) > 1) { offset.current = top * scale; again(); }
  }
  function wheel(/** @type {WheelEvent} */ event) {
    if (scale === 1 || event.ctrlKey) return;
    event.preventDefault();
    move(offset.current + event.deltaY * (event.deltaMode === 1 ? ROW_PX : 1));
  }
  function key(/** @type {KeyboardEvent} */ event) {
    /** @type {Record<string, number>} */
    const by = { ArrowDown: ROW_PX, ArrowUp: -ROW_PX, PageDown: viewPx - ROW_PX, PageUp: ROW_PX - viewPx, Home: -Infinity, End: Infinity };
    if (!(event.key in by)) return;
    event.preventDefault();
    move(offset.current + by[event.key]);
  }
  useLayoutEffect(() => {
    again();
    const grown = new ResizeObserver(again);
    if (box.current) grown.observe(box.current);
    box.current?.addEventListener("wheel", wheel, { passive: false });
    const on = box.current;
    return () => { grown.disconnect(); on?.removeEventListener("wheel", wheel); };
  }, [scale]);
  useEffect(() => { if (line.value) show(line.value); }, [line.value]);
  useEffect(() => { if (follow && current) show(current); }, [follow, current]);
  useEffect(() => {
    const timer = setTimeout(() => lines.want(first + 1, last + 1), lines.pages.size ? SETTLE_MS : 0);
    return () => clearTimeout(timer);
  }, [first, last]);

  const marks = marksOf(findings);
  const rows = [];
  for (let row = first; row <= last; row++) rows.push(row + 1);
  return html`<section class="panel source" aria-label=${t("source.title")}>
    <header><h2>${t("source.title")}</h2>
      ${current > 0 && html`<label class="inline"><input type="checkbox" checked=${follow} onChange=${() => setFollow(!follow)} /> ${t("source.follow")}</label>`}
      <label class="inline">${t("source.go")} <input type="number" min="1" max=${program.lines} data-name="go-line"
        onChange=${(/** @type {any} */ event) => { line.value = 0; line.value = event.target.valueAsNumber || 0; }} /></label></header>
    <div ref=${box} class="lines" tabindex="0" role="region" aria-label=${t("source.title")} onScroll=${scrolled} onKeyDown=${key} data-name="lines">
      <div class="page" style=${{ height: `${pagePx}px` }}>
        <ol style=${{ transform: `translateY(${first * ROW_PX - offset.current + offset.current / scale}px)` }}>
          ${rows.map((one) => html`<li key=${one} data-line=${one}
            class=${`${marks.get(one) ?? ""} ${one === line.value ? "shown" : ""} ${current && one <= current ? "done" : ""} ${one === current ? "current" : ""}`}>
            <i>${one}</i><code>${lines.text(one) ?? "…"}</code></li>`)}
        </ol>
      </div>
    </div>
  </section>`;
}

/** The worst thing that was found in each line. @param {any} findings @returns {Map<number, string>} */
function marksOf(findings) {
  const marks = new Map();
  for (const kind of ["infos", "warnings", "errors"]) for (const one of findings?.[kind] ?? []) marks.set(one.line, `m-${kind}`);
  return marks;
}
