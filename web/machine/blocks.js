// What differs between protocols at the buttons of the page: the blocks for zeroing an axis or going to zero, and the axes.
// The rule: a table of words of the controllers' own documents; a controller without a line here has no such button.

/** @type {Record<string, {zero: (axes: string[]) => string[], go: (axes: string[]) => string[]}>} */
const BY_PROTOCOL = {
  elvinto: { zero: (axes) => [`G92 ${at0(axes)}`], go: (axes) => ["G90", `G0 ${at0(axes)}`] }, // elvinto §6
  grbl: { zero: (axes) => [`G10 L20 P0 ${at0(axes)}`], go: (axes) => [`G90 G0 ${at0(axes)}`] }, // P0: the active system
};

/** @param {string[]} axes */
const at0 = (axes) => axes.map((axis) => `${axis.toUpperCase()}0`).join(" ");

/** @param {string} protocol */
export const blocksOf = (protocol) => BY_PROTOCOL[protocol] ?? null;

/** What a protocol moves, where it is not X, Y and Z: until a machine has said where it stands. @type {Record<string, string[]>} */
const AXES = { ncframe: ["x", "z"] };

/** The axes that can be moved by hand. @param {string} protocol @param {string[]} told of in positions */
export const axesOf = (protocol, told) => (told.length ? told : AXES[protocol] ?? ["x", "y", "z"]);
