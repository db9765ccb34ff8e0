// What the page knows after each message (web/state/reduce.js).
import assert from "node:assert/strict";
import { test } from "node:test";
import { activeJob, ENDED, NOTHING, reduce, shownStatus, withJob } from "./web/state/reduce.js";

const state = { status: "idle", alarm: null, position: { machine: {}, work: {} } };
const machine = (name, more = {}) => ({ name, link: "connected", state, capabilities: [], ...more });
const job = (id, status, more = {}) => ({ id, status, machine: "mill", progress: { line: 0, lines: 9 }, ...more });
const say = (type, data, name = "mill", seq = 1) => ({ seq, type, machine: name, at: "2026-03-01T09:30:00.000Z", data });
const hello = say("hello", {
  machines: [machine("mill"), machine("lathe")], jobs: [job(2, "running"), job(1, "completed")],
  queues: { mill: [{ id: 3, program_name: "b.nc", hold: true }], lathe: [] }, resync: false, role: "admin",
}, null);

test("hello is the whole world, and a second one takes the place of the first", () => {
  const world = reduce(NOTHING, hello);
  assert.deepEqual(world.order, ["mill", "lathe"]);
  assert.equal(world.jobs[2].status, "running");
  assert.equal(world.queues.mill[0].id, 3);
  const again = reduce(world, say("hello", { machines: [machine("lathe")], jobs: [], queues: {} }, null));
  assert.deepEqual([again.order, again.jobs, again.queues], [["lathe"], {}, {}]);
});

test("a state changes its machine and keeps the identity of all else", () => {
  const before = reduce(NOTHING, hello);
  const after = reduce(before, say("state", { ...state, status: "run", link: "connecting" }));
  assert.equal(after.machines.mill.state.status, "run");
  assert.equal(after.machines.mill.link, "connecting");
  assert.equal("link" in after.machines.mill.state, false);
  assert.equal(after.machines.lathe, before.machines.lathe);
  assert.equal(after.jobs, before.jobs);
  assert.equal(reduce(before, say("state", state, "nobody")), before);
});

test("jobs, queues, programs and messages", () => {
  let world = reduce(NOTHING, hello);
  world = reduce(world, say("job", job(2, "paused")));
  assert.equal(activeJob(world, "mill").status, "paused");
  assert.equal(activeJob(world, "lathe"), null);
  world = reduce(world, say("queue", { jobs: [] }));
  assert.deepEqual(world.queues.mill, []);
  const programs = world.programsChanged;
  assert.equal(reduce(world, say("program", {}, null)).programsChanged, programs + 1);
  world = reduce(world, say("log", { level: "warning", message: "the link is down" }));
  world = reduce(world, say("alarm", { alarm: { code: 2, axis: "x", message: "limit" } }));
  assert.deepEqual(world.log.map((line) => [line.level, line.text]), [["warning", "the link is down"], ["error", "X: limit"]]);
  assert.equal(reduce(world, say("alarm", { alarm: null })), world);
  assert.equal(reduce(world, say("nothing we know", {})), world);
});

test("what is kept is bounded, and what goes has ended", () => {
  let world = reduce(NOTHING, hello);
  for (let n = 0; n < 1000; n++) world = reduce(world, say("log", { message: String(n) }));
  assert.equal(world.log.length, 200);
  assert.equal(world.log.at(-1).text, "999");
  for (let id = 10; id < 1000; id++) world = withJob(world, job(id, "completed"));
  const jobs = Object.values(world.jobs);
  assert.ok(jobs.length <= 302);
  assert.equal(world.jobs[2].status, "running");
  assert.equal(jobs.filter((one) => !ENDED.has(one.status)).length, 1);
});

test("the band says what stands in the way of a glance: link, alarm, job, machine, in this order", () => {
  const shown = (more, now) => shownStatus(machine("mill", more), now);
  assert.equal(shown({ link: "disconnected" }, job(1, "running")), "offline");
  assert.equal(shown({ link: "connecting" }, null), "connecting");
  assert.equal(shown({ state: { ...state, status: "alarm" } }, job(1, "interrupted")), "alarm");
  assert.equal(shown({ state: { ...state, status: "run" } }, job(1, "paused")), "hold");
  assert.equal(shown({}, job(1, "waiting")), "tool");
  assert.equal(shown({}, job(1, "interrupted")), "interrupted");
  assert.equal(shown({}, job(1, "running")), "run");
  assert.equal(shown({ state: { ...state, status: "run" } }, null), "run");
  assert.equal(shown({}, null), "idle");
});
