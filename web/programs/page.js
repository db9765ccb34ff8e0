// The programs: drop a file in, see the list, open one. One program is program.js.
// The rule: an upload starts nothing.

import { computed, html, signal, useEffect, useState } from "../lib/ui.js";
import { count, dateTime, t } from "../lib/i18n.js";
import { size } from "../lib/format.js";
import { go, route, to } from "../lib/router.js";
import { get } from "../net/http.js";
import { upload } from "../net/upload.js";
import { attempt } from "../state/actions.js";
import { against, live, world } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Icon } from "../parts/icon.js";
import { ProgramView } from "./program.js";

const LONG = 8; // programs; more are looked for by name
const MOST = 300; // shown at once
const ACCEPT = ".nc,.ngc,.gcode,.tap,.cnc,.txt,.gc,.mpf,.eia,text/plain";
/** @type {import("../vendor/signals.js").Signal<import("../types.js").Program[] | null>} */
const programs = signal(null);
/** @type {import("../vendor/signals.js").Signal<{name: string, part: number} | null>} */
const uploading = signal(null);
let stopping = new AbortController();
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
  if (against("operate") || uploading.value) return;
  stopping = new AbortController();
  for (const file of files ?? []) {
    if (stopping.signal.aborted) break;
    uploading.value = { name: file.name, part: 0 };
    const stored = await attempt(() => upload(file, (part) => { uploading.value = { name: file.name, part }; }, stopping.signal));
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
    ${now ? html`<span class="name">${now.name}</span><span>${Math.floor(now.part * 100)} %</span><progress max="1" value=${now.part} aria-label=${t("programs.uploading")}></progress>`
      : html`<span><b>${t("programs.drop")}</b> ${t("programs.or_choose")}</span>`}
    ${reason && html`<small class="why">${t(reason)}</small>`}
    <input type="file" multiple accept=${ACCEPT} aria-disabled=${Boolean(reason) || now !== null} data-name="file"
      onClick=${(/** @type {Event} */ event) => { if (reason || now) event.preventDefault(); }}
      onChange=${(/** @type {any} */ event) => { take(event.target.files); event.target.value = ""; }} />
  </label>${now && html`<${Button} name="upload-stop" icon="close" label=${t("programs.break_off")} onPress=${() => stopping.abort()} />`}`;
}

function List() {
  const [filter, setFilter] = useState("");
  const found = programs.value, needle = filter.trim().toLowerCase();
  if (found === null) return html`<p class="empty">${t("loading")}</p>`;
  return html`<section class="panel" aria-label=${t("programs.title")}>
    <h2>${t("programs.title")} <small>${found.length || ""}</small></h2>
    ${found.length === 0 && html`<p class="empty">${t("programs.empty")}</p>`}
    ${found.length > LONG && html`<input type="search" class="list-filter" placeholder=${t("console.filter")} aria-label=${t("console.filter")} data-name="program-filter"
      value=${filter} onInput=${(/** @type {any} */ event) => setFilter(event.target.value)} />`}
    <ul class="program-list">${found.filter((one) => !needle || one.name.toLowerCase().includes(needle)).slice(0, MOST).map((one) => html`<li key=${one.id}>
      <a href=${to("programs", one.id)} aria-current=${one.id === route.value.id ? "true" : undefined}>
        <b>${one.name}</b><small>${`${count("lines", one.lines)}, ${size(one.bytes)}`} · ${dateTime(one.created_at)}</small></a></li>`)}</ul>
  </section>`;
}
