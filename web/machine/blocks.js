// The blocks that the buttons of the page send, by protocol: what a controller needs for zeroing an axis or going to zero.
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
