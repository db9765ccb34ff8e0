// What people ask of the daemon, one function each; all go through `attempt`, which tells what was refused.
// The rule: nothing is believed done until the daemon says so; the page waits for its messages.

import { ApiError, post, request } from "../net/http.js";
import { daemon } from "../net/daemon.js";
import { signal } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { notify } from "../parts/notices.js";
import { chosen, learnJob } from "./store.js";

const WITHIN_S = 3600; // blocks by hand answer when they are executed

/** Who moved the machine by hand when something was refused because of it. @type {import("../vendor/signals.js").Signal<import("../types.js").Holder | null>} */
export const refusedBy = signal(null);

/**
 * Do it, and show why it was refused. Returns what it gave, undefined when it failed.
 * @template T @param {() => T | Promise<T>} what @returns {Promise<T | undefined>}
 */
export async function attempt(what) {
  try {
    return await what();
  } catch (error) {
    if (error instanceof ApiError && error.code === "control_held" && error.body.holder) refusedBy.value = error.body.holder;
    else notify(said(error));
    if (error instanceof ApiError && error.status === 401) daemon.start(); // revoked, or its time is over
    return undefined;
  }
}

/** @param {unknown} error */
function said(error) {
  if (error instanceof ApiError && error.code === "unreachable") return t("lost.request");
  return error instanceof Error ? error.message : String(error);
}

const here = () => `/machines/${encodeURIComponent(chosen.value ?? "")}`;

/** @param {string} verb connect, home, unlock, pause ... */
export const verb = (verb) => post(`${here()}/${verb}`);

/** @param {string} what an address under the machine @param {any} body */
export const onMachine = (what, body) => post(`${here()}/${what}`, body);

/**
 * Blocks by hand, one after the other. Throws when the controller refuses one.
 * @param {string[]} blocks
 */
export async function run(blocks) {
  const { results } = await post(`${here()}/commands`, { blocks }, { withinMs: WITHIN_S * 1000 });
  const bad = results.find((/** @type {{ok: boolean}} */ one) => !one.ok);
  if (bad) throw new Error(`${bad.block}: ${bad.error?.message ?? ""}`);
  return results;
}

/** @param {Record<string, number>} way mm @param {number} feed mm/min */
export const jog = (way, feed) => post(`${here()}/jog`, { ...way, feed });

/** @param {Record<string, number>} percent */
export const override = (percent) => request("PATCH", `${here()}/overrides`, percent);

/** @param {number} id @param {string} verb pause, resume, cancel, rerun @param {any} [body] */
export async function onJob(id, verb, body) {
  const answer = await post(`/jobs/${id}/${verb}`, body);
  if (answer?.id !== undefined && answer.progress) learnJob(answer);
  return answer;
}

const CHECKED_MS = 120_000; // a wait that a proxy would not break off for us

/**
 * Queue a program on the chosen machine.
 * @param {string} program @param {{hold?: boolean, force?: boolean, start_line?: number, end_line?: number, note?: string, mode?: string, on_error?: string}} options
 */
export async function queueJob(program, options) {
  const body = { program, machine: chosen.value, ...options };
  const headers = { "Idempotency-Key": crypto.randomUUID?.() ?? `${Date.now()}-${Math.random()}` };
  for (;;) {
    const began = Date.now();
    try {
      const answer = await post("/jobs", body, { headers, withinMs: CHECKED_MS });
      learnJob(answer);
      for (const { message } of answer.warnings ?? []) notify(message);
      return answer;
    } catch (error) {
      // The check of a very large program goes on at the daemon, and who asks again joins it.
      const checking = /** @type {any} */ (error).code === "unreachable" && Date.now() - began >= CHECKED_MS;
      if (!checking) throw error;
    }
  }
}
