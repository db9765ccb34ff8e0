// The offsets of a controller: its coordinate systems, its two stored places, G92 and the tool length.
// The rule: each change is asked for once more, with what it does, because a lost offset costs a part.

import { html, useEffect, useState } from "../lib/ui.js";
import { coordinate } from "../lib/format.js";
import { t } from "../lib/i18n.js";
import { get, request } from "../net/http.js";
import { against, live } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { Radios } from "../parts/radios.js";
import { here, useRead } from "./read.js";

const PLACES = new Set(["G28", "G30"]);
const CLEARED = new Set(["G92", "TLO"]);
const MODES = ["here", "absolute"];
const WITHIN_MS = 30_000;

/** @typedef {{machine: string, offsets: Record<string, Record<string, number>>, probe: any}} Offsets */

export function OffsetsSection() {
  const { value, setValue, read, reason } = useRead("offsets");
  const [active, setActive] = useState("");
  const [open, setOpen] = useState(/** @type {string | null} */ (null));
  useEffect(() => {
    if (live.value && value) get(here("modal")).then((modal) => setActive(modal.groups.coordinate_system ?? ""), () => {});
  }, [value, live.value]);
  const change = against("settings");
  const offsets = /** @type {Offsets | null} */ (value)?.offsets ?? {};
  const axes = ["x", "y", "z", "a", "b", "c"].filter((axis) => Object.values(offsets).some((one) => one[axis] !== undefined));
  return html`<section class="panel offsets" aria-label=${t("offsets.title")} data-name="offsets">
    <header><h2>${t("offsets.title")}</h2><${Button} name="read-offsets" icon="reset" label=${t("settings.read")} reason=${reason} onPress=${read} /></header>
    ${value === null && html`<p class="empty">${t(reason ?? "loading")}</p>`}
    ${value !== null && html`<div class="scroll"><table><thead><tr><th></th>${axes.map((axis) => html`<th class="figure">${axis.toUpperCase()}</th>`)}<th></th></tr></thead>
      <tbody>${Object.keys(offsets).map((name) => html`<tr key=${name} data-offset=${name} class=${name === active ? "active" : ""}>
        <td><b>${name}</b> ${name === active && html`<span class="tag">${t("offsets.active")}</span>`}</td>
        ${axes.map((axis) => html`<td class="figure" data-axis=${axis}>${offsets[name][axis] === undefined ? "" : coordinate(offsets[name][axis])}</td>`)}
        <td class="end"><${Button} name=${`offset-${name}`} label=${t(CLEARED.has(name) ? "offsets.clear" : PLACES.has(name) ? "offsets.store" : "offsets.change")}
          reason=${change} quiet onPress=${() => setOpen(name)} /></td></tr>`)}</tbody></table></div>`}
    ${value?.probe && probed(value.probe) && html`<p class="hint">${t(value.probe.succeeded ? "offsets.probe" : "offsets.probe_failed")}
      ${Object.entries(value.probe.position).map(([axis, at]) => ` ${axis.toUpperCase()}${coordinate(/** @type {number} */ (at))}`)}</p>`}
    ${change && html`<p class="why-line">${t(change)}</p>`}
    ${open !== null && html`<${Change} name=${open} axes=${axes} onClose=${() => setOpen(null)}
      onDone=${(/** @type {Offsets} */ next) => { setOpen(null); setValue(next); }} />`}
  </section>`;
}

/** A Grbl that was switched on and has not probed says 0, 0, 0. @param {{position: Record<string, number>, succeeded: boolean}} probe */
const probed = ({ position, succeeded }) => succeeded || Object.values(position).some((at) => at !== 0);

/** @param {{name: string, axes: string[], onClose: () => void, onDone: (next: Offsets) => void}} props */
function Change({ name, axes, onClose, onDone }) {
  const [mode, setMode] = useState("here");
  const [typed, setTyped] = useState(/** @type {Record<string, string>} */ ({}));
  const reason = against("settings");
  const system = !PLACES.has(name) && !CLEARED.has(name);
  const given = Object.entries(typed).filter(([, text]) => text.trim() !== "").map(([axis, text]) => [axis, Number(text.replace(",", "."))]);
  const wrong = given.some(([, at]) => !Number.isFinite(at)) ? "reason.no_number" : system && given.length === 0 ? "reason.no_axis" : null;
  const save = async () => onDone(CLEARED.has(name)
    ? await request("DELETE", here(`offsets/${name}`), undefined, { withinMs: WITHIN_MS })
    : await request("PATCH", here("offsets"), { system: name, mode: system ? mode : "here", ...Object.fromEntries(given) }, { withinMs: WITHIN_MS }));
  const zero = (/** @type {string[]} */ which) => setTyped({ ...typed, ...Object.fromEntries(which.map((axis) => [axis, "0"])) });
  return html`<${Dialog} name="offset" title=${name} icon="target" onClose=${onClose}>
    <p>${t(CLEARED.has(name) ? "offsets.clear_text" : PLACES.has(name) ? "offsets.store_text" : `offsets.${mode}_text`)}</p>
    ${system && html`<div>
      <${Radios} label=${t("offsets.mode")} of=${MODES} value=${mode} onValue=${setMode}
        text=${(/** @type {string} */ one) => t(`offsets.${one}`)} mark=${(/** @type {string} */ one) => ({ "data-name": `mode-${one}` })} />
      <div class="axis-fields">${axes.map((axis) => html`<label key=${axis}>${axis.toUpperCase()}
        <input type="text" inputmode="decimal" maxlength="16" placeholder="–" data-name=${`to-${axis}`} value=${typed[axis] ?? ""}
          onInput=${(/** @type {any} */ event) => setTyped({ ...typed, [axis]: event.target.value })} /></label>`)}</div>
      ${mode === "here" && html`<div class="row">
        <button type="button" class="button" data-name="zero-here-xy" onClick=${() => zero(axes.filter((axis) => axis !== "z"))}>${t("offsets.zero_xy")}</button>
        <button type="button" class="button" data-name="zero-here" onClick=${() => zero(axes)}>${t("offsets.zero_all")}</button></div>`}
    </div>`}
    <div class="row end"><button type="button" class="button" onClick=${onClose}>${t("dialog.cancel")}</button>
      <${Button} name="offset-save" kind="primary" label=${t(CLEARED.has(name) ? "offsets.clear" : PLACES.has(name) ? "offsets.store" : "offsets.set")}
        reason=${reason ?? wrong} onPress=${save} /></div>
  <//>`;
}
