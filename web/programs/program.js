// One program: what the check says for the chosen machine, its source, and the buttons that make a job of it.
// The rule: warnings are read before they are overruled; errors cannot be.

import { html, signal, useEffect, useState } from "../lib/ui.js";
import { count, t } from "../lib/i18n.js";
import { size } from "../lib/format.js";
import { go, route, to } from "../lib/router.js";
import { get, request } from "../net/http.js";
import { attempt, queueJob } from "../state/actions.js";
import { against, chosen, job, live } from "../state/store.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { PreviewPanel } from "../preview/panel.js";
import { Options } from "./options.js";
import { Findings, Reach, Report } from "./report.js";
import { Source } from "./source.js";

const CHECK_MS = 600_000; // a very long program takes its time

/** @param {{id: string}} props */
export function ProgramView({ id }) {
  const [program, setProgram] = useState(/** @type {import("../types.js").Program | null} */ (null));
  const [report, setReport] = useState(/** @type {any} */ (null));
  const [problem, setProblem] = useState("");
  const [line] = useState(() => signal(Number(route.peek().query.get("line")) || 0));
  const machine = chosen.value;
  useEffect(() => {
    if (!live.value) return undefined;
    const leaving = new AbortController();
    const ask = async () => {
      setProgram(await get(`/programs/${id}`));
      setReport(await get(`/programs/${id}/check?machine=${machine}`, { withinMs: CHECK_MS, signal: leaving.signal }));
    };
    ask().catch((error) => { if (!leaving.signal.aborted) setProblem(error.message); });
    return () => leaving.abort();
  }, [id, machine, live.value]);
  if (problem && !program) return html`<p class="problem">${problem}</p>`;
  if (!program) return html`<p class="empty">${t("loading")}</p>`;
  return html`<div class="column program">
    <section class="panel" data-name="program">
      <p class="back"><a href=${to("programs")}>← ${t("programs.title")}</a></p>
      <header><h2>${program.name} <small>${`${count("lines", program.lines)}, ${size(program.bytes)}`}</small></h2></header>
      <${Starting} program=${program} report=${report} />
      ${problem && html`<p class="problem">${problem}</p>`}
      <${Report} report=${report} onLine=${(/** @type {number} */ at) => { line.value = 0; line.value = at; }} />
    </section>
    <${PreviewPanel} program=${id} />
    <${Source} program=${program} findings=${report} line=${line} job=${job.value?.program === id ? job.value : null} />
  </div>`;
}

/** @param {{program: import("../types.js").Program, report: any}} props */
function Starting({ program, report }) {
  const [asking, setAsking] = useState(/** @type {boolean | null} */ (null)); // whether on hold; null: nothing is asked
  const [deleting, setDeleting] = useState(false);
  const [wish, setWish] = useState(/** @type {import("./options.js").Wish} */ ({ hold: true }));
  const refused = report?.errors.length ? "reason.check_errors" : null;
  const busy = against("start");
  // That the queue is empty is no reason against the first job.
  const start = refused ?? (busy === "reason.queue_empty" ? null : busy);
  async function queue(/** @type {boolean} */ hold, /** @type {boolean} */ force) {
    const made = await queueJob(program.id, { ...wish, note: wish.note?.trim() || undefined, hold, force });
    go(hold ? to("jobs") : to("machine"));
    return made;
  }
  const press = (/** @type {boolean} */ hold) => (report === null || report.warnings.length ? setAsking(hold) : queue(hold, false));
  return html`<div class="row">
    <${Button} name="run" kind="go" icon="play" label=${t(wish.mode ? "program.run_check" : "program.run")} reason=${start} onPress=${() => press(false)} />
    <${Button} name="enqueue" icon="list" label=${t(wish.hold ? "program.queue" : "program.queue_ready")}
      reason=${refused ?? against("operate")} onPress=${() => press(wish.hold)} />
    <${Button} name="delete" icon="trash" label=${t("program.delete")} reason=${against("operate")}
      onPress=${() => setDeleting(true)} />
    <${Options} lines=${program.lines} wish=${wish} onWish=${setWish} />
    ${deleting && html`<${AskDelete} program=${program} onClose=${() => setDeleting(false)} />`}
    ${asking !== null && html`<${Dialog} name="warnings" title=${t("program.warnings_title")} icon="alarm" kind="warn" onClose=${() => setAsking(null)}>
      <p>${t(report === null ? "program.unchecked" : "program.warnings_text")}</p>
      ${report && html`<${Reach} bounds=${report.bounds} /><${Findings} list=${report.warnings} kind="warnings" />`}
      <div class="row end"><button type="button" class="button" onClick=${() => setAsking(null)}>${t("dialog.cancel")}</button>
        <${Button} name="force" kind="primary" label=${t(asking ? "program.force_queue" : "program.force_run")}
          onPress=${async () => { setAsking(null); await attempt(() => queue(asking, true)); }} /></div>
    <//>`}
  </div>`;
}

/** @param {{program: import("../types.js").Program, onClose: () => void}} props */
function AskDelete({ program, onClose }) {
  return html`<${Dialog} name="ask-delete" title=${t("program.delete_ask", { name: program.name })} icon="trash" onClose=${onClose}>
    <div class="row end"><button type="button" class="button" onClick=${onClose}>${t("dialog.cancel")}</button>
      <${Button} name="delete-yes" kind="end" icon="trash" label=${t("program.delete")} onPress=${async () => {
        onClose();
        await request("DELETE", `/programs/${program.id}`);
        go(to("programs"));
      }} /></div>
  <//>`;
}
