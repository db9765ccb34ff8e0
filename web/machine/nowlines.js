// The lines that are at work: the last one that is certainly done, those on their way, and what comes next.
// Not the whole source (programs/source.js). The rule: a line that was sent is not a line that is done.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { to } from "../lib/router.js";
import { Lines } from "../programs/lines.js";
import { MOVING } from "../state/reduce.js";
import { job, live } from "../state/store.js";

const SHOWN = 8;

export function NowLines() {
  const now = job.value;
  return now && MOVING.has(now.status) ? html`<${Excerpt} key=${now.program} job=${now} />` : null;
}

/** @param {{job: import("../types.js").Job}} props */
function Excerpt({ job: { program, end_line: end, start_line: start, progress } }) {
  const [, arrived] = useState(0);
  const [lines] = useState(() => new Lines(program, progress.lines, () => arrived((n) => n + 1)));
  const { line: done, sent_line: sent } = progress;
  const first = Math.max(start, Math.min(done, end - SHOWN + 1)), last = Math.min(end, first + SHOWN - 1);
  useEffect(() => { if (live.value) lines.want(first, last); }, [first, last, live.value]);
  const stage = (/** @type {number} */ line) => (line <= done ? "done" : line <= sent ? "sent" : "untold");
  const rows = Array.from({ length: Math.max(0, last - first + 1) }, (_, index) => first + index);
  return html`<section class="panel now-lines" aria-label=${t("now.title")} data-name="now-lines">
    <header><h2>${t("now.title")}</h2><a href=${to("programs", program, { line: String(Math.max(1, done)) })}>${t("now.all")}</a></header>
    <ol>${rows.map((line) => html`<li key=${line} class=${stage(line)} data-line=${line}><i>${line}</i>
      <code>${lines.text(line) ?? "…"}</code><small>${t(`now.${stage(line)}`)}</small></li>`)}</ol>
  </section>`;
}
