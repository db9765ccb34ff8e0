// The blocks that a controller executes by itself after every reset.
// The rule: writing one executes it, and the page says so; what moves or starts something is asked for a second time.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { ApiError, request } from "../net/http.js";
import { against } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { here, useRead } from "./read.js";

const WITHIN_MS = 30_000;

export function StartupBlocks() {
  const { value, setValue, reason } = useRead("startup-blocks");
  const [edits, setEdits] = useState(/** @type {Record<number, string>} */ ({}));
  const [refused, setRefused] = useState("");
  const blocks = /** @type {string[]} */ (value?.blocks ?? []).map((block, place) => edits[place] ?? block);
  const changed = blocks.some((block, place) => block !== value.blocks[place]);
  async function write(/** @type {boolean} */ force) {
    setRefused("");
    try {
      setValue(await request("PUT", here("startup-blocks"), { blocks, force }, { withinMs: WITHIN_MS }));
      setEdits({});
    } catch (error) {
      if (!(error instanceof ApiError) || error.code !== "needs_force") throw error;
      setRefused(error.message);
    }
  }
  return html`<section class="panel" aria-label=${t("startup.title")} data-name="startup">
    <h2>${t("startup.title")}</h2>
    <p class="hint">${t("startup.text")}</p>
    ${value === null && html`<p class="empty">${t(reason ?? "loading")}</p>`}
    ${blocks.map((block, place) => html`<label class="info-text" key=${place}>$N${place}
      <input type="text" maxlength="120" value=${block} data-name=${`startup-${place}`} disabled=${against("change_settings") !== null}
        onInput=${(/** @type {any} */ event) => setEdits({ ...edits, [place]: event.target.value })} /></label>`)}
    ${value?.warnings.map((/** @type {string} */ one) => html`<p class="problem">${one}</p>`)}
    ${value !== null && html`<div class="row"><${Button} name="write-startup" kind="primary" icon="save" label=${t("startup.write")}
      reason=${against("change_settings") ?? (changed ? null : "reason.nothing_changed")} onPress=${() => write(false)} /></div>`}
    ${refused && html`<${Dialog} name="startup-force" kind="warn" icon="alarm" title=${t("startup.force_title")} onClose=${() => setRefused("")}>
      <p class="call-text">${refused}</p>
      <div class="row end"><button type="button" class="button" onClick=${() => setRefused("")}>${t("dialog.cancel")}</button>
        <${Button} name="startup-yes" kind="end" label=${t("startup.force")} reason=${against("change_settings")} onPress=${() => write(true)} /></div><//>`}
  </section>`;
}
