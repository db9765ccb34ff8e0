// The page's connection to its daemon: the one Connection, wired to this address. Without any library, so that the
// e-stop works even where the rest of the page does not.
// The rule: one connection a page; who wants to hear something listens here.

import { CLIENT } from "./client.js";
import { API, get } from "./http.js";
import { Connection } from "./socket.js";

const TOPICS = ["state", "job", "queue", "alarm", "tool", "io", "program", "log"];
const STATES_A_SECOND = "15";

/** @type {Set<(message: any) => void>} */
const listeners = new Set();
/** @type {Set<(status: import("./socket.js").Status) => void>} */
const watchers = new Set();
let consoleWanted = false;

const topics = () => (consoleWanted ? [...TOPICS, "console"] : TOPICS);

export const daemon = new Connection({
  make: (since) => {
    const address = new URL(`${API}/events`, location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.searchParams.set("topics", topics().join(","));
    address.searchParams.set("rate", STATES_A_SECOND);
    address.searchParams.set("client", CLIENT);
    if (since !== null) address.searchParams.set("since", String(since));
    return new WebSocket(address);
  },
  mayEnter: async () => (await get("/session", { withinMs: 3000 })).role !== "public",
  onMessage: (message) => listeners.forEach((listen) => listen(message)),
  onStatus: (status) => watchers.forEach((watch) => watch(status)),
});

/** Returns how to stop listening. @param {(message: any) => void} listen @returns {() => void} */
export function onMessage(listen) {
  listeners.add(listen);
  return () => { listeners.delete(listen); };
}
/** @param {(status: import("./socket.js").Status) => void} watch */
export const onStatus = (watch) => watchers.add(watch);

/** Console messages come only while somebody looks at them. @param {boolean} wanted */
export function wantConsole(wanted) {
  if (wanted === consoleWanted) return;
  consoleWanted = wanted;
  daemon.send({ type: "subscribe", topics: topics() }, () => {});
}
