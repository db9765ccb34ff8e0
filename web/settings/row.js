// One setting: its number, what it means, and a field that fits its kind.
// The rule: the value is the controller's own text until somebody changes it; what a bit means stands beside the bit.

import { html } from "../lib/ui.js";
import { t } from "../lib/i18n.js";

/**
 * @param {{
 *   setting: import("../types.js").Setting, edited: string | undefined, result: string | undefined, off: boolean,
 *   onEdit: (value: string) => void,
 * }} props
 */
export function SettingRow({ setting, edited, result, off, onEdit }) {
  const value = edited ?? setting.value;
  const changed = edited !== undefined && edited !== setting.value;
  const range = [setting.min, setting.max].some((one) => one !== null) ? `${setting.min ?? "…"} – ${setting.max ?? "…"}` : "";
  return html`<li class=${changed ? "changed" : ""} data-setting=${setting.number}>
    <b>$${setting.number}</b>
    <label for=${`setting-${setting.number}`}><span>${setting.name ?? t("settings.unknown")}</span>
      <small>${[setting.meaning, range].filter(Boolean).join(" · ")}</small></label>
    <div class="setting-field"><${Field} setting=${setting} value=${value} off=${off} onEdit=${onEdit} />
      <span class="unit">${setting.unit}</span></div>
    ${result && html`<span class=${`tag r-${result}`}>${t(`settings.result.${result}`)}</span>`}
  </li>`;
}

/** @param {{setting: import("../types.js").Setting, value: string, off: boolean, onEdit: (value: string) => void}} props */
function Field({ setting, value, off, onEdit }) {
  const id = `setting-${setting.number}`;
  if (setting.kind === "bool") {
    return html`<select id=${id} disabled=${off} value=${value}
      onChange=${(/** @type {any} */ event) => onEdit(event.target.value)}>
      <option value="0">${t("figures.off")}</option><option value="1">${t("figures.on")}</option></select>`;
  }
  if (setting.kind === "mask" && setting.bits.length) {
    const number = Number(value) || 0;
    return html`<span class="bits" id=${id}>${setting.bits.map(({ bit, name }) => html`<label key=${bit} class="inline">
      <input type="checkbox" disabled=${off} checked=${Boolean(number & (1 << bit))} data-bit=${bit}
        onChange=${() => onEdit(String(number ^ (1 << bit)))} /> ${name}</label>`)}</span>`;
  }
  return html`<input id=${id} type="text" inputmode=${setting.kind === "text" ? "text" : "decimal"} maxlength="80" disabled=${off}
    value=${value}
    onInput=${(/** @type {any} */ event) => onEdit(event.target.value.trim())} />`;
}
