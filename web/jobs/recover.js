// What to do with an interrupted job: the plan in sight first, then the choice.
// The rule: nothing goes on before a person has seen which lines are certain and what would be sent.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { coordinate } from "../lib/format.js";
import { attempt, onJob } from "../state/actions.js";
import { live, operator, role, world } from "../state/store.js";
import { whyNot } from "../state/reasons.js";
import { Button } from "../parts/button.js";

const BLOCKS_SHOWN = 12;
const SETTLE_MS = 400; // a number is typed digit by digit

/** @typedef {{line: number, clearance: number | null, operator_done: boolean, force: boolean}} Wish */

/** @param {{job: import("../types.js").Job}} props */
export function Recover({ job }) {
  const [plan, setPlan] = useState(/** @type {any} */ (null));
  const [wish, setWish] = useState(/** @type {Wish} */ ({ line: 0, clearance: null, operator_done: false, force: false }));
  const machine = world.value.machines[job.machine];
  const stands = machine ? `${machine.link} ${machine.state.status} ${JSON.stringify(machine.state.position.machine)}` : "";
  const may = operator.value;
  const planned = machine?.protocol === "grbl"; // taken up by a plan, which can be asked for by line and clearance
  useEffect(() => {
    if (!live.value || !may) return undefined;
    const asked = planned && plan !== null ? { line: wish.line, ...(wish.clearance !== null && { clearance: wish.clearance }) } : undefined;
    const timer = setTimeout(async () => {
      const found = await attempt(() => onJob(job.id, "recover", asked));
      if (!found?.blocks) return;
      setPlan(found);
      setWish((before) => ({ ...before, line: before.line || found.next_line, clearance: before.clearance ?? found.way?.clearance ?? null }));
    }, plan === null ? 0 : SETTLE_MS);
    return () => clearTimeout(timer);
  }, [job.id, live.value, stands, wish.line, wish.clearance]);
  const now = { machine: machine ?? null, job, queue: [], role: role.value, live: live.value };
  const change = (/** @type {Partial<Wish>} */ part) => setWish((before) => ({ ...before, ...part }));
  return html`<section class="panel recover" aria-label=${t("recover.title")} data-name="recover">
    <h2>${t("recover.title")}</h2>
    ${plan === null ? html`<p class="empty">${t(may ? "loading" : "reason.read_only")}</p>`
      : html`<${Plan} plan=${plan} /><${Choice} job=${job} plan=${plan} wish=${wish} change=${change}
        reason=${whyNot("confirm", now)} />`}
  </section>`;
}

/** @param {{plan: any}} props */
function Plan({ plan }) {
  const { steps = [], blocks = [], warnings = [] } = plan;
  return html`<dl class="facts">
      <div><dt>${t("recover.certain")}</dt><dd>${plan.certain_line}</dd></div>
      <div><dt>${t("recover.doubt")}</dt><dd>${plan.line_from === null ? t("recover.no_doubt") : `${plan.line_from} – ${plan.line_to}`}</dd></div>
      <div><dt>${t("recover.expected")}</dt><dd>${axes(plan.position_expected)}</dd></div>
      <div><dt>${t("recover.position")}</dt><dd>${axes(plan.position)}</dd></div>
    </dl>
    ${plan.why_not && html`<p class="problem">${plan.why_not}</p>`}
    ${warnings.map((/** @type {string} */ one) => html`<p key=${one} class="problem">${one}</p>`)}
    ${steps.length > 0 ? html`<p>${t("recover.blocks")}</p><ol
      class="steps-list">${steps.map((/** @type {any} */ one, /** @type {number} */ index) =>
      html`<li key=${index}><code>${one.text || "–"}</code><span>${one.note || one.purpose}</span></li>`)}</ol>`
      : blocks.length > 0 && html`<p>${t("recover.blocks")}</p><pre
        class="blocks">${blocks.slice(0, BLOCKS_SHOWN).join("\n")}</pre>`}`;
}

/** @param {{job: import("../types.js").Job, plan: any, wish: Wish, change: (part: Partial<Wish>) => void, reason: string | null}} props */
function Choice({ job, plan, wish, change, reason }) {
  const { needs = [] } = plan;
  const { line } = wish;
  const wanted = plan.way || needs.includes("clearance");
  const missing = needs.find((/** @type {"operator_done" | "force" | "clearance"} */ one) => !wish[one] && wish[one] !== 0);
  const inside = line >= job.start_line && line <= job.end_line;
  const refused = !inside ? "reason.no_line" : plan.line_why_not ? "reason.plan_refused" : missing ? `reason.need_${missing}` : null;
  const body = { action: "from_line", line, ...(wanted && wish.clearance !== null && { clearance: wish.clearance }),
    ...(wish.operator_done && { operator_done: true }), ...(wish.force && { force: true }) };
  return html`${plan.line_why_not && html`<p class="problem">${plan.line_why_not}</p>`}
    <div class="row">
      <${Button} name="continue" kind="go" icon="run" label=${t("recover.continue", { line: plan.certain_line + 1 })}
        reason=${reason ?? (plan.can_continue ? null : "reason.not_provable")} onPress=${() => onJob(job.id, "recover", { action: "continue" })} />
    </div>
    <div class="row">
      <label class="inline">${t("recover.from")} <input type="number" min=${job.start_line} max=${job.end_line} value=${line}
        data-name="from-line"
        onInput=${(/** @type {any} */ event) => change({ line: event.target.valueAsNumber || 0 })} /></label>
      ${wanted && html`<label class="inline">${t("recover.clearance")} <input type="number" step="any"
        value=${wish.clearance ?? ""} data-name="clearance"
        onInput=${(/** @type {any} */ event) => change({ clearance: Number.isFinite(event.target.valueAsNumber) ? event.target.valueAsNumber : null })} /></label>`}
      ${/** @type {const} */ (["operator_done", "force"]).map((one) => needs.includes(one) && html`<label class="inline"
        key=${one}>
        <input type="checkbox" checked=${wish[one]} data-name=${one}
          onChange=${() => change({ [one]: !wish[one] })} /> ${t(`recover.${one}`)}</label>`)}
      <${Button} name="from" icon="play" label=${t("recover.from_button", { line })} reason=${reason ?? refused}
        onPress=${() => onJob(job.id, "recover", body)} />
    </div>`;
}

/** @param {Record<string, number> | undefined} position */
function axes(position) {
  const known = Object.entries(position ?? {});
  return known.length ? known.map(([axis, value]) => `${axis.toUpperCase()}\u00a0${coordinate(value)}`).join("  ") : "–";
}
