// A button that says why it cannot be pressed. The rule: never disabled without the reason in sight.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { attempt } from "../state/actions.js";
import { Icon } from "./icon.js";

/**
 * @param {{
 *   label: string, icon?: string, kind?: string, reason?: string | null, quiet?: boolean, name?: string, title?: string,
 *   onPress: () => unknown,
 * }} props `kind` of its look; `quiet`: the reason stands beside the group already; `name` for tests and styles.
 */
export function Button({ label, icon, kind = "", reason = null, quiet = false, name, title, onPress }) {
  const [busy, setBusy] = useState(false);
  async function press() {
    if (reason || busy) return;
    setBusy(true);
    await attempt(onPress);
    setBusy(false);
  }
  const why = reason ? t(reason) : "";
  return html`<button type="button" class=${`button ${kind}`} data-name=${name} aria-disabled=${Boolean(reason)} aria-busy=${busy}
      title=${why || title || undefined} onClick=${press}>
    ${icon && html`<${Icon} name=${icon} />`}
    <span class="label"><span>${label}</span>${why && !quiet && html`<small class="why">${why}</small>`}</span>
  </button>`;
}
