// The jobs: the queue, and everything that ever ran, with a filter. One job is details.js.
// The rule: what the daemon tells by itself is newer than what was asked for.

import { html, useEffect, useState } from "../lib/ui.js";
import { dateTime, t } from "../lib/i18n.js";
import { clock } from "../lib/format.js";
import { go, route, to } from "../lib/router.js";
import { get } from "../net/http.js";
import { attempt } from "../state/actions.js";
import { chosen, jobs, live } from "../state/store.js";
import { JobDetails } from "./details.js";
import { Radios } from "../parts/radios.js";
import { QueuePanel } from "./queue.js";

const PAGE = 50;
/** @type {Record<string, string>} */
const FILTERS = {
  all: "", open: "queued,checking,running,paused,waiting,interrupted", completed: "completed", failed: "failed,interrupted", cancelled: "cancelled",
};

export function JobsPage() {
  const { id } = route.value;
  if (id) return html`<${JobDetails} key=${id} id=${Number(id)} />`;
  return html`<div class="grid jobs-grid"><${QueuePanel} /><${History} /></div>`;
}

function History() {
  const filter = route.value.query.get("filter") ?? "all";
  const wanted = FILTERS[filter] ?? "";
  const machine = chosen.value;
  const [asked, setAsked] = useState(/** @type {import("../types.js").Job[]} */ ([]));
  const [more, setMore] = useState(false);
  async function load(/** @type {number | null} */ before) {
    const query = new URLSearchParams({ limit: String(PAGE), ...(wanted && { status: wanted }), ...(machine && { machine }) });
    if (before !== null) query.set("before", String(before));
    const rows = await attempt(() => get(`/jobs?${query}`));
    if (!rows) return;
    setAsked((old) => (before === null ? rows : [...old, ...rows]));
    setMore(rows.length === PAGE);
  }
  useEffect(() => { if (live.value) load(null); }, [wanted, machine, live.value]);
  const rows = merged(asked, wanted, machine);
  return html`<section class="panel history" aria-label=${t("jobs.title")}>
    <header><h2>${t("jobs.title")}</h2>
      <${Radios} label=${t("jobs.filter")} of=${Object.keys(FILTERS)} value=${filter}
        text=${(/** @type {string} */ one) => t(`jobs.filter.${one}`)} mark=${(/** @type {string} */ one) => ({ "data-filter": one })}
        onValue=${(/** @type {string} */ one) => go(to("jobs", null, { filter: one }))} /></header>
    ${rows.length === 0 ? html`<p class="empty">${t("jobs.none")}</p>` : html`<table>
      <thead><tr><th>${t("jobs.number")}</th><th>${t("jobs.program")}</th><th>${t("jobs.status")}</th><th>${t("jobs.lines")}</th>
        <th class="wide">${t("jobs.began")}</th><th class="wide">${t("jobs.took")}</th></tr></thead>
      <tbody>${rows.map((job) => html`<${Row} key=${job.id} job=${job} />`)}</tbody></table>`}
    ${more && html`<button type="button" class="button" onClick=${() => load(Math.min(...asked.map((job) => job.id)))}>${t("jobs.more")}</button>`}
  </section>`;
}

/** @param {import("../types.js").Job[]} asked @param {string} wanted @param {string | null} machine */
function merged(asked, wanted, machine) {
  const statuses = wanted ? wanted.split(",") : null;
  const lowest = asked.length ? Math.min(...asked.map((job) => job.id)) : 0;
  const told = Object.values(jobs.value).filter((job) => job.id > lowest);
  const all = new Map([...asked, ...told].map((job) => [job.id, jobs.value[job.id] ?? job]));
  return [...all.values()]
    .filter((job) => (!machine || job.machine === machine) && (!statuses || statuses.includes(job.status)))
    .sort((a, b) => b.id - a.id);
}

/** @param {{job: import("../types.js").Job}} props */
function Row({ job }) {
  const { line, lines, seconds_elapsed: elapsed } = job.progress;
  return html`<tr data-job=${job.id} data-status=${job.status} onClick=${() => go(to("jobs", job.id))}>
    <td>${job.id}</td><td class="name"><a href=${to("jobs", job.id)}>${job.program_name}</a></td>
    <td><span class=${`tag j-${job.status}`}>${t(`job.status.${job.status}`)}</span></td>
    <td class="figure">${job.status === "completed" ? lines : `${line} / ${lines}`}</td>
    <td class="wide">${dateTime(job.started_at ?? job.created_at)}</td>
    <td class="wide figure">${elapsed === null ? "–" : clock(elapsed)}</td></tr>`;
}
