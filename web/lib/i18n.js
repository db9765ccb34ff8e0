// The words of the page in the reader's language. Not what the daemon or a controller says: that is shown as it comes.
// The rule: a key that is missing is shown as the key, so that it is found; numbers and times follow the language.

import { computed, signal } from "./ui.js";
import { language } from "./prefs.js";

export const LANGUAGES = { en: "English", ru: "Русский", zh: "中文" };

/** @type {Record<string, string>} */
const EMPTY = {};
const words = signal(EMPTY);
const loaded = signal("");

/** The language that is spoken: the chosen one, else the browser's if it is one of ours. */
export const spoken = computed(() => {
  if (language.value in LANGUAGES) return language.value;
  const wanted = navigator.languages.map((tag) => tag.slice(0, 2).toLowerCase());
  return wanted.find((tag) => tag in LANGUAGES) ?? "en";
});

/** Load a language; the one before stays when that fails. @param {string} tag */
export async function speak(tag) {
  const response = await fetch(`/web/i18n/${tag}.json`);
  if (!response.ok) throw new Error(`the words of ${tag} cannot be loaded`);
  words.value = await response.json();
  loaded.value = tag;
  document.documentElement.lang = tag;
}

/**
 * @param {string} key
 * @param {Record<string, string | number>} [values] for {name} in the text
 */
export function t(key, values) {
  const text = words.value[key] ?? key;
  return values ? text.replace(/\{(\w+)\}/g, (whole, name) => String(values[name] ?? whole)) : text;
}

/** Of a number with a fixed count of decimals. @param {number} value @param {number} [digits] */
export const number = (value, digits = 0) =>
  new Intl.NumberFormat(loaded.value || "en", { minimumFractionDigits: digits, maximumFractionDigits: digits }).format(value);

/** @param {string | Date | null} at */
export const time = (at) => (at === null ? "" : new Date(at).toLocaleTimeString(loaded.value || "en"));

/** @param {string | null} at */
export const dateTime = (at) =>
  at === null ? "" : new Date(at).toLocaleString(loaded.value || "en", { dateStyle: "short", timeStyle: "short" });
