// What the check of a program says: verdict, figures, findings. A touch on a finding shows its line.
// The rule: one thing found is one line, with how often; the daemon's own words.

import { html } from "../lib/ui.js";
import { number, t } from "../lib/i18n.js";
import { clock } from "../lib/format.js";
import { machine } from "../state/store.js";
import { beyond, reachIn } from "../preview/place.js";
import { Icon } from "../parts/icon.js";

const NO_OFFSET = [0, 0, 0];
const KINDS = /** @type {const} */ (["errors", "warnings", "infos"]);

/** @param {{report: any, onLine: (line: number) => void}} props */
export function Report({ report, onLine }) {
  if (report === null) return html`<p class="empty" data-name="checking">${t("check.running")}</p>`;
  const verdict = report.errors.length ? "errors" : report.warnings.length ? "warnings" : "good";
  return html`<div class="report" data-name="report" data-verdict=${verdict}>
    <p class=${`verdict v-${verdict}`}><${Icon} name=${verdict === "good" ? "idle" : "alarm"} />
      <b>${t(`check.${verdict}`, { errors: report.errors.length, warnings: report.warnings.length })}</b></p>
    <${Reach} bounds=${report.bounds} />
    <dl class="facts">
      <div><dt>${t("check.time")}</dt><dd>${clock(report.seconds)}</dd></div>
      <div><dt>${t("check.cut")}</dt><dd>${number(report.cut_mm)} ${t("unit.mm")}</dd></div>
      <div><dt>${t("check.rapid")}</dt><dd>${number(report.rapid_mm)} ${t("unit.mm")}</dd></div>
      <div><dt>${t("check.tools")}</dt><dd>${report.tools.length ? report.tools.map((/** @type {number} */ tool) => `T${tool}`).join(" ") : "–"}</dd></div>
      <div><dt>${t("check.feeds")}</dt><dd>${range(report.feeds)}</dd></div>
      ${Object.entries(report.bounds).map(([axis, span]) => html`<div key=${axis}><dt>${axis.toUpperCase()}</dt>
        <dd>${/** @type {number[]} */ (span).map((value) => value.toFixed(2)).join(" … ")}</dd></div>`)}
    </dl>
    ${KINDS.map((kind) => report[kind].length > 0 && html`<${Findings}
      key=${kind} kind=${kind} list=${report[kind]} onLine=${onLine} />`)}
  </div>`;
}

/** Whether it fits where the zero lies now; nothing where the machine has not said both of its coordinates. @param {{bounds: Record<string, number[]>}} props */
export function Reach({ bounds }) {
  const now = machine.value;
  if (!now || now.link !== "connected") return null;
  const spans = ["x", "y", "z"].map((axis) => bounds[axis] ?? null);
  const reach = reachIn(now.travel ?? {}, now.state.position, NO_OFFSET, spans), over = reach && beyond(spans, reach);
  if (!over) return null;
  return over.length ? html`<p class="problem" data-name="beyond">${t("preview.beyond", { axes: over.join(", ").toUpperCase() })}</p>`
    : html`<p class="hint" data-name="within">${t("preview.within")}</p>`;
}

/** @param {number[]} values */
function range(values) {
  if (values.length === 0) return "–";
  const least = Math.min(...values), most = Math.max(...values);
  return `${least === most ? number(least) : `${number(least)} – ${number(most)}`} ${t("unit.mm_min")}`;
}

/** @param {{list: import("../types.js").Finding[], kind: string, onLine?: (line: number) => void}} props */
export function Findings({ list, kind, onLine }) {
  return html`<ul class=${`findings f-${kind}`}>${list.map((one, index) => html`<li key=${index}>
    <button type="button" data-line=${one.line} disabled=${!onLine} onClick=${() => onLine?.(one.line)}>
      <b>${t("check.line", { line: number(one.line) })}</b><span>${one.message}</span>${one.count > 1 && html`<small>× ${number(one.count)}</small>`}</button></li>`)}</ul>`;
}
