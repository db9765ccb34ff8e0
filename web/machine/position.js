// Where the tool is: work coordinates large, machine coordinates beside, and what sets or goes to zero.
// The rule: digits never jump (fixed places), and old digits look old.

import { html, useState } from "../lib/ui.js";
import { coordinate } from "../lib/format.js";
import { t } from "../lib/i18n.js";
import { run } from "../state/actions.js";
import { against, can, machine } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { blocksOf } from "./blocks.js";

const ROTARY = new Set(["a", "b", "c"]);

export function Position() {
  const [asking, setAsking] = useState(/** @type {string[] | null} */ (null));
  const [going, setGoing] = useState(/** @type {string[] | null} */ (null));
  const now = machine.value;
  if (!now) return null;
  const { work, machine: absolute } = now.state.position;
  const axes = Object.keys(work).length ? Object.keys(work) : Object.keys(absolute);
  const blocks = can("commands") ? blocksOf(now.protocol) : null;
  const reason = against("by_hand");
  const flat = axes.filter((axis) => axis === "x" || axis === "y");
  return html`<section class=${`panel position ${now.link === "connected" ? "" : "old"}`} aria-label=${t("position.title")}>
    <header><h2>${t("position.work")}</h2><h3>${t("position.machine")}</h3></header>
    ${axes.length === 0 && html`<p class="empty">${t("position.unknown")}</p>`}
    <ul class="axes">${axes.map((axis) => html`<li key=${axis} data-axis=${axis} class=${ROTARY.has(axis) ? "rotary" : ""}>
      <b>${axis.toUpperCase()}</b>
      <output class="work">${work[axis] === undefined ? "–" : coordinate(work[axis])}</output>
      <output class="absolute">${absolute[axis] === undefined ? "–" : coordinate(absolute[axis])}</output>
      <span class="unit">${ROTARY.has(axis) ? "°" : t("unit.mm")}</span>
      ${blocks && html`<${Button} name=${`zero-${axis}`} label=${t("position.zero", { axis: axis.toUpperCase() })}
        reason=${reason} quiet
        title=${t("position.zero_title", { axis: axis.toUpperCase() })} onPress=${() => setAsking([axis])} />`}
    </li>`)}</ul>
    ${blocks && axes.length > 0 && html`<div class="row">
      <${Button} name="zero-all" label=${t("position.zero_all")} reason=${reason} quiet onPress=${() => setAsking(axes)} />
      <${Button} name="go-zero" icon="target" label=${t("position.go_zero_xy")} reason=${reason} quiet onPress=${() => setGoing(flat)} />
      ${axes.includes("z") && html`<${Button} name="go-zero-z" label=${t("position.go_zero_z")} reason=${reason} quiet onPress=${() => setGoing(["z"])} />`}
    </div>`}
    ${reason && html`<p class="why-line">${t(reason)}</p>`}
    ${going && blocks && html`<${AskGo} axes=${going} work=${work} onYes=${() => run(blocks.go(going))} onClose=${() => setGoing(null)} />`}
    ${asking && blocks && html`<${AskZero} axes=${asking} onYes=${() => run(blocks.zero(asking))} onClose=${() => setAsking(null)} />`}
  </section>`;
}

/** A rapid goes straight through whatever stands between. @param {{axes: string[], work: Record<string, number>, onYes: () => unknown, onClose: () => void}} props */
function AskGo({ axes, work, onYes, onClose }) {
  const place = (/** @type {string[]} */ which) => which.map((axis) => `${axis.toUpperCase()} ${coordinate(work[axis])}`).join("  ");
  const rest = Object.keys(work).filter((axis) => !axes.includes(axis) && !ROTARY.has(axis));
  return html`<${Dialog} title=${t("position.go_ask", { place: axes.map((axis) => `${axis.toUpperCase()}0`).join(" ") })} icon="target" name="ask-go" kind="warn" onClose=${onClose}>
    <p>${t("position.go_text", { from: place(axes) })}</p>
    <p class="call-text">${t("position.go_stays", { place: place(rest) })}</p>
    <div class="row end">
      <button type="button" class="button" onClick=${onClose}>${t("dialog.cancel")}</button>
      <${Button} name="go-yes" kind="primary" label=${t("position.go_yes")} reason=${against("by_hand")}
        onPress=${async () => { onClose(); await onYes(); }} />
    </div>
  <//>`;
}

/** A work offset that was lost by a slip of the finger costs a part. @param {{axes: string[], onYes: () => unknown, onClose: () => void}} props */
function AskZero({ axes, onYes, onClose }) {
  const named = axes.map((axis) => axis.toUpperCase()).join(", ");
  return html`<${Dialog} title=${t("position.zero_ask", { axes: named })} icon="target" name="ask-zero" onClose=${onClose}>
    <p>${t("position.zero_text", { axes: named })}</p>
    <div class="row end">
      <button type="button" class="button" onClick=${onClose}>${t("dialog.cancel")}</button>
      <${Button} name="zero-yes" kind="primary" label=${t("position.zero_yes")}
        onPress=${async () => { onClose(); await onYes(); }} />
    </div>
  <//>`;
}
