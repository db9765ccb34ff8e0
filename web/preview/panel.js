// The preview as a panel: closed it is a button and costs nothing, open it is view.js.
// The rule: the drawing is loaded when somebody opens it; a browser remembers whether it was open.

import { html } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { previewOpen } from "../lib/prefs.js";
import { chosen, job } from "../state/store.js";
import { Icon } from "../parts/icon.js";
import { View } from "./view.js";

/** @param {{program: string, title?: string}} props */
export function PreviewPanel({ program, title }) {
  const open = previewOpen.value;
  return html`<section class="panel preview" aria-label=${t("preview.title")} data-name="preview">
    <header><h2>${t("preview.title")} <small>${title}</small></h2>
      <button type="button" class="button" aria-expanded=${open} data-name="preview-toggle" onClick=${() => { previewOpen.value = !open; }}>
        <${Icon} name="cube" /><span class="label">${t(open ? "preview.close" : "preview.open")}</span></button></header>
    ${open && html`<${View} key=${`${program} ${chosen.value}`} program=${program} name=${chosen.value} />`}
  </section>`;
}

/** On the machine's page: the path of the job that has the machine. */
export function JobPreview() {
  const now = job.value;
  return now && html`<${PreviewPanel} program=${now.program} title=${now.program_name} />`;
}
