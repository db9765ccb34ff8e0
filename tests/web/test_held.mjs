// Why a job waits on hold (web/jobs/held.js): the page's words by code, the daemon's where they say more.
import assert from "node:assert/strict";
import { test } from "node:test";
import { heldBecause, heldDetail } from "./web/jobs/held.js";

const held = (/** @type {string} */ code) => ({ hold: true, hold_reason: { code, message: "mill is connecting." } });

test("by its code, which is a key without a language loaded", () => {
  assert.equal(heldBecause(held("not_connected")), "held.not_connected");
  assert.equal(heldDetail(held("not_connected")), "mill is connecting.");
  assert.equal(heldBecause(held("restarted")), "held.restarted");
  assert.equal(heldDetail(held("restarted")), null);
});

test("a code of a newer daemon in its own words", () => {
  assert.equal(heldBecause(held("something_new")), "mill is connecting.");
  assert.equal(heldDetail(held("something_new")), null);
});

test("nothing where that is plain", () => {
  for (const one of [held("asked"), { ...held("restarted"), hold: false }, { hold: true }, { hold: true, hold_reason: null }]) {
    assert.equal(heldBecause(one), null);
    assert.equal(heldDetail(one), null);
  }
});
