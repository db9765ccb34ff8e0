// The line for blocks by hand: sends one, remembers the last ones (arrow up), completes codes (tabulator).
// The rule: what was typed is sent as it was typed; a completion is taken by a key or a touch, never by itself.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { get } from "../net/http.js";
import { against, chosen, live } from "../state/store.js";
import { attempt, run } from "../state/actions.js";
import { completed, completions } from "./codes.js";

const REMEMBERED = 50;
/** @type {string[]} */
const said = [];

/** What the chosen machine's profile knows. @returns {import("./codes.js").Code[]} */
function useCodes() {
  const [codes, setCodes] = useState(/** @type {import("./codes.js").Code[]} */ ([]));
  const name = chosen.value;
  useEffect(() => {
    let wanted = true;
    if (name !== null && live.value) {
      get(`/machines/${encodeURIComponent(name)}/codes`).then((found) => { if (wanted) setCodes(found); }, () => {});
    }
    return () => { wanted = false; };
  }, [name, live.value]);
  return codes;
}

export function CommandLine() {
  const codes = useCodes();
  const [text, setText] = useState("");
  const [back, setBack] = useState(0);
  const [answer, setAnswer] = useState("");
  const [open, setOpen] = useState(false);
  const reason = against("by_hand");
  const found = open && !reason ? completions(codes, text) : [];
  const type = (/** @type {string} */ next, /** @type {boolean} */ typed) => { setText(next); setOpen(typed); };
  async function submit(/** @type {Event} */ event) {
    event.preventDefault();
    const block = text.trim();
    if (!block || reason) return;
    if (said[said.length - 1] !== block) said.push(block);
    if (said.length > REMEMBERED) said.shift();
    type("", false);
    setBack(0);
    setAnswer(t("console.sent", { block }));
    const done = await attempt(() => run([block]));
    setAnswer(done ? t("console.done", { block }) : t("console.refused", { block }));
  }
  function key(/** @type {KeyboardEvent} */ event) {
    if (found.length && event.key === "Tab" && !event.shiftKey) type(completed(text, found[0]), false);
    else if (found.length && event.key === "Escape") setOpen(false);
    else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
      const next = Math.min(said.length, Math.max(0, back + (event.key === "ArrowUp" ? 1 : -1)));
      setBack(next);
      type(next ? said[said.length - next] : "", false);
    } else return;
    event.preventDefault();
  }
  return html`<form class="command" onSubmit=${submit}>
    <ul class="completions" id="completions" role="listbox" aria-label=${t("console.codes")} hidden=${found.length === 0}>
      ${found.map((one, index) => html`<li key=${one.code} role="option" aria-selected=${index === 0} data-code=${one.code}
        onMouseDown=${(/** @type {Event} */ event) => { event.preventDefault(); type(completed(text, one), false); }}><b>${one.code}</b>
        <small>${one.text}</small></li>`)}</ul>
    <input type="text" name="block" autocomplete="off" autocapitalize="characters" spellcheck=${false} maxlength="1024"
      value=${text} role="combobox" aria-autocomplete="list" aria-controls="completions" aria-expanded=${found.length > 0}
      placeholder=${reason ? t(reason) : t("console.command")} aria-label=${t("console.command")} readonly=${Boolean(reason)}
      onInput=${(/** @type {any} */ event) => type(event.target.value, true)} onKeyDown=${key} onBlur=${() => setOpen(false)} />
    <button type="submit" class="button primary" aria-disabled=${Boolean(reason)}>${t("console.send")}</button>
    <output data-name="answer">${answer}</output>
  </form>`;
}
