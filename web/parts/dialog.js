// A window over the page. Not <dialog>: that would lie over the e-stop and take its touch away.
// The rule: the keyboard stays inside, Escape is the quiet way out, and the e-stop stays above.

import { html, signal, useLayoutEffect, useRef } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { Icon } from "./icon.js";

/** The open ones, the topmost last: it alone hears the keys, wherever the focus is. @type {object[]} */
const open = [];
/** How many there are. */
export const openDialogs = signal(0);
const FOCUSABLE = ["button", "input", "select", "textarea"].map((one) => `${one}:not(:disabled, [tabindex="-1"])`).join() + ",a[href],[tabindex='0']";

/**
 * @param {{title: string, kind?: string, icon?: string, name?: string, wide?: boolean, onClose: () => void, children?: unknown}} props
 */
export function Dialog({ title, kind = "", icon, name, wide = false, onClose, children }) {
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  const close = useRef(onClose);
  close.current = onClose;
  useLayoutEffect(() => {
    const before = document.activeElement, me = {};
    const key = (/** @type {KeyboardEvent} */ event) => { if (open.at(-1) === me) hear(event, box.current, close.current); };
    open.push(me);
    openDialogs.value = open.length;
    document.addEventListener("keydown", key);
    box.current?.focus();
    return () => {
      open.splice(open.indexOf(me), 1);
      openDialogs.value = open.length;
      document.removeEventListener("keydown", key);
      if (before instanceof HTMLElement) before.focus();
    };
  }, []);
  return html`<div class="veil">
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

/** The tabulator goes round in the dialog, and by the e-stop. @param {KeyboardEvent} event @param {HTMLElement | null} box @param {() => void} close */
function hear(event, box, close) {
  if (event.key === "Escape") close();
  if (event.key !== "Tab" || !box) return;
  const estop = document.getElementById("estop"), inside = /** @type {HTMLElement[]} */ ([...box.querySelectorAll(FOCUSABLE)]);
  const ring = estop ? [...inside, estop] : inside;
  const at = ring.indexOf(/** @type {HTMLElement} */ (document.activeElement));
  event.preventDefault();
  ring[(at + (event.shiftKey ? ring.length - 1 : 1)) % ring.length]?.focus();
}
