// The page of a controller's own memory, in sections: settings, offsets, the controller itself.
// The rule: a section that the controller has nothing for is not there.

import { html } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { route, to } from "../lib/router.js";
import { can, chosen } from "../state/store.js";
import { ControllerSection } from "./controller.js";
import { OffsetsSection } from "./offsets.js";
import { SettingsPage } from "./page.js";

/** @type {Record<string, {needs: string, View: () => unknown}>} */
const SECTIONS = {
  settings: { needs: "settings", View: SettingsPage },
  offsets: { needs: "offsets", View: OffsetsSection },
  controller: { needs: "firmware", View: ControllerSection },
};

export function SettingsSections() {
  const names = Object.keys(SECTIONS).filter((name) => can(SECTIONS[name].needs));
  const asked = route.value.id ?? "", shown = names.includes(asked) ? asked : names[0];
  if (!shown) return html`<p class="empty">${t("settings.none")}</p>`;
  return html`<div>
    <nav class="filters sections" aria-label=${t("settings.sections")}>${names.map((name) => html`<a key=${name} class="button"
      href=${to("settings", name)} data-name=${`section-${name}`} aria-current=${name === shown ? "page" : undefined}>${t(`settings.section.${name}`)}</a>`)}</nav>
    <${SECTIONS[shown].View} key=${`${chosen.value} ${shown}`} />
  </div>`;
}
