// Who moves the machine by hand, and taking it over from there: a strip on the machine's page, and a question where
// something was refused because of it. Not who may do what (roles). The rule: it is taken only by a press that says so,
// and whoever had it sees who has it now.

import { html } from "../lib/ui.js";
import { t, time } from "../lib/i18n.js";
import { CLIENT } from "../net/client.js";
import { post, request } from "../net/http.js";
import { refusedBy } from "../state/actions.js";
import { against, chosen, machine } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { Icon } from "../parts/icon.js";

const here = () => `/machines/${encodeURIComponent(chosen.value ?? "")}/control`;
const take = () => post(here(), { takeover: true });
/** @param {import("../types.js").Holder} holder */
const who = ({ name, client, since }) => t("control.other", { name, client, time: time(since) });

export function ControlStrip() {
  const holder = machine.value?.state.control;
  if (!holder) return null;
  const mine = holder.client === CLIENT;
  return html`<section class=${`panel control ${mine ? "mine" : ""}`} aria-label=${t("control.title")} data-name="control">
    <${Icon} name="jog" /><p role="status">${mine ? t("control.mine") : who(holder)}</p>
    ${mine
      ? html`<${Button} name="control-release" label=${t("control.release")} reason=${against("operate")} onPress=${() => request("DELETE", here())} />`
      : html`<${Button} name="control-take" kind="primary" label=${t("control.take")} reason=${against("operate")} onPress=${take} />`}
  </section>`;
}

export function AskTakeover() {
  const holder = refusedBy.value;
  if (!holder) return null;
  const close = () => { refusedBy.value = null; };
  return html`<${Dialog} name="ask-takeover" kind="warn" icon="jog" title=${t("control.title")} onClose=${close}>
    <p class="call-text">${who(holder)}</p>
    <p>${t("control.text")}</p>
    <div class="row end"><button type="button" class="button" onClick=${close}>${t("dialog.cancel")}</button>
      <${Button} name="takeover-yes" kind="primary" label=${t("control.take")} reason=${against("operate")}
        onPress=${async () => { close(); await take(); }} /></div>
  <//>`;
}
