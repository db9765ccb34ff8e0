// Completion of a block that is typed: what the letters before the cursor can become in the language of this machine. Pure.
// The rule: only what the machine's own profile knows; nothing is completed that was not asked for.

const MOST = 8;
const WORD = /([A-Za-z][0-9.]*)$/;

/** @typedef {{code: string, text: string}} Code */

/** The codes that begin as the last word does; none where it is one already. @param {Code[]} codes @param {string} block @returns {Code[]} */
export function completions(codes, block) {
  const begun = WORD.exec(block)?.[1].toUpperCase();
  if (!begun || /[(;]/.test(block)) return [];
  const found = codes.filter(({ code }) => code.startsWith(begun));
  return found.some(({ code }) => code === begun) && found.length === 1 ? [] : found.sort(byNumber).slice(0, MOST);
}

/** The block with its last word made whole. @param {string} block @param {Code} chosen */
export const completed = (block, chosen) => `${block.replace(WORD, "")}${chosen.code} `;

/** @param {Code} one @param {Code} other */
const byNumber = (one, other) => one.code.localeCompare(other.code, "en", { numeric: true });
