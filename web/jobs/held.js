// Why a job waits on hold, in the reader's language. Not whether it does, nor the tag that says so.
// The rule: a code that is known is said in the page's words; what the daemon adds in its own is shown beside it, where there is room.

import { t } from "../lib/i18n.js";

/** Those of the daemon's own codes whose words say no more than the page's. */
const PLAIN = new Set(["job_ended", "restarted", "restored"]);
/** Refusals for which a job can be put on hold: its message says more. */
const REFUSED = new Set(["not_connected", "alarm_active", "machine_busy", "job_active", "wrong_state"]);

/** @typedef {{hold?: boolean | null, hold_reason?: {code: string, message: string} | null}} Held */

/** Null where it does not wait on hold, or somebody wanted it so. @param {Held} one */
const reasonOf = ({ hold, hold_reason: reason }) => (hold && reason && reason.code !== "asked" ? reason : null);

/** In a few words, null where that is plain. @param {Held} one */
export function heldBecause(one) {
  const reason = reasonOf(one);
  if (reason === null) return null;
  return PLAIN.has(reason.code) || REFUSED.has(reason.code) ? t(`held.${reason.code}`) : reason.message;
}

/** What the daemon says of it besides, null where it says nothing more. @param {Held} one */
export function heldDetail(one) {
  const reason = reasonOf(one);
  return reason !== null && REFUSED.has(reason.code) ? reason.message : null;
}
