// What the page knows, and how each message of the daemon changes it. Pure: no page, no socket, no clock.
// The rule: what did not change keeps its identity, so that only what changed is drawn again.

/**
 * @typedef {import("../types.js").World} World
 * @typedef {import("../types.js").Message} Message
 * @typedef {import("../types.js").Job} Job
 * @typedef {import("../types.js").Machine} Machine
 */

const LOG_LINES = 200;
const JOBS_KEPT = 300; // of those that have ended, the oldest go first
export const ENDED = new Set(["completed", "failed", "cancelled"]);
/** At most one job of a machine is in one of these. */
export const ACTIVE = new Set(["checking", "running", "paused", "waiting", "interrupted"]);
/** The job owns the machine. */
export const MOVING = new Set(["checking", "running", "paused", "waiting"]);

/** @type {World} */
export const NOTHING = { order: [], machines: {}, jobs: {}, queues: {}, log: [], programsChanged: 0, problem: null };

/**
 * @param {World} world
 * @param {Message} message
 * @returns {World}
 */
export function reduce(world, message) {
  const change = CHANGES[message.type];
  return change ? change(world, message) : world;
}

/** @type {Record<string, (world: World, message: Message) => World>} */
const CHANGES = {
  hello: (world, { data }) => ({
    ...world,
    order: data.machines.map((/** @type {Machine} */ machine) => machine.name),
    machines: Object.fromEntries(data.machines.map((/** @type {Machine} */ machine) => [machine.name, machine])),
    jobs: Object.fromEntries(data.jobs.map((/** @type {Job} */ job) => [job.id, job])),
    queues: data.queues ?? {},
    programsChanged: world.programsChanged + 1,
    problem: data.problem?.detail ?? null,
  }),
  state: (world, { machine, data }) => {
    const known = machine === null ? undefined : world.machines[machine];
    if (!known) return world;
    const { link, ...state } = data;
    return withMachine(world, { ...known, state, link: link ?? known.link });
  },
  job: (world, { data }) => withJob(world, data),
  queue: (world, { machine, data }) =>
    machine === null ? world : { ...world, queues: { ...world.queues, [machine]: data.jobs } },
  program: (world) => ({ ...world, programsChanged: world.programsChanged + 1 }),
  log: (world, message) => withLog(world, message, message.data.level ?? "info", message.data.message ?? ""),
  alarm: (world, message) => {
    const { alarm } = message.data;
    return alarm ? withLog(world, message, "error", `${alarm.axis ? `${alarm.axis.toUpperCase()}: ` : ""}${alarm.message}`) : world;
  },
};

/** @param {World} world @param {Machine} machine @returns {World} */
export function withMachine(world, machine) {
  return { ...world, machines: { ...world.machines, [machine.name]: machine } };
}

/** @param {World} world @param {Job} job @returns {World} */
export function withJob(world, job) {
  if (job.id === undefined) return world;
  const jobs = { ...world.jobs, [job.id]: job };
  const ended = Object.values(jobs).filter((one) => ENDED.has(one.status));
  if (ended.length > JOBS_KEPT) delete jobs[Math.min(...ended.map((one) => one.id))];
  return { ...world, jobs };
}

/** @param {World} world @param {Message} message @param {string} level @param {string} text @returns {World} */
function withLog(world, message, level, text) {
  const line = { at: message.at, machine: message.machine, level, text };
  return { ...world, log: [...world.log.slice(1 - LOG_LINES), line] };
}

/**
 * The job that has the machine, or waits for a decision on it.
 * @param {World} world @param {string} machine @returns {Job | null}
 */
export function activeJob(world, machine) {
  return Object.values(world.jobs).find((job) => job.machine === machine && ACTIVE.has(job.status)) ?? null;
}

/**
 * What is to be read from three metres: the state of the machine, or of its link.
 * @param {Machine} machine @param {Job | null} job
 */
export function shownStatus(machine, job) {
  if (machine.link !== "connected") return machine.link === "connecting" ? "connecting" : "offline";
  const { status } = machine.state;
  if (status !== "idle" && status !== "run") return status;
  if (job?.status === "paused" || (job?.status === "checking" && job.hold)) return "hold";
  if (job?.status === "waiting") return "tool";
  if (job?.status === "interrupted") return "interrupted";
  if (job?.status === "running" || job?.status === "checking") return "run";
  return status;
}
