// Feed, spindle, tool, and the inputs and limit switches of the machine.
// The rule: a figure that is not known is a dash, never a zero.

import { html } from "../lib/ui.js";
import { number, t } from "../lib/i18n.js";
import { machine } from "../state/store.js";

export function Figures() {
  const state = machine.value?.state;
  if (!state) return null;
  const { feed, spindle, tool, tool_requested: wanted, absolute, inputs, homed, pendant } = state;
  const known = Object.entries(inputs);
  return html`<section class="panel figures" aria-label=${t("figures.title")}>
    <dl>
      <div data-name="feed"><dt>${t("figures.feed")}</dt><dd>${feed === null ? "–" : number(feed)}<small>${t("unit.mm_min")}</small></dd></div>
      <div data-name="spindle"><dt>${t("figures.spindle")}</dt><dd>${spindle === null ? "–" : number(spindle)}<small>${t("unit.rpm")}</small></dd></div>
      <div data-name="tool"><dt>${t("figures.tool")}</dt><dd>${tool === null ? "–" : `T${tool}`}
        ${wanted !== null && wanted !== tool && html`<small>→ T${wanted}</small>`}</dd></div>
      <div><dt>${t("figures.distance")}</dt><dd class="text">${absolute === null ? "–" : t(absolute ? "figures.absolute" : "figures.relative")}</dd></div>
      ${homed !== undefined && homed !== null && html`<div data-name="homed"><dt>${t("figures.homed")}</dt><dd
        class="text">${t(homed ? "figures.yes" : "figures.no")}</dd></div>`}
    </dl>
    ${pendant && html`<p class="problem" data-name="pendant">${t("figures.pendant")}</p>`}
    ${known.length > 0 && html`<ul class="inputs" aria-label=${t("figures.inputs")}>
      ${known.map(([pin, on]) => html`<li key=${pin} class=${on ? "on" : ""}><i aria-hidden="true"></i>${pin}
        <span>${t(on ? "figures.on" : "figures.off")}</span></li>`)}</ul>`}
  </section>`;
}
