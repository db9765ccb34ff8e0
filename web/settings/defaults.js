// The way back to what the firmware was delivered with.
// The rule: it needs the machine's name typed, letter by letter; the daemon keeps a backup first.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { post } from "../net/http.js";
import { against, chosen } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { notify } from "../parts/notices.js";
import { here } from "./read.js";

const WHAT = ["settings", "offsets", "all"];
const WITHIN_MS = 60_000;

export function Defaults() {
  const [asking, setAsking] = useState(/** @type {string | null} */ (null));
  const [typed, setTyped] = useState("");
  const reason = against("change_settings"), name = chosen.value ?? "";
  const close = () => { setAsking(null); setTyped(""); };
  const restore = async () => {
    const { backup } = await post(here("restore"), { what: asking, confirm: typed }, { withinMs: WITHIN_MS });
    close();
    notify(t("defaults.done", { backup }), "done");
  };
  return html`<section class="panel" aria-label=${t("defaults.title")} data-name="defaults">
    <h2>${t("defaults.title")}</h2>
    <p class="hint">${t("defaults.text")}</p>
    <div class="row">${WHAT.map((what) => html`<${Button} key=${what} name=${`defaults-${what}`} kind="end" label=${t(`defaults.${what}`)} reason=${reason} quiet
      onPress=${() => setAsking(what)} />`)}</div>
    ${reason && html`<p class="why-line">${t(reason)}</p>`}
    ${asking !== null && html`<${Dialog} name="defaults-ask" kind="c-alarm" icon="alarm" title=${t("defaults.ask", { what: t(`defaults.${asking}`) })} onClose=${close}>
      <p>${t("defaults.type", { name })}</p>
      <label class="info-text">${t("defaults.name")}<input type="text" maxlength="64" autocomplete="off" data-name="defaults-name" value=${typed}
        onInput=${(/** @type {any} */ event) => setTyped(event.target.value)} /></label>
      <div class="row end"><button type="button" class="button" onClick=${close}>${t("dialog.cancel")}</button>
        <${Button} name="defaults-yes" kind="end" label=${t("defaults.yes")} reason=${reason ?? (typed === name ? null : "reason.not_typed")} onPress=${restore} /></div>
    <//>`}
  </section>`;
}
