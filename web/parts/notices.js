// Short words about what has just been done or refused. The rule: text, as it came; the newest is at the bottom and goes by itself.

import { html, signal } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { Icon } from "./icon.js";

/** A refusal is read by whoever was looking at the machine. */
const SHOWN_MS = { done: 9000, error: 30_000 };
const AT_MOST = 4;
/** @type {import("../vendor/signals.js").Signal<{id: number, kind: string, text: string}[]>} */
const notices = signal([]);
let last = 0;

/** @param {string} text @param {"error" | "done"} [kind] */
export function notify(text, kind = "error") {
  const id = ++last;
  notices.value = [...notices.value.filter((one) => one.text !== text).slice(1 - AT_MOST), { id, kind, text }];
  setTimeout(dismiss, SHOWN_MS[kind], id);
}

/** @param {number} id */
function dismiss(id) {
  notices.value = notices.value.filter((one) => one.id !== id);
}

export function Notices() {
  return html`<div class="notices" role="status" aria-live="polite">
    ${notices.value.map((one) => html`<p key=${one.id} class=${`notice ${one.kind}`}>
      <span>${one.text}</span>
      <button type="button" class="button plain" aria-label=${t("dialog.close")} onClick=${() => dismiss(one.id)}>
        <${Icon} name="close" size=${20} /></button>
    </p>`)}
  </div>`;
}
