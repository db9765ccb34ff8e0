// The source of a program, however long: only the lines in sight are fetched and drawn.
// The rule: a line is shown as it stands in the file, as text; a million of them open as fast as ten.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { Lines } from "./lines.js";
import { useWindow } from "./window.js";

const SHORTEST_PX = 96; // a program of two lines needs no half of a screen
const SETTLE_MS = 70; // while the bar is dragged, nothing is fetched

/**
 * @param {{program: import("../types.js").Program, findings: any, line: import("../vendor/signals.js").Signal<number>, job: import("../types.js").Job | null}} props
 * `line`: the one to show, set by a touch on a finding; `job`: the one that has the machine, if it is of this program
 */
export function Source({ program, findings, line, job }) {
  const current = job?.progress.line ?? 0;
  const [, arrived] = useState(0);
  const [lines] = useState(() => new Lines(program.id, program.lines, () => arrived((n) => n + 1)));
  const [follow, setFollow] = useState(false);
  const { box, first, last, pagePx, shiftPx, show, onScroll, onKeyDown } = useWindow(program.lines);
  useEffect(() => { if (line.value) show(line.value - 1); }, [line.value]);
  useEffect(() => { if (follow && current) show(current - 1); }, [follow, current]);
  useEffect(() => {
    const timer = setTimeout(() => lines.want(first + 1, last + 1), lines.pages.size ? SETTLE_MS : 0);
    return () => clearTimeout(timer);
  }, [first, last]);
  const marks = marksOf(findings);
  const rows = Array.from({ length: Math.max(0, last - first + 1) }, (_, index) => first + index + 1);
  const look = (/** @type {number} */ one) =>
    `${marks.get(one) ?? ""} ${one === line.value ? "shown" : ""} ${current && one <= current ? "done" : ""} ${job && one > current && one <= job.progress.sent_line ? "sent" : ""} ${one === current ? "current" : ""}`;
  const word = (/** @type {number} */ one) => job && one >= job.start_line && one <= job.end_line
    && html`<small>${t(one <= current ? "now.done" : one <= job.progress.sent_line ? "now.sent" : "now.untold")}</small>`;
  return html`<section class="panel source" aria-label=${t("source.title")}>
    <header><h2>${t("source.title")}</h2>
      ${current > 0 && html`<label class="inline"><input type="checkbox" checked=${follow}
        onChange=${() => setFollow(!follow)} /> ${t("source.follow")}</label>`}
      <label class="inline">${t("source.go")} <input type="number" min="1" max=${program.lines} data-name="go-line"
        onChange=${(/** @type {any} */ event) => { line.value = 0; line.value = event.target.valueAsNumber || 0; }} /></label></header>
    <div ref=${box} class="lines" style=${{ maxHeight: `${Math.max(SHORTEST_PX, pagePx + 2)}px` }} tabindex="0" role="region" aria-label=${t("source.title")} onScroll=${onScroll}
      onKeyDown=${onKeyDown} data-name="lines">
      <div class="page" style=${{ height: `${pagePx}px` }}>
        <ol style=${{ transform: `translateY(${shiftPx}px)` }}>
          ${rows.map((one) => html`<li key=${one} data-line=${one}
            class=${look(one)}><i>${one}</i><code>${lines.text(one) ?? "…"}</code>${word(one)}</li>`)}
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
