// What the path measures, in words and figures, with a drawing or without.
// The rule: whether it fits is said of the machine's present zero, and only where the machine has said where that is.

import { html } from "../lib/ui.js";
import { coordinate } from "../lib/format.js";
import { number, t } from "../lib/i18n.js";
import { beyond } from "./place.js";

/** @param {{found: import("./reader.js").Found, reach: import("./place.js").Box | null, coarse: boolean}} props */
export function Facts({ found, reach, coarse }) {
  const outside = reach ? beyond(found.bounds, reach) : [];
  return html`<div class="path-facts">
    <dl>${found.bounds.map((range, axis) => range && html`<div key=${axis} data-axis=${"xyz"[axis]}><dt>${"XYZ"[axis]}</dt>
      <dd>${coordinate(range[0])} … ${coordinate(range[1])} <small>${t("unit.mm")}</small></dd></div>`)}
      <div><dt>${t("preview.segments")}</dt><dd>${number(found.segments)}</dd></div></dl>
    ${reach && html`<p class=${outside.length ? "problem" : "hint"} data-name="reach">${outside.length
      ? t("preview.beyond", { axes: outside.map((axis) => axis.toUpperCase()).join(", ") }) : t("preview.within")}</p>`}
    ${found.turning.length > 0 && html`<p class="hint">${t("preview.turning", { axes: found.turning.join(", ") })}</p>`}
    ${coarse && html`<p class="hint" data-name="coarse">${t("preview.coarse")}</p>`}
  </div>`;
}
