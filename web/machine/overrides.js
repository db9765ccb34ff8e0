// Feed, rapid and spindle in percent of the program. The rule: the slider shows what the machine says, not what was asked;
// while a finger is on it, it shows the finger.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { attempt, override } from "../state/actions.js";
import { against, machine } from "../state/store.js";

const RANGES = /** @type {const} */ ({ feed: [10, 200, 5], rapid: [25, 100, 25], spindle: [10, 200, 5] });
const NEUTRAL = 100;

export function Overrides() {
  const reason = against("overrides");
  const now = machine.value?.state.overrides ?? {};
  return html`<section class="panel overrides" aria-label=${t("overrides.title")}>
    <h2>${t("overrides.title")}</h2>
    ${Object.keys(RANGES).map((name) => html`<${Slider} key=${name}
      name=${name} percent=${now[name] ?? NEUTRAL} off=${Boolean(reason)} />`)}
    ${reason && html`<p class="why-line">${t(reason)}</p>`}
  </section>`;
}

/** @param {{name: keyof typeof RANGES, percent: number, off: boolean}} props */
function Slider({ name, percent, off }) {
  const [held, setHeld] = useState(/** @type {number | null} */ (null));
  const [min, max, step] = RANGES[name];
  const ask = (/** @type {number} */ value) => attempt(() => override({ [name]: value }));
  return html`<div class="override" data-name=${`override-${name}`}>
    <label for=${`override-${name}`}>${t(`overrides.${name}`)}</label>
    <output>${held ?? percent} %</output>
    <input id=${`override-${name}`} type="range" min=${min} max=${max} step=${step} value=${held ?? percent} disabled=${off}
      onInput=${(/** @type {any} */ event) => setHeld(event.target.valueAsNumber)}
      onChange=${async (/** @type {any} */ event) => { await ask(event.target.valueAsNumber); setHeld(null); }} />
    <button type="button" class="button" disabled=${off || percent === NEUTRAL} onClick=${() => ask(NEUTRAL)}>100 %</button>
  </div>`;
}
