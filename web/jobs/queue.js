// The jobs that wait for the machine, in their order. The rule: the order is the daemon's; moving one asks for a place.

import { html } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { to } from "../lib/router.js";
import { onJob } from "../state/actions.js";
import { against, jobs, queue } from "../state/store.js";
import { Button } from "../parts/button.js";
import { heldBecause } from "./held.js";

export function QueuePanel() {
  const waiting = queue.value;
  const reason = against("operate");
  return html`<section class="panel queue" aria-label=${t("queue.title")} data-name="queue">
    <h2>${t("queue.title")} <small>${waiting.length || ""}</small></h2>
    ${waiting.length === 0 && html`<p class="empty">${t("queue.empty")} <a href=${to("programs")}>${t("queue.choose")}</a></p>`}
    <ol>${waiting.map((one, index) => html`<li key=${one.id} data-job=${one.id}>
      <a class="name" href=${to("jobs", one.id)}>${one.program_name}</a>
      <small class="note">${[t("job.title", { id: one.id }), jobs.value[one.id]?.note, heldBecause(one)].filter(Boolean).join(" · ")}</small>
      <span class="tag">${t(one.hold ? "queue.held" : "queue.ready")}</span>
      <div class="row">
        <${Button} icon="up" label=${t("queue.up")} kind="icon-only"
          reason=${reason ?? (index === 0 ? "reason.first" : null)} quiet
          onPress=${() => onJob(one.id, "move", { position: index })} />
        <${Button} icon="down" label=${t("queue.down")} kind="icon-only"
          reason=${reason ?? (index === waiting.length - 1 ? "reason.last" : null)} quiet
          onPress=${() => onJob(one.id, "move", { position: index + 2 })} />
        ${one.hold
          ? html`<${Button} name="release" icon="play" label=${t("queue.release")} reason=${reason} quiet
            onPress=${() => onJob(one.id, "resume")} />`
          : html`<${Button} name="hold" icon="pause" label=${t("queue.hold")} reason=${reason} quiet
            onPress=${() => onJob(one.id, "pause")} />`}
        <${Button} name="remove" icon="close" label=${t("queue.remove")} kind="icon-only" reason=${reason} quiet
          onPress=${() => onJob(one.id, "cancel")} />
      </div>
    </li>`)}</ol>
  </section>`;
}
