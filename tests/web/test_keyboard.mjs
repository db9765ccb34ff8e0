// The keyboard of the jog (web/machine/keyboard.js): keys count while it is armed, and not an instant longer.
import assert from "node:assert/strict";
import { mock, test } from "node:test";

const page = new EventTarget();
globalThis.HTMLElement = class {};
globalThis.document = Object.assign(new EventTarget(), { hidden: false });
globalThis.addEventListener = page.addEventListener.bind(page);
globalThis.removeEventListener = page.removeEventListener.bind(page);
const { armed, listen } = await import("./web/machine/keyboard.js");
const { openDialogs } = await import("./web/parts/dialog.js");

function press(type, key, more = {}) {
  const event = Object.assign(new Event(type, { cancelable: true }), { key, repeat: false, ctrlKey: false, altKey: false, metaKey: false, ...more });
  page.dispatchEvent(event);
  return event.defaultPrevented;
}

function story(tell) {
  return () => {
    mock.timers.enable({ apis: ["setTimeout"] });
    const said = [];
    armed.value = true;
    const stop = listen({ down: (way) => said.push(way), up: () => said.push("up") });
    try {
      tell(said);
    } finally {
      stop();
      mock.timers.reset();
    }
  };
}

test("a key moves once until it is let go, and the page does not scroll", story((said) => {
  assert.ok(press("keydown", "ArrowRight"));
  press("keydown", "ArrowRight", { repeat: true });
  press("keydown", "ArrowUp"); // the second finger waits for the first
  press("keyup", "ArrowUp");
  press("keyup", "ArrowRight");
  press("keydown", "PageDown");
  assert.deepEqual(said, [{ x: 1 }, "up", { z: -1 }]);
}));

test("escape ends the move and the keys at once, though nobody has stopped listening yet", story((said) => {
  press("keydown", "ArrowLeft");
  press("keydown", "Escape");
  assert.equal(armed.value, false);
  assert.equal(press("keydown", "ArrowLeft"), false);
  assert.deepEqual(said, [{ x: -1 }, "up"]);
}));

test("a window that is left ends the move", story((said) => {
  press("keydown", "ArrowLeft");
  page.dispatchEvent(new Event("blur"));
  press("keydown", "ArrowLeft");
  assert.deepEqual(said, [{ x: -1 }, "up"]);
}));

test("a minute without a key disarms", story((said) => {
  mock.timers.tick(50_000);
  press("keydown", "ArrowUp");
  press("keyup", "ArrowUp");
  mock.timers.tick(59_000);
  assert.equal(armed.value, true);
  mock.timers.tick(1000);
  press("keydown", "ArrowUp");
  assert.deepEqual([armed.value, said], [false, [{ y: 1 }, "up"]]);
}));

test("a key with a modifier is the browser's, another key nobody's", story((said) => {
  press("keydown", "ArrowUp", { ctrlKey: true });
  press("keydown", "x");
  assert.deepEqual(said, []);
}));

test("a dialog that opens disarms it, and what is held ends", story((said) => {
  press("keydown", "ArrowRight");
  openDialogs.value = 1;
  assert.equal(armed.value, false);
  press("keydown", "ArrowLeft");
  openDialogs.value = 0;
  press("keydown", "ArrowLeft");
  assert.deepEqual(said, [{ x: 1 }, "up"]);
}));
