// What of the path is shown: rapids or not, which tools, which layers.
// The rule: a filter hides, it never changes what is run.

import { html } from "../lib/ui.js";
import { coordinate } from "../lib/format.js";
import { t } from "../lib/i18n.js";

/**
 * @param {{
 *   reach: boolean, tools: number[], heights: number[], wish: import("./path.js").Wish, onWish: (wish: import("./path.js").Wish) => void,
 * }} props
 */
export function Filters({ reach, tools, heights, wish, onWish }) {
  const toggle = (/** @type {number} */ tool) => {
    const now = wish.tools ?? tools;
    const next = now.includes(tool) ? now.filter((one) => one !== tool) : [...now, tool];
    onWish({ ...wish, tools: next.length === tools.length ? null : next });
  };
  return html`<div class="path-filters">
    <span class="inline"><i class="path-key"></i>${t("preview.cuts")}</span><span class="inline"><i class="path-key done"></i>${t("preview.done")}</span>
    <label class="inline"><input type="checkbox" checked=${wish.rapids} data-name="rapids"
      onChange=${() => onWish({ ...wish, rapids: !wish.rapids })} /> <i class="path-key rapid"></i>${t("preview.rapids")}</label>
    ${reach && html`<span class="inline"><i class="path-key reach"></i>${t("preview.reach")}</span>`}
    ${tools.length > 1 && html`<span class="filters" role="group" aria-label=${t("preview.tools")}>${tools.map((tool) => html`
      <button key=${tool} type="button" class="button" aria-pressed=${(wish.tools ?? tools).includes(tool)} data-tool=${tool}
        onClick=${() => toggle(tool)}>${tool < 0 ? t("preview.no_tool") : `T${tool}`}</button>`)}</span>`}
    ${heights.length > 1 && html`<${LayerRange} heights=${heights} wish=${wish} onWish=${onWish} />`}
  </div>`;
}

/** @param {{heights: number[], wish: import("./path.js").Wish, onWish: (wish: import("./path.js").Wish) => void}} props */
function LayerRange({ heights, wish, onWish }) {
  const last = heights.length - 1;
  const place = (/** @type {number | null} */ height, /** @type {number} */ otherwise) => {
    const found = height === null ? -1 : heights.findIndex((one) => one >= height);
    return found < 0 ? otherwise : found;
  };
  const low = place(wish.lowest, 0), high = place(wish.highest, last);
  const set = (/** @type {number} */ from, /** @type {number} */ to) =>
    onWish({ ...wish, lowest: from === 0 ? null : heights[from], highest: to === last ? null : heights[to] });
  const slider = (/** @type {string} */ name, /** @type {number} */ at, /** @type {(at: number) => void} */ onAt) => html`
    <label class="layer"><span>${t(`preview.${name}`)}</span> <output>Z ${coordinate(heights[at])}</output>
      <input type="range" min="0" max=${last} value=${at} data-name=${name}
        onInput=${(/** @type {any} */ event) => onAt(event.target.valueAsNumber)} /></label>`;
  return html`<span class="layers" role="group" aria-label=${t("preview.layers")}>
    ${slider("layer_low", low, (at) => set(at, Math.max(at, high)))}
    ${slider("layer_high", high, (at) => set(Math.min(at, low), at))}</span>`;
}
