// Feed, rapid and spindle in percent of the program. The rule: what is shown is what the machine says, not what was asked;
// while a finger is on a slider, it shows the finger.

import { html, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { attempt, override } from "../state/actions.js";
import { against, machine } from "../state/store.js";
import { Radios } from "../parts/radios.js";

const SLIDERS = /** @type {const} */ ({ feed: [10, 200, 5], spindle: [10, 200, 5] });
const RAPIDS = [25, 50, 100]; // what a Grbl knows
const NEUTRAL = 100;
const BY = 10; // what a press of a button changes, %

export function Overrides() {
  const reason = against("overrides");
  const now = machine.value?.state.overrides ?? {};
  const off = Boolean(reason);
  return html`<section class="panel overrides" aria-label=${t("overrides.title")}>
    <h2>${t("overrides.title")}</h2>
    <${Slider} name="feed" percent=${now.feed ?? NEUTRAL} off=${off} />
    <${Rapid} percent=${now.rapid ?? NEUTRAL} off=${off} />
    <${Slider} name="spindle" percent=${now.spindle ?? NEUTRAL} off=${off} />
    ${reason && html`<p class="why-line">${t(reason)}</p>`}
  </section>`;
}

/** A slider for the eye, and buttons that a glove hits. @param {{name: keyof typeof SLIDERS, percent: number, off: boolean}} props */
function Slider({ name, percent, off }) {
  const [held, setHeld] = useState(/** @type {number | null} */ (null));
  const [min, max, step] = SLIDERS[name], label = t(`overrides.${name}`);
  const ask = (/** @type {number} */ value) => attempt(() => override({ [name]: value }));
  const near = (/** @type {number} */ value) => Math.min(max, Math.max(min, value));
  const button = (/** @type {string} */ text, /** @type {number} */ to, /** @type {string} */ way) => html`<button type="button" class="button"
    aria-label=${`${label} ${text}`} data-way=${way} aria-disabled=${off || to === percent} onClick=${() => { if (!off && to !== percent) ask(to); }}>${text}</button>`;
  return html`<div class="override" data-name=${`override-${name}`}>
    <label for=${`override-${name}`}>${label}</label>
    <output>${held ?? percent} %</output>
    <input id=${`override-${name}`} type="range" min=${min} max=${max} step=${step} value=${held ?? percent} disabled=${off}
      onInput=${(/** @type {any} */ event) => setHeld(event.target.valueAsNumber)}
      onChange=${async (/** @type {any} */ event) => { await ask(event.target.valueAsNumber); setHeld(null); }} />
    <div class="override-buttons">${button(`−${BY} %`, near(percent - BY), "less")}${button(`${NEUTRAL} %`, NEUTRAL, "neutral")}${button(`+${BY} %`, near(percent + BY), "more")}</div>
  </div>`;
}

/** @param {{percent: number, off: boolean}} props */
function Rapid({ percent, off }) {
  return html`<div class="override" data-name="override-rapid"><span>${t("overrides.rapid")}</span><output>${percent} %</output>
    <${Radios} kind="override-buttons" label=${t("overrides.rapid")} of=${RAPIDS} value=${percent} text=${(/** @type {number} */ one) => `${one} %`}
      mark=${(/** @type {number} */ one) => ({ "data-percent": one, "aria-disabled": off })}
      onValue=${(/** @type {number} */ one) => { if (!off) attempt(() => override({ rapid: one })); }} /></div>`;
}
