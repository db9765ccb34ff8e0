// The page's memory as signals: the world (reduce.js), the connection, who is signed in, and what is derived of them.
// The rule: the world changes by messages of the daemon alone, never because a button was pressed.

import { batch, computed, signal } from "../lib/ui.js";
import { CLIENT } from "../net/client.js";
import { daemon, onMessage, onStatus } from "../net/daemon.js";
import { get } from "../net/http.js";
import { route } from "../lib/router.js";
import { activeJob, NOTHING, reduce, shownStatus, withJob, withMachine } from "./reduce.js";
import { whyNot } from "./reasons.js";

const STATS_EVERY_MS = 4000;

/** @type {import("../vendor/signals.js").Signal<import("../types.js").World>} */
export const world = signal(NOTHING);
/** @type {import("../vendor/signals.js").Signal<import("../net/socket.js").Status>} */
export const connection = signal(daemon.status);
/** When what is shown was last true: the time of the break, null while the daemon is there. */
export const lostAt = signal(/** @type {Date | null} */ (null));
export const role = signal("public");
/** Whether there is something to sign out of. */
export const signedIn = signal(false);

/** How far this computer's clock is ahead of the daemon's. */
let aheadMs = 0;

onMessage((message) => batch(() => {
  world.value = reduce(world.peek(), message);
  if (message.type !== "hello") return;
  role.value = message.data.role ?? "viewer";
  aheadMs = Date.now() - Date.parse(message.at);
  learnActive();
}));

/** `hello` has the newest jobs; one that has stood interrupted for weeks may be older than all of them. */
function learnActive() {
  const { order: names, machines, jobs: known } = world.peek();
  const unknown = names.map((name) => machines[name].active_job).filter((id) => id !== null && !(id in known));
  for (const id of unknown) get(`/jobs/${id}`).then(learnJob, () => {});
}

/** How long ago something was by the daemon's clock. @param {string} at @returns {number} seconds */
export const secondsSince = (at) => Math.max(0, (Date.now() - aheadMs - Date.parse(at)) / 1000);

onStatus((status) => batch(() => {
  connection.value = status;
  if (status === "live") {
    lostAt.value = null;
    get("/session").then((session) => { signedIn.value = !session.open; }, () => {});
  } else {
    lostAt.value ??= new Date();
  }
}));

export const live = computed(() => connection.value === "live");
export const operator = computed(() => role.value === "operator" || role.value === "admin");

// The parts of the world by themselves: a position that changes fifteen times a second draws no list of jobs anew.
export const order = computed(() => world.value.order);
export const jobs = computed(() => world.value.jobs);
export const log = computed(() => world.value.log);
export const problem = computed(() => world.value.problem);

/** The name of the machine that is looked at: that of the address, else the first. */
export const chosen = computed(() => {
  const asked = route.value.machine;
  return asked && order.value.includes(asked) ? asked : (order.value[0] ?? null);
});
export const machine = computed(() => (chosen.value === null ? null : world.value.machines[chosen.value]));
export const job = computed(() => (chosen.value === null ? null : activeJob(world.value, chosen.value)));
/** The one that ended last, for whoever comes back to the machine. */
export const lastJob = computed(() => Object.values(jobs.value).filter((one) => one.machine === chosen.value && one.ended_at !== null)
  .reduce((/** @type {import("../types.js").Job | null} */ last, one) => (last && String(last.ended_at) > String(one.ended_at) ? last : one), null));
const NO_QUEUE = /** @type {import("../types.js").Waiting[]} */ ([]);
export const queue = computed(() => (chosen.value === null ? NO_QUEUE : (world.value.queues[chosen.value] ?? NO_QUEUE)));
export const status = computed(() => (machine.value === null ? "offline" : shownStatus(machine.value, job.value)));

/** Why something cannot be done on the chosen machine, a key of i18n, or null. @param {string} action */
export function against(action) {
  return whyNot(action, { machine: machine.value, job: job.value, queue: queue.value, role: role.value, live: live.value, client: CLIENT });
}

const NOTHING_AT_ALL = /** @type {string[]} */ ([]);
const capabilities = computed(() => machine.value?.capabilities ?? NOTHING_AT_ALL);
/** @param {string} capability */
export const can = (capability) => capabilities.value.includes(capability);

/** An answer of the API that is newer than the last message about it. @param {import("../types.js").Job} answer */
export const learnJob = (answer) => { world.value = withJob(world.peek(), answer); };

/** The link's counters are in no message: they are asked for while somebody looks. @param {string} name */
export async function learnLink(name) {
  const answer = await get(`/machines/${encodeURIComponent(name)}`);
  const known = world.peek().machines[name];
  if (!known) return;
  const { link_stats, queue_length, capabilities } = answer;
  world.value = withMachine(world.peek(), { ...known, link_stats, queue_length, capabilities });
}

/** Ask for the link's counters now and then. Returns how to stop. @param {string} name */
export function watchLink(name) {
  const ask = () => { if (live.peek() && !document.hidden) learnLink(name).catch(() => {}); };
  ask();
  const timer = setInterval(ask, STATS_EVERY_MS);
  return () => clearInterval(timer);
}

// Whoever comes back to the page, or to the network, does not want to wait for the next attempt.
const awake = () => { if (connection.peek() === "lost" && !document.hidden) daemon.start(); };
document.addEventListener("visibilitychange", awake);
addEventListener("online", awake);

// Here, where those who listen are there: what came before would be heard by nobody.
daemon.again();
