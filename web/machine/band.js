// The band on top of every page: what the machine is doing, to be read from three metres, and the four controls of a job.
// The rule: state by colour and word and picture; progress is what is done, never what was sent.

import { html } from "../lib/ui.js";
import { clock, percent, remaining } from "../lib/format.js";
import { dateTime, t } from "../lib/i18n.js";
import { to } from "../lib/router.js";
import { onJob, verb } from "../state/actions.js";
import { against, job, lastJob, machine, queue, status } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Icon } from "../parts/icon.js";

/** @param {{large: boolean}} props */
export function StatusBand({ large }) {
  const shown = status.value;
  return html`<section class=${`band s-${shown} ${large ? "large" : ""}`} aria-label=${t("band.title")}
    data-name="band" data-status=${shown}>
    <div class="band-state">
      <${Icon} name=${shown} size=${large ? 72 : 40} />
      <div><p class="word" role="status" data-name="status">${t(`status.${shown}`)}</p>${large && html`<p
        class="detail"><${Detail} /></p>`}</div>
    </div>
    <${JobProgress} />
    <${Controls} />
  </section>`;
}

function Detail() {
  const now = machine.value;
  if (!now) return null;
  if (now.link !== "connected") return html`${t("band.offline", { port: now.port })}`;
  const { alarm } = now.state;
  if (alarm) return html`${alarm.axis ? `${alarm.axis.toUpperCase()}: ` : ""}${alarm.message}`;
  if (job.value?.error) return html`${job.value.error.message}`;
  return html`${now.name} · ${now.protocol}`;
}

function JobProgress() {
  const now = job.value;
  if (!now) return html`<${Between} />`;
  const { line, lines, seconds_elapsed: elapsed, acknowledged_lines: done } = now.progress;
  const { all, percent: part } = percent(now), left = remaining(now.progress);
  return html`<div class="band-job" data-name="band-job">
    <p class="job-name"><a href=${to("jobs", now.id)}>${now.program_name}</a><span>${t(`job.status.${now.status}`)}</span></p>
    <progress max=${all} value=${done} aria-label=${t("band.progress")}>${part} %</progress>
    <p class="job-figures"><b>${part} %</b><span data-name="done">${t("band.lines", { line, lines })}</span>
      ${elapsed !== null && html`<span>${t("band.elapsed", { time: clock(elapsed) })}</span>`}
      ${left && html`<span>${t("band.left", { time: left })}</span>`}</p>
  </div>`;
}

/** No job has the machine: how the last one ended, and which one Start would let go. */
function Between() {
  const last = lastJob.value, next = first();
  return html`<div class="band-job none" data-name="between">
    ${last ? html`<p class="job-name"><a href=${to("jobs", last.id)}>${last.program_name}</a><span>${t(`job.status.${last.status}`)} ${dateTime(last.ended_at)}</span></p>`
      : html`<p>${t("band.no_job")}</p>`}
    ${last?.status === "failed" && last.error && html`<p class="ended-badly">${last.error.message}</p>`}
    ${next && html`<p class="job-figures" data-name="next">${t("band.next", { name: next.program_name })}</p>`}
  </div>`;
}

/** The job that Start would let go: the first that waits. */
const first = () => queue.value[0];

function Controls() {
  const now = job.value;
  const title = first() && !now ? t("control.start_which", { name: first().program_name }) : undefined;
  const recover = now?.status === "interrupted";
  return html`<div class="band-controls">
    ${recover
      ? html`<a class="button primary" href=${to("jobs", now.id)} data-name="recover"><span
        class="label">${t("control.recover")}</span></a>`
      : html`<${Button} name="start" kind="go" icon="play" label=${t("control.start")} title=${title} reason=${against("start")}
          onPress=${() => onJob(first().id, "resume")} />`}
    <${Button} name="pause" icon="pause" label=${t("control.pause")} reason=${against("pause")} onPress=${() => verb("pause")} />
    <${Button} name="resume" kind="go" icon="run" label=${t("control.resume")} reason=${against("resume")}
      onPress=${() => verb("resume")} />
    <${Button} name="stop" kind="end" icon="stop" label=${t("control.stop")} reason=${against("stop")}
      onPress=${() => verb("stop")} />
  </div>`;
}
