// The messages on the wire, kept for whoever looks: a bounded ring a machine, drawn at most once a frame.
// The rule: a chatty machine costs a bounded number of lines and one drawing a frame, never more.

import { signal } from "../lib/ui.js";
import { onMessage } from "../net/daemon.js";
import { get } from "../net/http.js";

const KEPT = 2000;

/** @typedef {{at: string, direction: string, text: string}} Line */
/** @type {Map<string, Line[]>} */
const rings = new Map();
/** Changes when there is something new to draw. */
export const version = signal(0);
let due = false;

onMessage((message) => {
  if (message.type !== "console" || message.machine === null) return;
  const ring = ringOf(message.machine);
  ring.push(message.data);
  if (ring.length > KEPT * 1.2) ring.splice(0, ring.length - KEPT);
  announce();
});

function announce() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    version.value += 1;
  });
}

/** @param {string} machine @returns {Line[]} */
export function ringOf(machine) {
  let ring = rings.get(machine);
  if (!ring) rings.set(machine, ring = []);
  return ring;
}

/** What was said before anybody looked. @param {string} machine */
export async function fill(machine) {
  const lines = await get(`/machines/${encodeURIComponent(machine)}/console?limit=500`);
  rings.set(machine, lines);
  announce();
}
