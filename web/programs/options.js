// How a program is to be run, for those who want it otherwise than whole and at once. Not the buttons (program.js).
// The rule: what the controller of this machine does not know is there all the same, disabled, with the reason.

import { html } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { can, machine } from "../state/store.js";

/** @typedef {{hold: boolean, start_line?: number, end_line?: number, note?: string, mode?: string, on_error?: string}} Wish */

const MODES = ["run", "check"];
const ON_ERROR = ["", "hold", "stop", "ignore"];
/** Behind NC frames a program is worked out as a whole. */
const WHOLE_ONLY = new Set(["ncframe"]);

/** @param {{lines: number, wish: Wish, onWish: (wish: Wish) => void}} props */
export function Options({ lines, wish, onWish }) {
  const set = (/** @type {string} */ name, /** @type {unknown} */ value) => onWish({ ...wish, [name]: value || undefined });
  const whole = WHOLE_ONLY.has(machine.value?.protocol ?? "") ? "reason.whole_only" : null;
  const line = (/** @type {"start_line" | "end_line"} */ name, /** @type {string | null} */ reason) => html`<label class="inline">${t(`program.${name}`)}
    <input type="number" min="1" max=${lines} data-name=${name} disabled=${reason !== null} value=${wish[name] ?? ""}
      onInput=${(/** @type {any} */ event) => set(name, event.target.valueAsNumber)} />${why(reason)}</label>`;
  return html`<details class="part"><summary data-name="options">${t("program.part")}</summary><div class="row">
    ${line("start_line", whole)}${line("end_line", null)}
    <${Choice} name="mode" of=${MODES} value=${wish.mode ?? "run"} onValue=${(/** @type {string} */ one) => set("mode", one === "run" ? "" : one)} />
    <${Choice} name="on_error" of=${ON_ERROR} value=${wish.on_error ?? ""} onValue=${(/** @type {string} */ one) => set("on_error", one)} />
    <label class="inline"><input type="checkbox" checked=${wish.hold} data-name="hold"
      onChange=${() => onWish({ ...wish, hold: !wish.hold })} /> ${t("program.hold")}</label>
    <label class="inline">${t("job.note")} <input type="text" maxlength="2000" data-name="note" value=${wish.note ?? ""}
      onInput=${(/** @type {any} */ event) => set("note", event.target.value)} /></label>
  </div></details>`;
}

/** Both are about lines that the controller itself refuses. @param {{name: string, of: string[], value: string, onValue: (one: string) => void}} props */
function Choice({ name, of, value, onValue }) {
  const reason = can("check_mode") ? null : "reason.not_there";
  return html`<label class="inline">${t(`program.${name}`)} <select data-name=${name} disabled=${reason !== null} value=${value}
    onChange=${(/** @type {any} */ event) => onValue(event.target.value)}>
    ${of.map((one) => html`<option key=${one} value=${one}>${t(`program.${name}.${one || "configured"}`)}</option>`)}</select>${why(reason)}</label>`;
}

/** @param {string | null} reason */
const why = (reason) => reason && html`<small class="why">${t(reason)}</small>`;
