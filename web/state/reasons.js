// Why something cannot be done now. Pure: the state in, the key of a sentence out, or null where nothing stands against it.
// Not the daemon's own checks, which decide; these only spare people the attempt. The rule: a control is never disabled
// without one of these reasons beside it.

import { MOVING } from "./reduce.js";

/**
 * @typedef {{
 *   machine: import("../types.js").Machine | null,
 *   job: import("../types.js").Job | null,
 *   queue: import("../types.js").Waiting[],
 *   role: string,
 *   live: boolean,
 *   client?: string,
 * }} Situation
 * @typedef {(now: Situation) => string | null} Need
 */

/** @type {Need} */
const connected = ({ machine }) => (machine?.link === "connected" ? null : "reason.not_connected");
/** @type {Need} */
const noAlarm = ({ machine }) => (machine?.state.status === "alarm" ? "reason.alarm" : null);
/** @type {Need} */
const noJob = ({ job }) => (job && MOVING.has(job.status) ? "reason.job" : null);
/** Not `run`: that is what a jog or a block by hand looks like, and the next one may be asked for meanwhile. @type {Need} */
const free = ({ machine }) =>
  machine && ["home", "hold", "door"].includes(machine.state.status) ? `reason.${machine.state.status}` : null;
/** @type {Need} */
const standing = ({ machine }) => (machine?.state.status === "run" ? "reason.run" : null);
/** @type {Need} */
const inAlarm = ({ machine }) => (machine?.state.status === "alarm" ? null : "reason.no_alarm");
/** A controller with a real-time lane can be held, let go and stopped without a job too. @param {Situation} now */
const atOnce = ({ machine }) => machine?.protocol === "grbl";
/** @param {Situation} now @param {string[]} statuses */
const stands = ({ machine, job }, ...statuses) => machine !== null && !(job && MOVING.has(job.status)) && statuses.includes(machine.state.status);
/** While its program is read a job can be held already, and let go again. @param {Situation} now @param {boolean} hold */
const reading = ({ job }, hold) => job?.status === "checking" && job.hold === hold;
/** @type {Need} */
const runs = (now) => (now.job?.status === "paused" || reading(now, true) ? "reason.hold" : runsAtAll(now));
/** @type {Need} */
const runsAtAll = (now) =>
  reading(now, false) || now.job?.status === "running" || now.job?.status === "waiting" || (atOnce(now) && stands(now, "run", "jog")) ? null : "reason.nothing_runs";
/** @type {Need} */
const paused = (now) => (now.job?.status === "paused" || reading(now, true) || (atOnce(now) && stands(now, "hold", "door")) ? null : "reason.nothing_paused");
/** @type {Need} */
const notCancelling = ({ job }) => (job?.cancelling ? "reason.stopping" : null);
/** @type {Need} */
const anyJob = (now) =>
  now.job || stands(now, "run") || (atOnce(now) && stands(now, "jog", "hold", "home", "door")) ? null : "reason.nothing_runs";
/** A Grbl that was just switched on is in alarm until it is homed. @type {Need} */
const noAlarmButGrbl = (now) => (atOnce(now) ? null : noAlarm(now));
/** Its reset goes out at once, in the middle of a job too. @type {Need} */
const noJobButGrbl = (now) => (atOnce(now) ? null : noJob(now));
/** @type {Need} */
const moving = (now) => (now.job || stands(now, "run", "jog", "hold", "home") ? null : "reason.nothing_runs");
/** @type {Need} */
const admin = ({ role }) => (role === "admin" ? null : "reason.admin_only");
/** Another one moves it by hand. @type {Need} */
const ours = ({ machine, client }) => {
  const holder = machine?.state.control;
  return holder && holder.client !== client ? "reason.control" : null;
};
/** @type {Need} */
const decided = ({ job }) => (job?.status === "interrupted" ? "reason.interrupted" : null);
/** @type {Need} */
const something = ({ queue }) => (queue.length ? null : "reason.queue_empty");

/** @type {Record<string, Need[]>} */
const NEEDS = {
  connect: [({ machine }) => (machine?.link === "disconnected" ? null : "reason.connected")],
  disconnect: [({ machine }) => (machine?.link === "disconnected" ? "reason.not_connected" : null), noJob],
  start: [connected, noAlarm, noJob, decided, something],
  pause: [runs, notCancelling],
  resume: [paused, connected, noAlarm],
  stop: [anyJob, notCancelling],
  home: [connected, noAlarmButGrbl, noJob, free, ours, standing],
  unlock: [connected, inAlarm, noJob],
  reset: [connected, noJobButGrbl],
  jog: [connected, noAlarm, noJob, free, ours],
  by_hand: [connected, noAlarm, noJob, free, ours],
  overrides: [connected],
  door: [connected, moving],
  settings: [connected, noAlarm, noJob, free, standing],
  change_settings: [admin, connected, noAlarm, noJob, free, standing],
  sd: [connected, noAlarm, noJob, free, standing],
  read: [connected, noAlarm, noJob, free, standing],
  confirm: [connected, noAlarm],
  operate: [],
};

/** What only asks a controller for something may be done by whoever only looks, too. */
const FOR_ALL = new Set(["read"]);

/**
 * Why `action` cannot be done now, as a key of i18n; null when it can.
 * @param {string} action
 * @param {Situation} now
 */
export function whyNot(action, now) {
  if (!now.live) return "reason.no_daemon";
  if (!FOR_ALL.has(action) && (now.role === "viewer" || now.role === "public")) return "reason.read_only";
  for (const need of NEEDS[action]) {
    const reason = need(now);
    if (reason) return reason;
  }
  return null;
}
