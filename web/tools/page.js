// The tool changer of a machine: what it does, its fault, its pins, and the tool table.
// The rule: only inputs are driven from here, and only where nothing else drives them; that is asked for once more.

import { html, useState } from "../lib/ui.js";
import { t, time } from "../lib/i18n.js";
import { request } from "../net/http.js";
import { onMachine, verb } from "../state/actions.js";
import { against, can, chosen } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { useIo } from "./io.js";
import { ToolTable } from "./table.js";

export function ToolsPage() {
  const name = chosen.value ?? "";
  const { io, read } = useIo(name);
  const [asking, setAsking] = useState(/** @type {import("../types.js").Pin | null} */ (null));
  if (!can("io")) return html`<p class="empty">${t("tools.none")}</p>`;
  if (!io) return html`<p class="empty">${t("loading")}</p>`;
  const drive = async (/** @type {import("../types.js").Pin} */ pin) => {
    setAsking(null);
    await request("PATCH", `/machines/${encodeURIComponent(name)}/io`, { pins: { [pin.name]: !pin.value } });
    await read();
  };
  return html`<div class="grid tools-grid">
    <div class="column"><${State} io=${io} read=${read} />${can("tools") && html`<${ToolTable} key=${name} tool=${io.tool} />`}</div>
    <section class="panel" aria-label=${t("tools.pins")} data-name="pins"><h2>${t("tools.pins")}</h2>
      <ul class="pins">${io.pins.map((pin) => html`<li key=${pin.name} data-pin=${pin.name} class=${`${pin.value ? "on" : ""} ${pin.valid ? "" : "unknown"}`}>
        <i aria-hidden="true"></i><code>${pin.name}</code><small>${t(`tools.${pin.direction}`)}</small>
        <b>${pin.valid ? valueOf(pin) : "–"}</b><time>${time(pin.since)}</time>
        ${pin.drivable && pin.type === "bit" && html`<${Button} name=${`drive-${pin.name}`} label=${t(pin.value ? "tools.lower" : "tools.raise")}
          reason=${against("operate")} quiet onPress=${() => setAsking(pin)} />`}</li>`)}</ul></section>
    ${asking && html`<${Dialog} name="ask-drive" kind="warn" icon="alarm" title=${asking.name} onClose=${() => setAsking(null)}>
      <p>${t("tools.drive_text")}</p>
      <div class="row end"><button type="button" class="button" onClick=${() => setAsking(null)}>${t("dialog.cancel")}</button>
        <${Button} name="drive-yes" kind="primary" label=${t(asking.value ? "tools.lower" : "tools.raise")} reason=${against("operate")}
          onPress=${() => drive(asking)} /></div><//>`}
  </div>`;
}

/** @param {import("../types.js").Pin} pin */
const valueOf = ({ type, value }) => (type === "bit" ? t(value ? "figures.on" : "figures.off") : String(value));

/** @param {number | null} tool */
const named = (tool) => (tool === null ? "–" : tool === 0 ? t("tools.empty") : `T${tool}`);

/** @param {{io: import("../types.js").Io, read: () => Promise<void>}} props */
function State({ io, read }) {
  const [typed, setTyped] = useState("");
  const number = Number(typed), wrong = typed === "" || !Number.isInteger(number) || number < 0 ? "reason.no_number" : null;
  const then = async (/** @type {unknown} */ _done) => { setTyped(""); await read(); };
  const fact = (/** @type {string} */ name, /** @type {unknown} */ what) => html`<div data-name=${`tools-${name}`}><dt>${t(`tools.${name}`)}</dt><dd>${what}</dd></div>`;
  return html`<section class="panel" aria-label=${t("tools.title")} data-name="changer"><h2>${t("tools.title")} <small>${t(`tools.kind.${io.kind}`)}</small></h2>
    <dl class="facts">${fact("spindle", named(io.tool))}${fact("prepared", named(io.prepared))}${fact("state", io.state.replaceAll("_", " "))}
      ${fact("waiting", io.waiting_for ?? "–")}${io.kind === "external" && fact("connected", t(io.connected ? "figures.yes" : "figures.no"))}
      ${fact("estop", io.estop.replaceAll("_", " "))}</dl>
    ${io.refusal && html`<p class="hint">${io.refusal}</p>`}
    ${io.faulted && html`<p class="problem" data-name="fault">${t("tools.faulted")}
      <span>${Object.entries(io.parameters).map(([parameter, value]) => `${parameter} = ${value} `)}</span></p>`}
    <div class="row">
      ${io.may_confirm && html`<${Button} name="tools-confirm" kind="go" label=${t("call.tool_in")} reason=${against("confirm")} onPress=${async () => then(await verb("tool/confirm"))} />`}
      ${io.may_fail && html`<${Button} name="tools-fail" kind="end" label=${t("tools.fail")} reason=${against("operate")} onPress=${async () => then(await verb("tool/fail"))} />`}
      ${io.may_clear_fault && html`<${Button} name="tools-clear" label=${t("tools.clear_fault")} reason=${against("operate")} onPress=${async () => then(await verb("tool/clear-fault"))} />`}
    </div>
    <div class="row set-tool"><label class="inline">${t("tools.set")} <input type="number" min="0" step="1" data-name="tool-number" value=${typed}
        onInput=${(/** @type {any} */ event) => setTyped(event.target.value)} /></label>
      <${Button} name="set-tool" label=${t("offsets.set")} reason=${against("operate") ?? wrong} onPress=${async () => then(await onMachine("tool/set", { tool: number }))} /></div>
  </section>`;
}
