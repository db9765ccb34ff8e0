// What concerns the machine as a whole: unlock, reset, connect, disconnect.
// The rule: each stands where its reason can be read.

import { html } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { verb } from "../state/actions.js";
import { against, can, machine } from "../state/store.js";
import { Button } from "../parts/button.js";

export function Service() {
  const link = machine.value?.link;
  return html`<section class="panel service" aria-label=${t("service.title")}>
    ${can("unlock") && html`<${Button} name="unlock" icon="unlock" label=${t("service.unlock")} reason=${against("unlock")}
      onPress=${() => verb("unlock")} />`}
    ${can("reset") && html`<${Button} name="reset" icon="reset" label=${t("service.reset")} reason=${against("reset")}
      onPress=${() => verb("reset")} />`}
    ${link === "disconnected"
      ? html`<${Button} name="connect" kind="primary" icon="offline" label=${t("service.connect")} reason=${against("connect")}
        onPress=${() => verb("connect")} />`
      : html`<${Button} name="disconnect" icon="offline" label=${t("service.disconnect")} reason=${against("disconnect")}
        onPress=${() => verb("disconnect")} />`}
  </section>`;
}
