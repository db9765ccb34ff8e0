// Plots of what a machine does: feed, spindle, position, how long batches take and are acknowledged.
// The rule: what a machine never says has no plot; holding still stops the drawing, not the recording.

import { html, useEffect, useState } from "../lib/ui.js";
import { csv } from "../lib/format.js";
import { number, t } from "../lib/i18n.js";
import { save } from "../lib/save.js";
import { chosen, live, secondsSince } from "../state/store.js";
import { Radios } from "../parts/radios.js";
import { Plot } from "./plot.js";
import { ringOf } from "./record.js";
import { COLUMNS } from "./ring.js";

const DRAWN_EVERY_MS = 250;
const WINDOWS_S = [60, 300, 900];
/** @type {{name: string, unit: string, digits: number, columns: string[]}[]} */
const PLOTS = [
  { name: "feed", unit: "unit.mm_min", digits: 0, columns: ["feed"] },
  { name: "spindle", unit: "unit.rpm", digits: 0, columns: ["spindle"] },
  { name: "position", unit: "unit.mm", digits: 3, columns: ["x", "y", "z", "a", "b", "c"] },
  { name: "batch", unit: "unit.s", digits: 2, columns: ["batch"] },
  { name: "ack", unit: "unit.ms", digits: 1, columns: ["ack"] },
];

export function PlotsPage() {
  const [windowS, setWindowS] = useState(WINDOWS_S[0]);
  const [held, setHeld] = useState(/** @type {number | null} */ (null));
  const [, tick] = useState(0);
  useEffect(() => {
    if (held !== null) return undefined;
    const timer = setInterval(() => { if (!document.hidden) tick((n) => n + 1); }, DRAWN_EVERY_MS);
    return () => clearInterval(timer);
  }, [held]);
  const ring = ringOf(chosen.value ?? ""), now = held ?? nowOf(ring), from = now - windowS;
  const shown = PLOTS.map((plot) => ({ ...plot, columns: plot.columns.filter((column) => ring.has(column)) })).filter(({ columns }) => columns.length);
  return html`<div class="column" data-name="plots">
    <section class="panel plots-bar" aria-label=${t("plots.title")}><h2>${t("plots.title")} <small>${chosen.value}</small></h2>
      <${Radios} label=${t("plots.window")} of=${WINDOWS_S} value=${windowS} onValue=${setWindowS}
        text=${(/** @type {number} */ seconds) => t("plots.minutes", { minutes: seconds / 60 })} mark=${(/** @type {number} */ seconds) => ({ "data-name": `window-${seconds}` })} />
      <div class="row"><button type="button" class="button" data-name="plots-hold" aria-pressed=${held !== null}
          onClick=${() => setHeld(held === null ? nowOf(ring) : null)}>${t(held === null ? "console.hold" : "console.go_on")}</button>
        <button type="button" class="button" data-name="plots-csv" onClick=${() => keep(ring)}>CSV</button></div></section>
    ${shown.length === 0 && html`<p class="empty">${t("plots.none")}</p>`}
    <div class="grid plots-grid">${shown.map(({ name, unit, digits, columns }) => {
      const rows = ring.rows(columns, from, Math.max(from, live.value ? now : Math.min(now, ring.last ?? now)));
      return html`<section key=${name} class=${`panel plot-${name}`} aria-label=${t(`plots.${name}`)}>
        <header><h3>${t(`plots.${name}`)} <small>${t(unit)}</small></h3>
          <p class="plot-values">${columns.map((column, place) => html`<span key=${column}><i class=${`plot-key k-${place + 1}`}></i>${columns.length > 1 ? `${column.toUpperCase()} ` : ""}
            <b>${valueOf(rows[place + 1], digits)}</b></span>`)}</p></header>
        <${Plot} name=${name} rows=${rows} from=${from} to=${now} /></section>`;
    })}</div>
  </div>`;
}

/** The newest. @param {(number | null)[]} row @param {number} digits */
function valueOf(row, digits) {
  const value = row.at(-1);
  return value === null || value === undefined ? "–" : number(value, digits);
}

/** The daemon's clock, s. @param {import("./ring.js").Ring} ring */
function nowOf(ring) {
  const last = ring.last ?? Date.now() / 1000;
  return last + secondsSince(new Date(last * 1000).toISOString());
}

/** All that is remembered, as a file. @param {import("./ring.js").Ring} ring */
function keep(ring) {
  const [times, ...rows] = ring.rows(COLUMNS, -Infinity, Infinity);
  const lines = times.map((at, place) => Object.fromEntries([["at", new Date(/** @type {number} */ (at) * 1000).toISOString()],
    ...COLUMNS.map((name, column) => [name, rows[column][place]])]));
  save(`${chosen.value}-plots.csv`, "text/csv", csv(["at", ...COLUMNS], lines));
}
