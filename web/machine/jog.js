// The jog pad: by steps, or for as long as a button is held. The rule: a press moves by exactly the step that is shown,
// and a held move ends with the finger.

import { html, useEffect } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { jogFeed, jogStep } from "../lib/prefs.js";
import { attempt, jog, verb } from "../state/actions.js";
import { against, can, chosen, machine } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Icon } from "../parts/icon.js";
import { notify } from "../parts/notices.js";
import { Radios } from "../parts/radios.js";
import { axesOf } from "./blocks.js";
import { jogger } from "./jogger.js";
import { armed, listen } from "./keyboard.js";

const HELD = 0; // as a step: for as long as it is held
const STEPS = [0.01, 0.1, 1, 10, 100, HELD]; // mm
const LONG_MM = 10; // steps from here on take their time
const MIN_FEED = 1, MAX_FEED = 20_000;

/** @type {{way: Record<string, number>, icon: string, name: string, place: string}[]} */
const PAD = [
  { way: { x: -1, y: 1 }, icon: "", name: "X− Y+", place: "nw" }, { way: { y: 1 }, icon: "up", name: "Y+", place: "n" },
  { way: { x: 1, y: 1 }, icon: "", name: "X+ Y+", place: "ne" }, { way: { x: -1 }, icon: "left", name: "X−", place: "w" },
  { way: { x: 1 }, icon: "right", name: "X+", place: "e" }, { way: { x: -1, y: -1 }, icon: "", name: "X− Y−", place: "sw" },
  { way: { y: -1 }, icon: "down", name: "Y−", place: "s" }, { way: { x: 1, y: -1 }, icon: "", name: "X+ Y−", place: "se" },
  { way: { z: 1 }, icon: "up", name: "Z+", place: "zu" }, { way: { z: -1 }, icon: "down", name: "Z−", place: "zd" },
];

/** A lathe has no Y. */
const axes = () => {
  const now = machine.value;
  return now ? axesOf(now.protocol, Object.keys(now.state.position.work)) : [];
};

/** @param {Record<string, number>} way */
function begin(way) {
  const name = chosen.peek(), step = jogStep.peek(), feed = jogFeed.peek(), there = axes();
  if (name === null || against("jog") || !Object.keys(way).every((axis) => there.includes(axis))) return;
  if (step === HELD) jogger.hold(name, way, feed, notify);
  else attempt(() => jog(Object.fromEntries(Object.entries(way).map(([axis, sign]) => [axis, sign * step])), feed));
}
const end = () => jogger.release();

export function JogPanel() {
  const reason = against("jog");
  useEffect(() => (armed.value ? listen({ down: begin, up: end }) : undefined), [armed.value]);
  useEffect(() => () => { armed.value = false; end(); }, []);
  useEffect(() => { if (reason) armed.value = false; }, [reason]);
  const there = axes(), extra = there.filter((axis) => !"xyz".includes(axis));
  const pad = PAD.filter(({ way }) => Object.keys(way).every((axis) => there.includes(axis)));
  return html`<section class="panel jog" aria-label=${t("jog.title")}>
    <header><h2>${t("jog.title")}</h2>
      <button type="button" class=${`button arm ${armed.value ? "armed" : ""}`} data-name="arm" aria-pressed=${armed.value}
        aria-disabled=${Boolean(reason)} title=${t("jog.arm_title")} onClick=${() => { if (!reason) armed.value = !armed.value; }}>
        <${Icon} name="keyboard" /><span class="label">${t(armed.value ? "jog.armed" : "jog.arm")}</span></button>
    </header>
    <div class="pad" role="group" aria-label=${t("jog.title")}>
      ${pad.map((one) => html`<${PadButton} key=${one.place} ...${one} off=${Boolean(reason)} />`)}
      ${can("home") && html`<div class="pad-home"><${Button} name="home" icon="home" label=${t("jog.home")}
        reason=${against("home")} quiet
        onPress=${() => verb("home")} /></div>`}
    </div>
    ${extra.length > 0 && html`<div class="row extra">${extra.flatMap((axis) => [-1, 1].map((sign) => html`<${PadButton}
      key=${axis + sign} way=${{ [axis]: sign }} icon="" name=${`${axis.toUpperCase()}${sign < 0 ? "−" : "+"}`} place="" off=${Boolean(reason)} />`))}</div>`}
    <${Steps} />
    <${Feed} />
    <p class="why-line" data-name="jog-why">${reason ? t(reason) : t(jogStep.value === HELD ? "jog.help_hold" : can("jog_cancel") || jogStep.value < LONG_MM ? "jog.help_step" : "jog.help_whole")}</p>
  </section>`;
}

/** @param {{way: Record<string, number>, icon: string, name: string, place: string, off: boolean}} props */
function PadButton({ way, icon, name, place, off }) {
  function down(/** @type {PointerEvent} */ event) {
    if (event.button !== 0 || off) return;
    /** @type {HTMLElement} */ (event.currentTarget).setPointerCapture(event.pointerId);
    begin(way);
  }
  function key(/** @type {KeyboardEvent} */ event) {
    if ((event.key !== "Enter" && event.key !== " ") || event.repeat || off) return;
    event.preventDefault();
    begin(way);
  }
  return html`<button type="button" class=${`button pad-button p-${place}`}
    aria-label=${name} aria-disabled=${off} data-jog=${name}
      onPointerDown=${down} onPointerUp=${end} onPointerCancel=${end} onLostPointerCapture=${end} onKeyDown=${key} onKeyUp=${end} onBlur=${end}
      onContextMenu=${(/** @type {Event} */ event) => event.preventDefault()}>
    ${icon && html`<${Icon} name=${icon} />`}<span>${name}</span></button>`;
}

function Steps() {
  return html`<${Radios} kind="steps" label=${t("jog.step")} of=${STEPS} value=${jogStep.value}
    text=${(/** @type {number} */ step) => (step === HELD ? t("jog.hold") : step)} mark=${(/** @type {number} */ step) => ({ "data-step": step })}
    onValue=${(/** @type {number} */ step) => { jogStep.value = step; }} />`;
}

function Feed() {
  const set = (/** @type {number} */ value) => {
    if (Number.isFinite(value)) jogFeed.value = Math.min(MAX_FEED, Math.max(MIN_FEED, Math.round(value)));
  };
  return html`<div class="feed">
    <label for="jog-feed">${t("jog.feed")}</label>
    <button type="button" class="button" aria-label=${`÷2: ${t("jog.slower")}`} onClick=${() => set(jogFeed.value / 2)}>÷2</button>
    <input id="jog-feed" type="number" inputmode="numeric" min=${MIN_FEED} max=${MAX_FEED} value=${jogFeed.value}
      onChange=${(/** @type {any} */ event) => set(event.target.valueAsNumber)} />
    <button type="button" class="button" aria-label=${`×2: ${t("jog.faster")}`} onClick=${() => set(jogFeed.value * 2)}>×2</button>
    <span class="unit">${t("unit.mm_min")}</span>
  </div>`;
}
