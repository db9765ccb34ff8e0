// One job: how it stands, what happened, what is in its journal, and what can be done with it now.
// The rule: lines that are certain and lines in doubt are never mixed up.

import { html, useEffect, useState } from "../lib/ui.js";
import { dateTime, t } from "../lib/i18n.js";
import { clock, remaining } from "../lib/format.js";
import { go, to } from "../lib/router.js";
import { get } from "../net/http.js";
import { onJob } from "../state/actions.js";
import { ENDED } from "../state/reduce.js";
import { jobs, learnJob, live, role, world } from "../state/store.js";
import { whyNot } from "../state/reasons.js";
import { Button } from "../parts/button.js";
import { heldBecause, heldDetail } from "./held.js";
import { Journal } from "./journal.js";
import { Recover } from "./recover.js";

/** @param {{id: number}} props */
export function JobDetails({ id }) {
  const [gone, setGone] = useState(false);
  const job = jobs.value[id];
  useEffect(() => {
    if (!job && live.value) get(`/jobs/${id}`).then(learnJob, () => setGone(true));
  }, [id, live.value]);
  if (!job) return html`<p class="empty">${t(gone ? "job.gone" : "loading")}</p>`;
  return html`<div class="grid details-grid" data-name="job" data-status=${job.status}>
    <section class="panel">
      <p class="back"><a href=${to("jobs")}>← ${t("jobs.title")}</a></p>
      <header><h2>${t("job.title", { id })} <small>${job.program_name}</small></h2>
        <span class=${`tag j-${job.status}`}>${t(`job.status.${job.status}`)}</span></header>
      ${job.error && html`<${Trouble} error=${job.error} />`}
      <${Facts} job=${job} />
      <${Actions} job=${job} />
    </section>
    ${job.status === "interrupted" && html`<${Recover} job=${job} />`}
    <${Journal} key=${id} job=${job} />
  </div>`;
}

/** @param {{error: NonNullable<import("../types.js").Job["error"]>}} props */
function Trouble({ error }) {
  return html`<p class="problem" role="note"><b>${error.message}</b>
    ${error.line_from !== null && html`<span>${t("job.doubt", { from: error.line_from, to: error.line_to ?? error.line_from })}</span>`}</p>`;
}

/** @param {{job: import("../types.js").Job}} props */
function Facts({ job }) {
  const { progress } = job;
  const left = ENDED.has(job.status) ? null : remaining(progress);
  return html`<dl class="facts">
    <div><dt>${t("job.machine")}</dt><dd>${job.machine}</dd></div>
    <div><dt>${t("job.certain")}</dt><dd data-name="certain">${t("band.lines", { line: progress.line, lines: progress.lines })}</dd></div>
    ${(job.start_line > 1 || job.end_line < progress.lines) && html`<div><dt>${t("job.range")}</dt><dd>${job.start_line} – ${job.end_line}</dd></div>`}
    ${progress.seconds_elapsed !== null && html`<div><dt>${t("job.elapsed")}</dt><dd>${clock(progress.seconds_elapsed)}</dd></div>`}
    ${left && html`<div><dt>${t("job.left")}</dt><dd>${left}</dd></div>`}
    <div><dt>${t("job.created")}</dt><dd>${dateTime(job.created_at)}</dd></div>
    ${job.started_at && html`<div><dt>${t("job.started")}</dt><dd>${dateTime(job.started_at)}</dd></div>`}
    ${job.ended_at && html`<div><dt>${t("job.ended")}</dt><dd>${dateTime(job.ended_at)}</dd></div>`}
    ${job.mode === "check" && html`<div><dt>${t("program.mode")}</dt><dd>${t("program.mode.check")}</dd></div>`}
    ${job.on_error && html`<div><dt>${t("program.on_error")}</dt><dd>${t(`program.on_error.${job.on_error}`)}</dd></div>`}
    ${job.rerun_of !== null && html`<div><dt>${t("job.rerun_of")}</dt><dd><a href=${to("jobs", job.rerun_of)}>${job.rerun_of}</a></dd></div>`}
    ${heldBecause(job) && html`<div class="whole" data-name="hold-reason"><dt>${t("queue.held")}</dt><dd>${heldBecause(job)}${heldDetail(job) && html` <small>${heldDetail(job)}</small>`}</dd></div>`}
    ${job.note && html`<div class="whole"><dt>${t("job.note")}</dt><dd>${job.note}</dd></div>`}
  </dl>`;
}

/** @param {{job: import("../types.js").Job}} props */
function Actions({ job }) {
  const now = { machine: world.value.machines[job.machine] ?? null, job, queue: [], role: role.value, live: live.value };
  const ended = ENDED.has(job.status);
  const operate = whyNot("operate", now);
  return html`<div class="row">
    <a class="button" href=${to("programs", job.program)}><span class="label">${t("job.program")}</span></a>
    ${job.status === "queued" && html`<${Button} icon="play" label=${t("queue.release")} reason=${operate}
      onPress=${() => onJob(job.id, "resume")} />`}
    ${!ended && job.status !== "interrupted" && job.status !== "queued" && html`
      <${Button} icon="pause" label=${t("control.pause")} reason=${whyNot("pause", now)}
        onPress=${() => onJob(job.id, "pause")} />
      <${Button} icon="run" label=${t("control.resume")} reason=${whyNot("resume", now)}
        onPress=${() => onJob(job.id, "resume")} />`}
    ${!ended && html`<${Button} name="cancel" kind="end" icon="stop" label=${t("job.cancel")} reason=${operate}
      onPress=${() => onJob(job.id, "cancel")} />`}
    ${ended && html`<${Button} name="rerun" icon="reset" label=${t("job.rerun")} reason=${operate}
      onPress=${async () => { const made = await onJob(job.id, "rerun"); go(to("jobs", made.id)); }} />`}
    <a class="button" href=${`/api/v1/jobs/${job.id}/report`} download=${`job-${job.id}.json`} data-name="json"><span
      class="label">${t("job.report")}</span></a>
  </div>`;
}
