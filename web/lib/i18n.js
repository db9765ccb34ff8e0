// The words of the page in the reader's language. Not what the daemon or a controller says: that is shown as it comes.
// The rule: a key that is missing is shown as the key, so that it is found; numbers follow the language, times read the same in all.

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

/** So many of something, in the form that the language has for it. @param {string} what @param {number} many */
export const count = (what, many) => t(`count.${what}.${new Intl.PluralRules(loaded.value || "en").select(many)}`, { count: number(many) });

const pad = (/** @type {number} */ part) => String(part).padStart(2, "0");

/** 14:05:09 on this computer's clock. @param {string | Date | null} at */
export function time(at) {
  if (at === null) return "";
  const local = new Date(at);
  return [local.getHours(), local.getMinutes(), local.getSeconds()].map(pad).join(":");
}

/** 2026-03-01 14:05: no country reads it another way. @param {string | null} at */
export function dateTime(at) {
  if (at === null) return "";
  const local = new Date(at);
  return `${local.getFullYear()}-${pad(local.getMonth() + 1)}-${pad(local.getDate())} ${pad(local.getHours())}:${pad(local.getMinutes())}`;
}
