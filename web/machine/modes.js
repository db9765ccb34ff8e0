// What is switched at a controller while it works or rests: coolant, spindle stop, door, check mode, sleep.
// The rule: a switch shows what the controller reports, not what was asked.

import { html } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { onMachine, verb } from "../state/actions.js";
import { against, can, machine } from "../state/store.js";
import { Button } from "../parts/button.js";

const COOLANTS = ["flood", "mist"];

export function Modes() {
  const state = machine.value?.state;
  if (!state) return null;
  const on = state.accessories ?? [];
  const checking = state.status === "check";
  return html`<section class="panel service" aria-label=${t("modes.title")}>
    ${can("coolant") && COOLANTS.map((name) => html`<${Button} key=${name} name=${name} kind=${on.includes(name) ? "primary" : ""}
      label=${t(on.includes(name) ? `modes.${name}_on` : `modes.${name}_off`)} reason=${against("overrides")}
      onPress=${() => onMachine("coolant", { [name]: !on.includes(name) })} />`)}
    ${can("spindle_stop") && html`<${Button} name="spindle-stop" label=${t("modes.spindle_stop")}
      reason=${against("overrides") ?? (state.status === "hold" ? null : "reason.not_held")} onPress=${() => verb("spindle-stop")} />`}
    ${can("door") && html`<${Button} name="door" icon="door" label=${t("modes.door")} reason=${against("door")}
      onPress=${() => verb("door")} />`}
    ${can("check_mode") && html`<${Button} name="check-mode" icon="check" kind=${checking ? "primary" : ""}
      label=${t(checking ? "modes.check_off" : "modes.check_on")}
      reason=${against("settings")} onPress=${() => onMachine("check-mode", { on: !checking })} />`}
    ${can("sleep") && html`<${Button} name="sleep" icon="sleep" label=${t("modes.sleep")} reason=${against("settings")}
      onPress=${() => verb("sleep")} />`}
  </section>`;
}
