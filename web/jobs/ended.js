// Says once on every screen that a job is at its end, and how. Not the band, where the last one stays to be read.
// The rule: only for a job that this page has seen at work; what ended before is history.

import { t } from "../lib/i18n.js";
import { ring } from "../lib/sound.js";
import { onMessage } from "../net/daemon.js";
import { notify } from "../parts/notices.js";
import { MOVING } from "../state/reduce.js";

/** @type {Set<number>} */
const atWork = new Set();

onMessage(({ type, data }) => {
  if (type === "hello") for (const { id, status } of data.jobs) if (MOVING.has(status)) atWork.add(id);
  if (type !== "job" || data.id === undefined) return;
  if (MOVING.has(data.status)) atWork.add(data.id);
  else if (atWork.delete(data.id) && (data.status === "completed" || data.status === "failed")) {
    const done = data.status === "completed";
    notify(`${data.machine}: ${data.program_name}: ${t(`job.status.${data.status}`)}`, done ? "done" : "error");
    if (done) ring("done");
  }
});
