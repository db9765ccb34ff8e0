// Keeps what the states of the machines say, from the moment the page is opened. Not the drawing.
// The rule: in memory, bounded (ring.js), by the daemon's clock; a lost daemon is a gap.

import { onMessage, onStatus } from "../net/daemon.js";
import { Ring, sampleOf } from "./ring.js";

/** @type {Map<string, Ring>} */
const rings = new Map();

/** @param {string} machine */
export function ringOf(machine) {
  const found = rings.get(machine) ?? new Ring();
  rings.set(machine, found);
  return found;
}

onMessage((message) => {
  const at = Date.parse(message.at) / 1000;
  if (message.type === "state" && message.machine !== null) ringOf(message.machine).push(at, sampleOf(message.data));
  if (message.type !== "hello") return;
  for (const { name, link, state } of message.data.machines) ringOf(name).push(at, sampleOf({ ...state, link }));
});

onStatus((status) => {
  if (status === "live") return;
  for (const ring of rings.values()) if (ring.last !== null) ring.push(ring.last + 0.001, {});
});
