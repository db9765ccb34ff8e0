// The settings of a controller: read, change, and the backups that are kept before each change.
// The rule: nothing is written until Save is pressed; then each setting says what became of it, as the controller reads back.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { ApiError, get, request } from "../net/http.js";
import { against, chosen } from "../state/store.js";
import { Button } from "../parts/button.js";
import { notify } from "../parts/notices.js";
import { Backups } from "./backups.js";
import { SettingRow } from "./row.js";

const WITHIN_MS = 60_000; // each is written to an EEPROM and read back

export function SettingsPage() {
  const [settings, setSettings] = useState(/** @type {import("../types.js").Setting[] | null} */ (null));
  const [edits, setEdits] = useState(/** @type {Record<number, string>} */ ({}));
  const [results, setResults] = useState(/** @type {Record<number, string>} */ ({}));
  const [filter, setFilter] = useState("");
  const [saved, setSaved] = useState(0);
  const reason = against("read");
  const path = `/machines/${encodeURIComponent(chosen.value ?? "")}/settings`;
  const read = async () => { setSettings((await get(path, { withinMs: WITHIN_MS })).settings); };
  useEffect(() => { if (!reason && settings === null) read().catch((error) => notify(error.message)); }, [reason, path]);
  const changed = (settings ?? []).filter((one) => one.number in edits && edits[one.number] !== one.value);
  async function save() {
    const values = Object.fromEntries(changed.map((one) => [one.number, edits[one.number]]));
    let answer;
    try {
      answer = await request("PATCH", path, { values }, { withinMs: WITHIN_MS });
      setEdits({});
    } catch (error) {
      if (!(error instanceof ApiError) || !error.body.results) throw error;
      answer = error.body; // some were written: what became of each is in it
      notify(error.message);
    } finally {
      setSaved((n) => n + 1);
    }
    setResults(Object.fromEntries(answer.results.map((/** @type {any} */ one) => [one.number, one.status])));
    await read();
  }
  const needle = filter.toLowerCase();
  const shown = (settings ?? []).filter((one) => !needle || `$${one.number} ${one.name ?? ""} ${one.meaning ?? ""}`.toLowerCase().includes(needle));
  return html`<div class="grid settings-grid">
    <section class="panel settings" aria-label=${t("settings.title")} data-name="settings">
      <header><h2>${t("settings.title")}</h2>
        <input type="search" placeholder=${t("console.filter")} aria-label=${t("console.filter")} value=${filter}
          data-name="settings-filter"
          onInput=${(/** @type {any} */ event) => setFilter(event.target.value)} />
        <div class="row">
          <${Button} name="read-settings" icon="reset" label=${t("settings.read")} reason=${reason} onPress=${read} />
          ${changed.length > 0 && html`<button type="button" class="button" data-name="undo"
            onClick=${() => setEdits({})}>${t("settings.undo")}</button>`}
          <${Button} name="save-settings" kind="primary" icon="save" label=${t("settings.save", { count: changed.length })}
            reason=${against("change_settings") ?? (changed.length ? null : "reason.nothing_changed")} onPress=${save} />
        </div></header>
      ${settings === null && html`<p class="empty">${t(reason ?? "loading")}</p>`}
      <ul class="setting-list">${shown.map((one) => html`<${SettingRow}
        key=${one.number} setting=${one} edited=${edits[one.number]}
        result=${results[one.number]} off=${against("change_settings") !== null}
        onEdit=${(/** @type {string} */ value) => setEdits((before) => ({ ...before, [one.number]: value }))} />`)}</ul>
    </section>
    <${Backups} path=${path} saved=${saved} onRestored=${read} />
  </div>`;
}
