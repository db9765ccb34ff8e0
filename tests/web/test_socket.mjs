// The connection (web/net/socket.js): silence, back-off, resuming; with a clock and sockets of this test.
import assert from "node:assert/strict";
import { mock, test } from "node:test";
import { BACK_OFF_MS, Connection } from "./web/net/socket.js";

class Socket extends EventTarget {
  constructor(since) {
    super();
    Object.assign(this, { since, readyState: 0, sent: [], answers: true });
  }
  send(text) {
    this.sent.push(JSON.parse(text));
    if (this.answers) this.hear({ type: "result", id: this.sent.at(-1).id, ok: true });
  }
  hear(message) {
    const event = new Event("message");
    event.data = JSON.stringify(message);
    this.dispatchEvent(event);
  }
  greet(seq) {
    this.readyState = 1;
    this.hear({ type: "hello", seq, data: {} });
  }
  close() {
    if (this.readyState === 3) return;
    this.readyState = 3;
    this.dispatchEvent(new Event("close"));
  }
}

function story(tell) {
  return async () => {
    mock.timers.enable({ apis: ["setTimeout", "setInterval", "Date"] });
    try {
      const shop = { sockets: [], statuses: [], heard: [], mayEnter: async () => true };
      const one = new Connection({
        make: (since) => { shop.sockets.push(new Socket(since)); return shop.sockets.at(-1); },
        mayEnter: () => shop.mayEnter(), onMessage: (message) => shop.heard.push(message),
        onStatus: (status) => shop.statuses.push(status), now: () => Date.now(),
      });
      shop.last = () => shop.sockets.at(-1);
      shop.pass = async (ms) => { for (let at = 0; at < ms; at += 50) { mock.timers.tick(50); await Promise.resolve(); await Promise.resolve(); } };
      await tell(one, shop);
    } finally {
      mock.timers.reset();
    }
  };
}

test("an idle daemon that answers stays live", story(async (one, shop) => {
  one.start();
  shop.last().greet(5);
  await shop.pass(60_000);
  assert.deepEqual([shop.statuses, shop.sockets.length], [["live"], 1]);
  assert.ok(shop.last().sent.every((message) => message.type === "subscribe" && !("topics" in message)));
}));

test("silence is noticed within two seconds", story(async (one, shop) => {
  one.start();
  shop.last().greet(5);
  await shop.pass(10_000);
  shop.last().answers = false;
  await shop.pass(1900);
  assert.equal(shop.statuses.at(-1), "lost");
}));

test("messages alone keep it alive: a busy daemon need not answer", story(async (one, shop) => {
  one.start();
  shop.last().greet(5);
  shop.last().answers = false;
  for (let n = 0; n < 20; n++) {
    await shop.pass(400);
    shop.last().hear({ type: "state", seq: 6 + n, machine: "mill", data: {} });
  }
  assert.deepEqual(shop.statuses, ["live"]);
}));

test("it comes back with the largest seq, and answers of the old connection are given up", story(async (one, shop) => {
  one.start();
  shop.last().greet(5);
  shop.last().hear({ type: "job", seq: 9, data: {} });
  shop.last().hear({ type: "state", seq: 7, data: {} });
  shop.last().answers = false;
  const asked = one.ask({ type: "estop" }, 60_000);
  shop.last().close();
  assert.equal(await asked, null);
  await shop.pass(BACK_OFF_MS[0]);
  assert.equal(shop.last().since, 9);
  shop.last().greet(12);
  assert.deepEqual(shop.statuses, ["live", "lost", "live"]);
}));

test("attempts become rarer up to a bound, and begin anew after a success", story(async (one, shop) => {
  one.start();
  shop.last().greet(1);
  const waits = [];
  for (let n = 0; n < 7; n++) {
    const before = shop.sockets.length, from = Date.now();
    shop.last().close();
    while (shop.sockets.length === before) await shop.pass(50);
    waits.push(Date.now() - from);
  }
  assert.deepEqual(waits, [...BACK_OFF_MS, BACK_OFF_MS.at(-1), BACK_OFF_MS.at(-1)]);
  shop.last().greet(2);
  const from = Date.now(), before = shop.sockets.length;
  shop.last().close();
  while (shop.sockets.length === before) await shop.pass(50);
  assert.equal(Date.now() - from, BACK_OFF_MS[0]);
}));

test("a daemon that wants a token is not knocked at", story(async (one, shop) => {
  shop.mayEnter = async () => false;
  one.start();
  shop.last().close();
  await shop.pass(30_000);
  assert.deepEqual([shop.statuses, shop.sockets.length], [["sign-in"], 1]);
  one.start();
  shop.last().greet(1);
  assert.equal(shop.statuses.at(-1), "live");
}));

test("an attempt that is neither taken nor refused is given up", story(async (one, shop) => {
  one.start();
  await shop.pass(5000);
  assert.ok(shop.sockets.length >= 2);
  assert.equal(shop.sockets[0].readyState, 3);
}));

test("a late word of an old socket is not heard", story(async (one, shop) => {
  one.start();
  const old = shop.last();
  old.greet(1);
  old.close();
  await shop.pass(BACK_OFF_MS[0]);
  shop.last().greet(2);
  old.hear({ type: "job", seq: 99, data: {} });
  assert.ok(!shop.heard.some((message) => message.seq === 99));
}));

test("an answer that does not come in time is null", story(async (one, shop) => {
  one.start();
  shop.last().greet(1);
  shop.last().answers = false;
  const asked = one.ask({ type: "estop" }, 300);
  await shop.pass(300);
  assert.equal(await asked, null);
  assert.equal(await new Connection({ make: () => null, onStatus() {}, onMessage() {}, mayEnter: async () => true }).ask({ type: "estop" }, 300), null);
}));
