// The controller itself: firmware, modal state, check mode and sleep, start-up blocks, and its way back to the defaults.
// The rule: what it says of itself is shown as it says it, as text.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { request } from "../net/http.js";
import { onMachine, verb } from "../state/actions.js";
import { against, can, machine } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Defaults } from "./defaults.js";
import { here, useRead } from "./read.js";
import { StartupBlocks } from "./startup.js";

export function ControllerSection() {
  return html`<div class="grid controller-grid">
    <${Firmware} />
    <div class="column">${can("modal") && html`<${Modal} />`}${(can("check_mode") || can("sleep")) && html`<${Modes} />`}</div>
    <div class="column">${can("startup_blocks") && html`<${StartupBlocks} />`}${can("restore") && html`<${Defaults} />`}</div>
  </div>`;
}

function Firmware() {
  const { value, setValue, read, reason } = useRead("firmware");
  const [text, setText] = useState(/** @type {string | null} */ (null));
  const row = (/** @type {string} */ name, /** @type {unknown} */ what) => html`<div><dt>${t(`firmware.${name}`)}</dt><dd>${what}</dd></div>`;
  const write = async () => {
    setValue(await request("PUT", here("firmware/info"), { info: text ?? "" }));
    setText(null);
  };
  return html`<section class="panel" aria-label=${t("firmware.title")} data-name="firmware">
    <header><h2>${t("firmware.title")}</h2><${Button} name="read-firmware" icon="reset" label=${t("settings.read")} reason=${reason} onPress=${read} /></header>
    ${value === null ? html`<p class="empty">${t(reason ?? "loading")}</p>` : html`<div>
      <dl class="facts">${row("version", `${value.flavour} ${value.version}`)}${row("build", value.build)}${row("axes", value.axes.join(" ").toUpperCase())}
        ${row("planner", value.planner_blocks ?? "–")}${row("buffer", value.rx_bytes === null ? "–" : `${value.rx_bytes} B`)}</dl>
      ${value.warnings.map((/** @type {string} */ one) => html`<p class="problem">${one}</p>`)}
      <label class="info-text">${t("firmware.info")}<input type="text" maxlength="80" data-name="info-text" disabled=${against("change_settings") !== null}
        value=${text ?? value.info} onInput=${(/** @type {any} */ event) => setText(event.target.value)} /></label>
      ${text !== null && text !== value.info && html`<${Button} name="write-info" label=${t("firmware.write")} reason=${against("change_settings")} onPress=${write} />`}
      <ul class="options">${value.options.map((/** @type {{code: string, meaning: string | null}} */ one) => html`<li key=${one.code}><b>${one.code}</b><span>${one.meaning ?? ""}</span></li>`)}</ul>
      <dl class="facts">${Object.entries(value.facts).map(([name, what]) => html`<div key=${name}><dt>${name}</dt><dd>${what}</dd></div>`)}</dl>
    </div>`}
  </section>`;
}

function Modal() {
  const { value, read, reason } = useRead("modal");
  return html`<section class="panel" aria-label=${t("modal.title")} data-name="modal">
    <header><h2>${t("modal.title")}</h2><${Button} name="read-modal" icon="reset" label=${t("settings.read")} reason=${reason} onPress=${read} /></header>
    ${value === null ? html`<p class="empty">${t(reason ?? "loading")}</p>` : html`<dl class="facts">
      ${Object.entries(value.groups).filter(([, word]) => word.length).map(([group, word]) => html`<div key=${group} data-group=${group}>
        <dt>${group.replaceAll("_", " ")}</dt><dd>${Array.isArray(word) ? word.join(" ") : word}</dd></div>`)}</dl>`}
  </section>`;
}

function Modes() {
  const checking = machine.value?.state.status === "check";
  return html`<section class="panel" aria-label=${t("modes.title")}><h2>${t("modes.title")}</h2>
    <div class="row">
      ${can("check_mode") && html`<${Button} name="controller-check" icon="check" kind=${checking ? "primary" : ""} label=${t(checking ? "modes.check_off" : "modes.check_on")}
        reason=${against("settings")} onPress=${() => onMachine("check-mode", { on: !checking })} />`}
      ${can("sleep") && html`<${Button} name="controller-sleep" icon="sleep" label=${t("modes.sleep")} reason=${against("settings")} onPress=${() => verb("sleep")} />`}
    </div>
    <p class="hint">${t("modes.hint")}</p>
  </section>`;
}
