// Why something cannot be done (web/state/reasons.js).
import assert from "node:assert/strict";
import { test } from "node:test";
import { whyNot } from "./web/state/reasons.js";

const machine = (status = "idle", link = "connected") => ({ link, state: { status } });
const now = (more = {}) => ({ machine: machine(), job: null, queue: [], role: "operator", live: true, ...more });
const job = (status, more = {}) => ({ status, ...more });
const ACTIONS = ["connect", "disconnect", "start", "pause", "resume", "stop", "home", "unlock", "reset", "jog", "by_hand", "overrides", "sd", "confirm", "operate"];

test("nothing is possible without a daemon, and nothing for who only looks", () => {
  for (const action of ACTIONS) {
    assert.equal(whyNot(action, now({ live: false })), "reason.no_daemon");
    assert.equal(whyNot(action, now({ role: "viewer" })), "reason.read_only");
  }
});

test("who only looks may have a controller asked, when it can answer", () => {
  assert.equal(whyNot("read", now({ role: "viewer" })), null);
  assert.equal(whyNot("read", now({ role: "viewer", job: job("running") })), "reason.job");
  assert.equal(whyNot("read", now({ role: "viewer", live: false })), "reason.no_daemon");
});

test("what moves by hand waits for whoever has the machine, and not for oneself", () => {
  const held = { ...machine(), state: { status: "idle", control: { name: "Ann", client: "desk", since: "" } } };
  for (const action of ["jog", "by_hand", "home"]) {
    assert.equal(whyNot(action, now({ machine: held, client: "phone" })), "reason.control");
    assert.equal(whyNot(action, now({ machine: held, client: "desk" })), null);
  }
  assert.equal(whyNot("operate", now({ machine: held, client: "phone" })), null);
});

test("each state of the machine and the job has its own reason", () => {
  const cases = [
    ["jog", {}, null], ["jog", { machine: machine("run") }, null], ["jog", { machine: machine("alarm") }, "reason.alarm"],
    ["jog", { job: job("running") }, "reason.job"], ["jog", { machine: machine("idle", "connecting") }, "reason.not_connected"],
    ["jog", { job: job("interrupted") }, null], ["home", { machine: machine("run") }, "reason.run"],
    ["home", { machine: machine("door") }, "reason.door"], ["unlock", {}, "reason.no_alarm"], ["unlock", { machine: machine("alarm") }, null],
    ["start", {}, "reason.queue_empty"], ["start", { queue: [{}] }, null], ["start", { queue: [{}], job: job("paused") }, "reason.job"],
    ["start", { queue: [{}], job: job("interrupted") }, "reason.interrupted"], ["pause", {}, "reason.nothing_runs"], ["pause", { job: job("paused") }, "reason.hold"],
    ["pause", { job: job("running") }, null], ["pause", { job: job("running", { cancelling: true }) }, "reason.stopping"],
    ["pause", { job: job("checking", { hold: false }) }, null], ["pause", { job: job("checking", { hold: true }) }, "reason.hold"],
    ["resume", { job: job("checking", { hold: true }) }, null], ["resume", { job: job("checking", { hold: false }) }, "reason.nothing_paused"],
    ["resume", { job: job("running") }, "reason.nothing_paused"], ["resume", { job: job("paused") }, null],
    ["resume", { job: job("paused"), machine: machine("alarm") }, "reason.alarm"], ["stop", {}, "reason.nothing_runs"],
    ["stop", { machine: machine("run") }, null], ["stop", { job: job("paused") }, null], ["connect", {}, "reason.connected"],
    ["connect", { machine: machine("offline", "disconnected") }, null], ["disconnect", { job: job("waiting") }, "reason.job"],
    ["disconnect", { machine: machine("offline", "connecting") }, null], ["operate", { machine: machine("offline", "disconnected") }, null],
  ];
  for (const [action, more, reason] of cases) assert.equal(whyNot(action, now(more)), reason, `${action} ${JSON.stringify(more)}`);
});

test("the connection of the page to the daemon comes first", () => {
  assert.equal(whyNot("jog", now({ live: false, role: "viewer", machine: machine("alarm") })), "reason.no_daemon");
});
