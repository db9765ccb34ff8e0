// The programs: drop a file in, see the list, open one. One program is program.js.
// The rule: an upload starts nothing.

import { computed, html, signal, useEffect, useState } from "../lib/ui.js";
import { dateTime, number, t } from "../lib/i18n.js";
import { size } from "../lib/format.js";
import { go, route, to } from "../lib/router.js";
import { get } from "../net/http.js";
import { upload } from "../net/upload.js";
import { attempt } from "../state/actions.js";
import { against, live, world } from "../state/store.js";
import { Icon } from "../parts/icon.js";
import { ProgramView } from "./program.js";

const ACCEPT = ".nc,.ngc,.gcode,.tap,.cnc,.txt,.gc,.mpf,.eia,text/plain";
/** @type {import("../vendor/signals.js").Signal<import("../types.js").Program[] | null>} */
const programs = signal(null);
/** @type {import("../vendor/signals.js").Signal<{name: string, part: number} | null>} */
const uploading = signal(null);
const changed = computed(() => world.value.programsChanged);

export function ProgramsPage() {
  const { id } = route.value;
  useEffect(() => {
    if (live.value) get("/programs").then((found) => { programs.value = found; }, () => {});
  }, [changed.value, live.value]);
  return html`<div class=${`grid programs-grid ${id ? "open" : ""}`}>
    <div class="column list-column"><${Drop} /><${List} /></div>
    ${id ? html`<${ProgramView} key=${id} id=${id} />` : html`<p class="empty panel no-program">${t("programs.none_open")}</p>`}
  </div>`;
}

/** @param {FileList | null | undefined} files */
async function take(files) {
  if (against("operate")) return;
  for (const file of files ?? []) {
    uploading.value = { name: file.name, part: 0 };
    const stored = await attempt(() => upload(file, (part) => { uploading.value = { name: file.name, part }; }));
    if (stored) go(to("programs", stored.id));
  }
  uploading.value = null;
}

function Drop() {
  const [over, setOver] = useState(false);
  const reason = against("operate");
  useEffect(() => {
    const hover = (/** @type {DragEvent} */ event) => { event.preventDefault(); setOver(true); };
    const leave = (/** @type {DragEvent} */ event) => { if (!event.relatedTarget) setOver(false); };
    const drop = (/** @type {DragEvent} */ event) => {
      event.preventDefault();
      setOver(false);
      take(event.dataTransfer?.files);
    };
    addEventListener("dragover", hover);
    addEventListener("dragleave", leave);
    addEventListener("drop", drop);
    return () => {
      removeEventListener("dragover", hover);
      removeEventListener("dragleave", leave);
      removeEventListener("drop", drop);
    };
  }, []);
  const now = uploading.value;
  return html`<label class=${`panel drop ${over ? "over" : ""}`} aria-disabled=${Boolean(reason)}>
    <${Icon} name="upload" size=${32} />
    ${now ? html`<span>${now.name}</span><progress max="1" value=${now.part} aria-label=${t("programs.uploading")}></progress>`
      : html`<span><b>${t("programs.drop")}</b> ${t("programs.or_choose")}</span>`}
    ${reason && html`<small class="why">${t(reason)}</small>`}
    <input type="file" multiple accept=${ACCEPT} disabled=${Boolean(reason) || now !== null} data-name="file"
      onChange=${(/** @type {any} */ event) => { take(event.target.files); event.target.value = ""; }} />
  </label>`;
}

function List() {
  const found = programs.value;
  if (found === null) return html`<p class="empty">${t("loading")}</p>`;
  return html`<section class="panel" aria-label=${t("programs.title")}>
    <h2>${t("programs.title")} <small>${found.length || ""}</small></h2>
    ${found.length === 0 && html`<p class="empty">${t("programs.empty")}</p>`}
    <ul class="program-list">${found.map((one) => html`<li key=${one.id}>
      <a href=${to("programs", one.id)} aria-current=${one.id === route.value.id ? "true" : undefined}>
        <b>${one.name}</b><small>${t("programs.facts", { lines: number(one.lines), size: size(one.bytes) })} · ${dateTime(one.created_at)}</small></a></li>`)}</ul>
  </section>`;
}
