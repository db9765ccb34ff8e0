// A held jog (web/machine/jogger.js): how often it is repeated, and everything that ends it.
import assert from "node:assert/strict";
import { mock, test } from "node:test";
import { Jogger } from "./web/machine/jogger.js";

const ALLOWED_MS = 200; // api.md: a held jog ends by itself so long after the last word

const pass = (ms) => { for (let at = 0; at < ms; at += 10) mock.timers.tick(10); };

function story(tell) {
  return () => {
    mock.timers.enable({ apis: ["setInterval", "Date"] });
    try {
      const sent = [], refusals = [];
      const wire = { answer() {} };
      const jogger = new Jogger({ send: (message, answered) => { sent.push({ ...message, at: Date.now() }); wire.answer = answered; } });
      tell(jogger, sent, wire, refusals, (problem) => refusals.push(problem));
    } finally {
      mock.timers.reset();
    }
  };
}

test("it is said at once and again in good time, and ended with a word", story((jogger, sent, wire, refusals, refused) => {
  jogger.hold("mill", { x: -1 }, 600, refused);
  pass(1000);
  jogger.release();
  pass(1000);
  const jogs = sent.filter((message) => message.type === "jog");
  assert.deepEqual({ ...jogs[0], at: 0 }, { type: "jog", machine: "mill", x: -1, feed: 600, hold: true, at: 0 });
  assert.ok(jogs.slice(1).every((one, index) => one.at - jogs[index].at < ALLOWED_MS / 2 + 1));
  assert.equal(sent.at(-1).type, "jog_stop");
  assert.equal(sent.filter((message) => message.type === "jog_stop").length, 1);
  assert.ok(sent.at(-1).at <= 1000, "nothing after the finger is up");
}));

test("a release without a jog says nothing", story((jogger, sent) => {
  jogger.release();
  jogger.release();
  assert.deepEqual(sent, []);
}));

test("a refusal ends it and is told once", story((jogger, sent, wire, refusals, refused) => {
  jogger.hold("mill", { y: 1 }, 600, refused);
  const first = wire.answer;
  pass(100);
  const refusal = { ok: false, error: { detail: "router is in alarm" } };
  for (const answer of [first, wire.answer]) answer(refusal); // both words were under way
  pass(1000);
  assert.deepEqual(refusals, ["router is in alarm"]);
  assert.deepEqual(sent.map((message) => message.type), ["jog", "jog", "jog_stop"]);
}));

test("another direction ends the one before", story((jogger, sent, wire, refusals, refused) => {
  jogger.hold("mill", { x: 1 }, 600, refused);
  jogger.hold("mill", { y: 1 }, 600, refused);
  assert.deepEqual(sent.map((message) => message.type), ["jog", "jog_stop", "jog"]);
  pass(500);
  assert.ok(sent.slice(2).every((message) => message.y === 1 && message.x === undefined));
  jogger.release();
}));
