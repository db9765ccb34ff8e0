// The emergency stop: a button of the page itself, above everything, that needs none of the rest.
// Not the machine's own emergency button, which alone cuts the power. The rule: one touch, at once, two ways: over the
// WebSocket, and over HTTP as soon as the first is not answered.

import { daemon, onMessage } from "./net/daemon.js";
import { get, post } from "./net/http.js";

const ANSWER_MS = 300;
const SHOWN_MS = 10_000;
const button = /** @type {HTMLButtonElement} */ (document.getElementById("estop"));
const result = /** @type {HTMLElement} */ (document.getElementById("estop-result"));

/** @type {string[]} */
let names = [];
let hiding = 0;
/** Words of the chosen language; these until it is there. */
export const words = {
  sent: "Emergency stop sent to every machine.",
  partly: "Emergency stop sent to {sent}. NOT STOPPED: {failed}. Press the emergency button there!",
  failed: "NOT STOPPED BY THIS BUTTON: press the emergency button at the machine!",
};

onMessage((message) => {
  if (message.type === "hello") names = message.data.machines.map((/** @type {{name: string}} */ machine) => machine.name);
});

/** @param {boolean} good @param {string} text */
function tell(good, text) {
  result.className = good ? "sent" : "failed";
  result.textContent = text;
  result.hidden = false;
  clearTimeout(hiding);
  if (good) hiding = setTimeout(() => { result.hidden = true; }, SHOWN_MS);
}

/** Returns the machines that it was sent to, and why the others did not get it. */
async function stopOverHttp() {
  const all = names.length ? names : (await get("/machines")).map((/** @type {{name: string}} */ one) => one.name);
  if (all.length === 0) throw new Error("");
  const sent = await Promise.allSettled(
    all.map((/** @type {string} */ name) => post(`/machines/${encodeURIComponent(name)}/estop`)),
  );
  const failed = sent.flatMap((one, index) => (one.status === "rejected" ? [{ name: all[index], why: one.reason.message }] : []));
  return { sent: all.filter((/** @type {string} */ name) => failed.every((one) => one.name !== name)), failed };
}

async function stop() {
  button.classList.add("pressed");
  setTimeout(() => button.classList.remove("pressed"), 400);
  try {
    const answer = await daemon.ask({ type: "estop" }, ANSWER_MS);
    const { sent, failed } = answer?.ok ? { sent: [], failed: [] } : await stopOverHttp();
    if (failed.length === 0) tell(true, words.sent);
    else if (sent.length === 0) throw new Error(failed.map(({ name, why }) => `${name}: ${why}`).join(" "));
    else tell(false, words.partly.replace("{sent}", () => sent.join(", ")).replace("{failed}", () => failed.map(({ name }) => name).join(", ")));
  } catch (error) {
    tell(false, `${words.failed} ${error instanceof Error ? error.message : ""}`);
  }
}

// The finger's way down is the stop: whoever is in a hurry slides off a button before letting go.
button.addEventListener("pointerdown", (event) => {
  if (event.button === 0) stop();
});
button.addEventListener("keydown", (event) => {
  if (event.key === "Enter" || event.key === " ") {
    event.preventDefault();
    if (!event.repeat) stop();
  }
});
// What clicks without a pointer (a screen reader, a test of a machine) has no way down.
button.addEventListener("click", (event) => {
  if (event.detail === 0) stop();
});
result.addEventListener("click", () => { result.hidden = true; });
