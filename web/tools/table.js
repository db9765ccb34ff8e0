// The tool table, as the text that LinuxCNC keeps. Shown, changed, saved as a whole.
// The rule: what was not understood comes back as a warning with its line, and stays to be put right.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { get, request } from "../net/http.js";
import { against, chosen, live } from "../state/store.js";
import { Button } from "../parts/button.js";

/** @param {{tool: number | null}} props in the spindle: the table of a changer that swaps pockets changes with it */
export function ToolTable({ tool }) {
  const path = `/machines/${encodeURIComponent(chosen.value ?? "")}/tools`;
  const [table, setTable] = useState(/** @type {any} */ (null));
  const [text, setText] = useState(/** @type {string | null} */ (null));
  useEffect(() => { if (live.value) get(path).then(setTable, () => {}); }, [path, tool, live.value]);
  const changed = text !== null && text !== (table?.text ?? "");
  const save = async () => {
    const sent = text ?? "";
    const answer = await request("PUT", path, sent.trim() === "" ? {} : { text: sent });
    setTable(answer);
    setText(answer.warnings.length ? sent : null);
  };
  return html`<section class="panel" aria-label=${t("tools.table")} data-name="tool-table"><h2>${t("tools.table")}</h2>
    <p class="hint">${t("tools.table_text")}</p>
    <textarea rows="8" maxlength="1000000" spellcheck="false" aria-label=${t("tools.table")} data-name="table-text" disabled=${against("operate") !== null}
      value=${text ?? table?.text ?? ""} onInput=${(/** @type {any} */ event) => setText(event.target.value)}></textarea>
    ${table?.warnings.map((/** @type {{line: number, message: string}} */ one) => html`<p class="problem">${t("check.line", { line: one.line })}: ${one.message}</p>`)}
    <div class="row"><${Button} name="save-table" kind="primary" icon="save" label=${t("tools.save")}
      reason=${against("operate") ?? (changed ? null : "reason.nothing_changed")} onPress=${save} />
      ${changed && html`<button type="button" class="button" onClick=${() => setText(null)}>${t("settings.undo")}</button>`}</div>
  </section>`;
}
