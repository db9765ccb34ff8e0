// The last things worth knowing, the newest first. The rule: as the daemon said it, as text.

import { computed, html } from "../lib/ui.js";
import { t, time } from "../lib/i18n.js";
import { chosen, log, problem } from "../state/store.js";

const SHOWN = 40;
const lines = computed(() => log.value.filter((one) => one.machine === null || one.machine === chosen.value).slice(-SHOWN).reverse());

export function LogPanel() {
  return html`<section class="panel log" aria-label=${t("log.title")}>
    <h2>${t("log.title")}</h2>
    ${problem.value && html`<p class="problem">${problem.value}</p>`}
    ${lines.value.length === 0 && html`<p class="empty">${t("log.empty")}</p>`}
    <ol>${lines.value.map((one, index) => html`<li key=${index}
      class=${one.level}><time>${time(one.at)}</time><span>${one.text}</span></li>`)}</ol>
  </section>`;
}
