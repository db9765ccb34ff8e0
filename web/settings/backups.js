// The backups of the settings: what was, what is different now, and the way back.
// The rule: restoring asks first, and the daemon keeps a backup of what is there before it.

import { html, useEffect, useState } from "../lib/ui.js";
import { dateTime, t } from "../lib/i18n.js";
import { get, post } from "../net/http.js";
import { against, live } from "../state/store.js";
import { attempt } from "../state/actions.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";

const WITHIN_MS = 60_000;

/** @param {{path: string, saved: number, onRestored: () => Promise<void>}} props */
export function Backups({ path, saved, onRestored }) {
  const [backups, setBackups] = useState(/** @type {any[]} */ ([]));
  const [open, setOpen] = useState(/** @type {any} */ (null));
  const [again, setAgain] = useState(0);
  useEffect(() => { if (live.value) get(`${path}/backups`).then(setBackups, () => {}); }, [path, saved, again, live.value]);
  return html`<section class="panel" aria-label=${t("backups.title")} data-name="backups">
    <h2>${t("backups.title")}</h2>
    ${backups.length === 0 && html`<p class="empty">${t("backups.none")}</p>`}
    <ul class="program-list">${backups.map((one) => html`<li key=${one.id}>
      <button type="button" class="button wide-button" onClick=${() => attempt(async () => setOpen(await get(`${path}/backups/${one.id}`, { withinMs: WITHIN_MS })))}>
        <span class="label"><span>${dateTime(one.at)}</span><small
          class="why">${t(`backups.${one.why}`)} · ${one.made_by}</small></span></button></li>`)}</ul>
    ${open && html`<${Dialog} name="backup" wide title=${t("backups.of", { time: dateTime(open.at) })} icon="save" onClose=${() => setOpen(null)}>
      ${open.not_compared && html`<p class="problem">${open.not_compared}</p>`}
      ${open.differences?.length === 0 && html`<p class="empty">${t("backups.same")}</p>`}
      ${open.differences?.length > 0 && html`<table><thead><tr><th></th><th>${t("backups.then")}</th><th>${t("backups.now")}</th></tr></thead>
        <tbody>${open.differences.map((/** @type {any} */ one) => html`<tr
          key=${one.number}><td>$${one.number} ${one.name ?? ""}</td>
          <td class="figure">${one.before ?? "–"}</td><td class="figure">${one.value ?? "–"}</td></tr>`)}</tbody></table>`}
      <div class="row end"><button type="button" class="button" onClick=${() => setOpen(null)}>${t("dialog.cancel")}</button>
        <${Button} name="restore" kind="primary" label=${t("backups.write_back")}
          reason=${against("change_settings") ?? (open.differences?.length ? null : "reason.nothing_changed")} onPress=${async () => {
            await post(`${path}/backups/${open.id}/restore`, undefined, { withinMs: WITHIN_MS });
            setOpen(null);
            setAgain(again + 1);
            await onRestored();
          }} /></div>
    <//>`}
  </section>`;
}
