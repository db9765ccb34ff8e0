// The journal and the history of a job, page by page, and as files. The rule: as the daemon keeps it, nothing left out.

import { html, useEffect, useRef, useState } from "../lib/ui.js";
import { number, t, time } from "../lib/i18n.js";
import { csv } from "../lib/format.js";
import { save } from "../lib/save.js";
import { get } from "../net/http.js";
import { attempt } from "../state/actions.js";
import { MOVING } from "../state/reduce.js";
import { live } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Radios } from "../parts/radios.js";

const SHOWN = 200;
const AGAIN_MS = 2000; // while the job is at work
const PAGE = 10_000; // as many rows as the daemon answers at once
const KINDS = ["events", "batches"];
const HASH = /^[0-9a-f]{16,}$/; // tells people nothing; the files have it
const COLUMNS = {
  batches: ["seq", "wire_id", "line_from", "line_to", "blocks", "seconds", "status", "attempts", "inferred", "planned_at", "sent_at", "received_at", "ok_at"],
  events: ["id", "at", "machine", "job", "type", "data", "hash"],
};

/** All rows of a list that is answered in pages. @param {string} path @param {string} key @param {any[]} [known] that will not change */
async function all(path, key, known = []) {
  const rows = [...known];
  for (let after = rows.at(-1)?.[key] ?? 0; ; after = rows[rows.length - 1][key]) {
    const page = await get(`${path}?after=${after}`, { withinMs: 60_000 });
    rows.push(...page);
    if (page.length < PAGE) return rows;
  }
}

/** The rows of a list, and what becomes of them while the job is at work. @param {string} path @param {"events" | "batches"} kind @param {string} status */
function useRows(path, kind, status) {
  const [rows, setRows] = useState(/** @type {any[] | null} */ (null));
  const latest = useRef(/** @type {any[]} */ ([]));
  useEffect(() => setRows(null), [path]);
  useEffect(() => {
    let timer = 0, wanted = live.value;
    const key = kind === "events" ? "id" : "seq";
    const take = (/** @type {any[]} */ found) => {
      if (!wanted) return;
      setRows(latest.current = found);
      if (MOVING.has(status)) timer = setTimeout(again, AGAIN_MS);
    };
    const again = () => all(path, key, final(kind, latest.current)).then(take, () => take(latest.current));
    if (wanted) attempt(() => all(path, key)).then((found) => { if (found) take(found); });
    return () => {
      wanted = false;
      clearTimeout(timer);
    };
  }, [path, status, live.value]);
  return rows;
}

/** The first rows, those that will not change: an event never does, a batch when it has its end. @param {string} kind @param {any[]} rows */
function final(kind, rows) {
  const open = kind === "events" ? -1 : rows.findIndex((one) => one.status === "planned");
  return open < 0 ? rows : rows.slice(0, open);
}

/** @param {{job: import("../types.js").Job}} props */
export function Journal({ job }) {
  const [kind, setKind] = useState(/** @type {"events" | "batches"} */ ("events"));
  const path = `/jobs/${job.id}/${kind}`;
  const rows = useRows(path, kind, job.status);
  const name = `job-${job.id}-${kind}`;
  return html`<section class="panel journal" aria-label=${t("journal.title")}>
    <header><${Radios} label=${t("journal.title")} of=${KINDS} value=${kind} onValue=${setKind}
      text=${(/** @type {string} */ one) => t(`journal.${one}`)} mark=${(/** @type {string} */ one) => ({ "data-journal": one })} />
      ${rows && html`<div class="row">
        <${Button} name="csv" icon="save" label="CSV" onPress=${() => save(`${name}.csv`, "text/csv", csv(COLUMNS[kind], rows))} />
        <${Button} icon="save" label="JSON" onPress=${() => save(`${name}.json`, "application/json", `${JSON.stringify(rows, null, 2)}\n`)} />
      </div>`}</header>
    ${rows === null ? html`<p class="empty">${t("loading")}</p>` : rows.length === 0 ? html`<p
      class="empty">${t("journal.none")}</p>`
      : html`<div class="scroll">${kind === "events" ? html`<${Events} rows=${rows} />` : html`<${Batches} rows=${rows} />`}</div>`}
    ${rows !== null && rows.length > SHOWN && html`<p class="hint">${t("journal.cut", { shown: SHOWN, all: number(rows.length) })}</p>`}
  </section>`;
}

/** @param {{rows: any[]}} props */
function Events({ rows }) {
  return html`<table class="events"><tbody>${rows.slice(-SHOWN).reverse().map((one) => html`<tr key=${one.id}>
    <td class="figure">${time(one.at)}</td><td><b>${one.type}</b></td><td class="data">${said(one)}</td></tr>`)}</tbody></table>`;
}

/** A dump of frames is for the file. @param {any} event */
function said({ type, data }) {
  if (type === "frames") return t("journal.frames", { count: data.frames?.length ?? 0 });
  return Object.entries(data).filter(([key, value]) => value !== null && key !== "program" && !HASH.test(String(value)))
    .map(([key, value]) => `${key} ${typeof value === "object" ? JSON.stringify(value) : value}`).join(" · ");
}

/** @param {{rows: any[]}} props */
function Batches({ rows }) {
  return html`<table><thead><tr>${["id", "lines", "status", "sent", "received", "done", "attempts"].map((one) =>
    html`<th key=${one}>${t(`journal.${one}`)}</th>`)}</tr></thead>
    <tbody>${rows.slice(-SHOWN).reverse().map((one) => html`<tr key=${one.seq} class=${one.attempts > 1 ? "warn" : ""}>
      <td class="figure">${one.wire_id}</td><td class="figure">${one.line_from} – ${one.line_to}</td>
      <td>${t(`journal.status.${one.status}`)}${one.inferred ? ` (${t("journal.inferred")})` : ""}</td>
      <td>${time(one.sent_at)}</td><td>${time(one.received_at)}</td><td>${time(one.ok_at)}</td><td
        class="figure">${one.attempts || "–"}</td></tr>`)}</tbody></table>`;
}
