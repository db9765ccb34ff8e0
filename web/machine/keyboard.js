// Jogging by the keyboard: arrows for X and Y, page up and down for Z, only while it is armed.
// The rule: nothing moves by a key unless somebody armed it here and now; leaving the page, the window or the keys alone
// for a minute disarms it, and so does a dialog that opens; a key typed into a field is a letter.

import { effect, signal } from "../lib/ui.js";
import { openDialogs } from "../parts/dialog.js";

const IDLE_MS = 60_000;
const FIRST = { capture: true };

/** @type {Record<string, Record<string, number>>} */
export const KEYS = {
  ArrowLeft: { x: -1 }, ArrowRight: { x: 1 }, ArrowUp: { y: 1 }, ArrowDown: { y: -1 }, PageUp: { z: 1 }, PageDown: { z: -1 },
};

export const armed = signal(false);

/**
 * Listen while armed.
 * @param {{down: (way: Record<string, number>) => void, up: () => void}} moves
 * @returns {() => void} how to stop listening
 */
export function listen(moves) {
  let held = "";
  let idle = setTimeout(disarm, IDLE_MS);
  function disarm() {
    armed.value = false;
    if (held) moves.up();
    held = "";
  }
  function down(/** @type {KeyboardEvent} */ event) {
    if (!armed.peek()) return; // disarmed this instant: whoever called `listen` may stop listening a frame later
    if (event.key === "Escape") return disarm();
    const way = KEYS[event.key];
    if (!way || typing(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    clearTimeout(idle);
    idle = setTimeout(disarm, IDLE_MS);
    if (event.repeat || held) return;
    held = event.key;
    moves.down(way);
  }
  function up(/** @type {KeyboardEvent} */ event) {
    if (event.key !== held) return;
    held = "";
    moves.up();
  }
  const hidden = () => document.hidden && disarm();
  const unwatch = effect(() => { if (openDialogs.value > 0) disarm(); });
  addEventListener("keydown", down, FIRST); // before a group of choices that takes arrows too
  addEventListener("keyup", up);
  addEventListener("blur", disarm);
  document.addEventListener("visibilitychange", hidden);
  return () => {
    unwatch();
    clearTimeout(idle);
    if (held) moves.up();
    removeEventListener("keydown", down, FIRST);
    removeEventListener("keyup", up);
    removeEventListener("blur", disarm);
    document.removeEventListener("visibilitychange", hidden);
  };
}

/** @param {EventTarget | null} target */
const typing = (target) => target instanceof HTMLElement && ["INPUT", "SELECT", "TEXTAREA"].includes(target.tagName);
