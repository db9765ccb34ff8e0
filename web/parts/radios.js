// Buttons of which one is chosen, by the radio pattern of WAI-ARIA: one stop of the tabulator for all of them, arrows move
// and choose. Not a form's field. The rule: whoever else has taken a key (a keyboard that is armed for jogging) keeps it.

import { html } from "../lib/ui.js";

/** @type {Record<string, number>} */
const WAYS = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };

/**
 * @template {string | number} T
 * @param {{
 *   label: string, of: readonly T[], value: T, text: (one: T) => unknown, onValue: (one: T) => void, kind?: string,
 *   mark: (one: T) => Record<string, unknown>,
 * }} props `mark`: attributes of each, for tests and styles
 */
export function Radios({ label, of, value, text, onValue, kind = "filters", mark }) {
  const stop = Math.max(0, of.indexOf(value));
  function key(/** @type {KeyboardEvent} */ event) {
    const way = WAYS[event.key], group = /** @type {HTMLElement} */ (event.currentTarget);
    if (!way || event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    const all = /** @type {HTMLElement[]} */ ([...group.children]);
    const next = (all.indexOf(/** @type {HTMLElement} */ (event.target)) + way + of.length) % of.length;
    onValue(of[next]);
    all[next].focus();
  }
  return html`<div class=${kind} role="radiogroup" aria-label=${label} onKeyDown=${key}>
    ${of.map((one, place) => html`<button type="button" key=${one} class="button" role="radio" aria-checked=${one === value}
      tabindex=${place === stop ? 0 : -1} ...${mark(one)} onClick=${() => onValue(one)}>${text(one)}</button>`)}
  </div>`;
}
