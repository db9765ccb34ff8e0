// A window over the page. Not <dialog>: that would lie over the e-stop and take its touch away.
// The rule: the keyboard stays inside, Escape is the quiet way out, and the e-stop stays above.

import { html, useEffect, useRef } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { Icon } from "./icon.js";

const FOCUSABLE = "button, input, select, textarea, a[href], [tabindex='0']";

/**
 * @param {{title: string, kind?: string, icon?: string, name?: string, wide?: boolean, onClose: () => void, children?: unknown}} props
 */
export function Dialog({ title, kind = "", icon, name, wide = false, onClose, children }) {
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => {
    const before = document.activeElement;
    box.current?.focus();
    return () => before instanceof HTMLElement && before.focus();
  }, []);
  function key(/** @type {KeyboardEvent} */ event) {
    if (event.key === "Escape") onClose();
    if (event.key !== "Tab" || !box.current) return;
    const inside = /** @type {HTMLElement[]} */ ([...box.current.querySelectorAll(FOCUSABLE)]);
    const estop = document.getElementById("estop");
    const ring = estop ? [...inside, estop] : inside;
    const at = ring.indexOf(/** @type {HTMLElement} */ (document.activeElement));
    event.preventDefault();
    ring[(at + (event.shiftKey ? ring.length - 1 : 1)) % ring.length]?.focus();
  }
  return html`<div class="veil" onKeyDown=${key}>
    <section ref=${box} class=${`dialog ${kind} ${wide ? "wide" : ""}`} role="dialog" aria-modal="true" aria-label=${title}
        tabindex="-1" data-name=${name}>
      <header>
        ${icon && html`<${Icon} name=${icon} size=${32} />`}
        <h2>${title}</h2>
        <button type="button" class="button plain" aria-label=${t("dialog.close")} onClick=${onClose}><${Icon}
          name="close" /></button>
      </header>
      <div class="dialog-body">${children}</div>
    </section>
  </div>`;
}
