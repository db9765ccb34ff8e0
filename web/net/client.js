// What this browser calls itself towards the daemon, so that people can tell who moves a machine by hand. No library.
// Not who is allowed what: that is the token. The rule: all pages of one browser are one client, and it says nothing of
// whoever sits in front of it.

const KEY = "millstream.client";
const LETTERS = "23456789abcdefghjkmnpqrstuvwxyz"; // none that is taken for another
const LONG = 5;

function made() {
  const chosen = crypto.getRandomValues(new Uint8Array(LONG));
  return `browser-${Array.from(chosen, (one) => LETTERS[one % LETTERS.length]).join("")}`;
}

function kept() {
  try {
    const found = localStorage.getItem(KEY);
    if (found && /^[A-Za-z0-9._-]{1,64}$/.test(found)) return found;
    const name = made();
    localStorage.setItem(KEY, name);
    return name;
  } catch {
    return made(); // a browser that keeps nothing: another one with each page
  }
}

export const CLIENT = kept();
