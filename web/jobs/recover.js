// What to do with an interrupted job: the plan in sight first, then the choice.
// The rule: nothing goes on before a person has seen which lines are certain and what would be sent.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { coordinate } from "../lib/format.js";
import { attempt, onJob } from "../state/actions.js";
import { live, role, world } from "../state/store.js";
import { whyNot } from "../state/reasons.js";
import { Button } from "../parts/button.js";

const BLOCKS_SHOWN = 12;

/** @param {{job: import("../types.js").Job}} props */
export function Recover({ job }) {
  const [plan, setPlan] = useState(/** @type {any} */ (null));
  const [line, setLine] = useState(0);
  const machine = world.value.machines[job.machine];
  const stands = machine ? `${machine.link} ${machine.state.status} ${JSON.stringify(machine.state.position.machine)}` : "";
  const operator = role.value !== "viewer";
  useEffect(() => {
    if (!live.value || !operator) return;
    attempt(() => onJob(job.id, "recover")).then((found) => {
      if (!found) return;
      setPlan(found);
      setLine((before) => before || found.next_line);
    });
  }, [job.id, live.value, stands]);
  const now = { machine: machine ?? null, job, queue: [], role: role.value, live: live.value };
  const reason = whyNot("confirm", now);
  return html`<section class="panel recover" aria-label=${t("recover.title")} data-name="recover">
    <h2>${t("recover.title")}</h2>
    ${plan === null ? html`<p class="empty">${t(operator ? "loading" : "reason.read_only")}</p>` : html`
      <dl class="facts">
        <div><dt>${t("recover.certain")}</dt><dd>${plan.certain_line}</dd></div>
        <div><dt>${t("recover.doubt")}</dt><dd>${plan.line_from === null || plan.line_from === undefined ? t("recover.no_doubt") : `${plan.line_from} – ${plan.line_to}`}</dd></div>
        <div><dt>${t("recover.expected")}</dt><dd>${axes(plan.position_expected)}</dd></div>
        <div><dt>${t("recover.position")}</dt><dd>${axes(plan.position)}</dd></div>
      </dl>
      ${plan.why_not && html`<p class="problem">${plan.why_not}</p>`}
      ${plan.blocks?.length > 0 && html`<p>${t("recover.blocks")}</p><pre class="blocks">${plan.blocks.slice(0, BLOCKS_SHOWN).join("\n")}</pre>`}
      <div class="row">
        <${Button} name="continue" kind="go" icon="run" label=${t("recover.continue", { line: plan.next_line })}
          reason=${reason ?? (plan.can_continue ? null : "reason.not_provable")} onPress=${() => onJob(job.id, "recover", { action: "continue" })} />
        <label class="inline">${t("recover.from")}
          <input type="number" min=${job.start_line} max=${job.end_line} value=${line} data-name="from-line"
            onInput=${(/** @type {any} */ event) => setLine(event.target.valueAsNumber || 0)} /></label>
        <${Button} name="from" icon="play" label=${t("recover.from_button", { line })} reason=${reason ?? (line >= job.start_line && line <= job.end_line ? null : "reason.no_line")}
          onPress=${() => onJob(job.id, "recover", { action: "from_line", line })} />
      </div>`}
  </section>`;
}

/** @param {Record<string, number> | undefined} position */
function axes(position) {
  const known = Object.entries(position ?? {});
  return known.length ? known.map(([axis, value]) => `${axis.toUpperCase()} ${coordinate(value)}`).join("  ") : "–";
}
