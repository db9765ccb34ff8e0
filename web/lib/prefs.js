// What one browser remembers for itself: language, step of the jog, sound. Nothing of the workshop.
// The rule: a browser that keeps nothing (private, forbidden) works all the same.

import { effect, signal } from "./ui.js";

const PREFIX = "millstream.";

/** @template T @param {string} name @param {T} initial @returns {import("../vendor/signals.js").Signal<T>} */
function kept(name, initial) {
  const value = signal(read(name, initial));
  effect(() => write(name, value.value));
  return value;
}

/** @template T @param {string} name @param {T} initial @returns {T} */
function read(name, initial) {
  try {
    const text = localStorage.getItem(PREFIX + name);
    const found = text === null ? initial : JSON.parse(text);
    return typeof found === typeof initial ? found : initial;
  } catch {
    return initial;
  }
}

/** @param {string} name @param {unknown} value */
function write(name, value) {
  try {
    localStorage.setItem(PREFIX + name, JSON.stringify(value));
  } catch {
    // Then it is forgotten with the page.
  }
}

export const language = kept("language", "");
export const soundOn = kept("sound", true);
export const theme = kept("theme", "auto");
export const jogStep = kept("jog.step", 1); // mm; 0: for as long as it is held
export const jogFeed = kept("jog.feed", 1000); // mm/min
export const previewOpen = kept("preview.open", false);
