// The machine's page: position, movement by hand, figures, link, queue, messages. Each panel is a file of its own.
// The rule: what the controller cannot do (its capabilities) is not there; what it cannot do now says why.

import { html, useEffect } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { can, chosen, job, watchLink } from "../state/store.js";
import { JobPreview } from "../preview/panel.js";
import { QueuePanel } from "../jobs/queue.js";
import { ControlStrip } from "./control.js";
import { Figures } from "./figures.js";
import { JogPanel } from "./jog.js";
import { LinkPanel } from "./link.js";
import { LogPanel } from "./log.js";
import { Modes } from "./modes.js";
import { NowLines } from "./nowlines.js";
import { Overrides } from "./overrides.js";
import { Position } from "./position.js";
import { Service } from "./service.js";

export function MachinePage() {
  const name = chosen.value;
  useEffect(() => (name === null ? undefined : watchLink(name)), [name]);
  if (name === null) return html`<p class="empty">${t("machine.waiting")}</p>`;
  return html`<${ControlStrip} /><div class="grid machine-grid">
    <${Position} />
    ${job.value && html`<div class="column job-panels"><${NowLines} /><${JobPreview} /></div>`}
    ${can("jog") && html`<${JogPanel} key=${name} />`}
    <div class="column side">
      <${Figures} />
      ${can("overrides") && html`<${Overrides} key=${name} />`}
      ${(can("coolant") || can("check_mode") || can("door")) && html`<${Modes} />`}
      <${Service} />
      <${LinkPanel} />
    </div>
    <${QueuePanel} />
    <${LogPanel} />
  </div>`;
}
