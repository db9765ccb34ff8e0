// Where the page is, kept in the address: #/mill/jobs/17?filter=failed. Not what is shown there (app.js).
// The rule: a reload, a bookmark and the back button lead to the same place, and opening an address moves nothing.

import { signal } from "./ui.js";

/** @typedef {{machine: string | null, page: string, id: string | null, query: URLSearchParams}} Route */

export const PAGES = ["machine", "programs", "jobs", "plots", "console", "card", "tools", "settings"];

/** @param {string} hash @returns {Route} */
export function parse(hash) {
  const [path, query = ""] = hash.replace(/^#\/?/, "").split("?");
  const parts = path.split("/").filter(Boolean).map(decoded);
  const machine = parts[0] && parts[0] !== "-" ? parts[0] : null;
  const page = PAGES.includes(parts[1]) ? parts[1] : "machine";
  return { machine, page, id: parts[2] ?? null, query: new URLSearchParams(query) };
}

/** What was typed by hand may be no address at all. @param {string} part */
function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

export const route = signal(parse(location.hash));
addEventListener("hashchange", () => { route.value = parse(location.hash); });

/**
 * The address of a place.
 * @param {string} page
 * @param {string | number | null} [id]
 * @param {Record<string, string> | null} [query]
 * @param {string | null} [machine] the one that is looked at now, if it is left out
 */
export function to(page, id = null, query = null, machine = route.value.machine) {
  const parts = [machine ?? "-", page, ...(id === null ? [] : [String(id)])].map(encodeURIComponent);
  return `#/${parts.join("/")}${query ? `?${new URLSearchParams(query)}` : ""}`;
}

/** Go there. @param {string} address of `to` */
export function go(address) {
  location.hash = address;
}
