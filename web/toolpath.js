// Reads the packed path of a program (docs/toolpath.md, version 2) into typed arrays for drawing: arcs become chords
// here, and turns of rotary axes are divided. Not the fetching and not the drawing. The rule: positions are added up as
// integers, so nothing drifts.

export const RAPID = 0, FEED = 1, CW = 2, CCW = 3, HOMING = 5, PROBE = 6;
export const START = 0x80; // nothing leads to this vertex

export const CHORD_MM = 0.02; // how far a chord may run beside its arc, beside what the level may be off anyway
export const TURN_DEGREES = 5; // of a rotary axis in one edge

const VERSION = 2;
const HEAD_BYTES = 56;
const LEVEL_BYTES = 32;
const FEWEST_A_TURN = 8; // a circle stays one, however small it is
const MOST_PARTS = 4096; // of one arc or turn
const PARTS_BUDGET = 4e6; // of one drawing: beyond, all of it gets coarser until it fits
const PLANES = { 17: "XY", 18: "ZX", 19: "YZ" };
const SPARSE = 5; // width of a column of which nearly all differences are 0
const EXACT_MM = 8000; // float32 holds a micron up to here

function align(at, unit) {
  return Math.ceil(at / unit) * unit;
}

function readHead(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < HEAD_BYTES || view.getUint32(0, true) !== 0x5054534d) throw new Error("this is no toolpath");
  const version = view.getUint16(4, true);
  if (version !== VERSION) throw new Error(`a toolpath of version ${version}; this page reads ${VERSION}`);
  const axisCount = view.getUint8(12), levelCount = view.getUint8(13);
  const counts = { tools: view.getUint32(20, true), feeds: view.getUint32(24, true), frames: view.getUint32(28, true) };
  const head = {
    level: view.getUint16(6, true), headBytes: view.getUint32(8, true), flags: view.getUint16(14, true),
    knownAxes: view.getUint32(16, true), unit: view.getFloat64(32, true),
    segments: Number(view.getBigUint64(40, true)), lastLine: view.getUint32(48, true), levels: [], bounds: [], frames: [],
  };
  let at = HEAD_BYTES;
  for (let level = 0; level < levelCount; level++, at += LEVEL_BYTES) {
    head.levels.push({
      tolerance: view.getFloat64(at, true), bytes: Number(view.getBigUint64(at + 8, true)),
      vertices: view.getUint32(at + 16, true), arcs: view.getUint32(at + 20, true), blocks: view.getUint32(at + 24, true),
    });
  }
  const doubles = (count) => Array.from({ length: count }, () => view.getFloat64((at += 8) - 8, true));
  for (let axis = 0; axis < axisCount; axis++) head.bounds.push(doubles(4));
  for (let frame = 0; frame < counts.frames; frame++) head.frames.push(doubles(axisCount));
  head.toolTable = Array.from({ length: counts.tools }, () => view.getInt32((at += 4) - 4, true));
  head.feedTable = Float32Array.from({ length: counts.feeds }, () => view.getFloat32((at += 4) - 4, true));
  head.axes = String.fromCharCode(...new Uint8Array(buffer, at, axisCount));
  return head;
}

// Where the n numbers of a column begin, and where the column after it does.
function columnEnd(buffer, at, width, count) {
  if (width === 0) return at + 4;
  if (width === SPARSE) {
    const [rare] = new Uint32Array(buffer, at, 1);
    return align(at + 4 + 2 * rare, 4) + 4 * rare;
  }
  if (width === 3) return align(at + 2 * count, 4) + align(count, 4);
  return align(at + width * count, 4);
}

// Adds the differences of a block up into target[start..]; all in int32, which wraps as the format says.
function addUp(buffer, at, width, count, base, target, start) {
  let sum = base;
  if (width === 0) {
    const [step] = new Int32Array(buffer, at, 1);
    for (let i = 0; i < count; i++) target[start + i] = sum = (sum + step) | 0;
  } else if (width === 3) {
    const low = new Uint16Array(buffer, at, count), high = new Int8Array(buffer, align(at + 2 * count, 4), count);
    for (let i = 0; i < count; i++) target[start + i] = sum = (sum + low[i] + high[i] * 65536) | 0;
  } else if (width === SPARSE) {
    const [rare] = new Uint32Array(buffer, at, 1);
    const places = new Uint16Array(buffer, at + 4, rare), steps = new Int32Array(buffer, align(at + 4 + 2 * rare, 4), rare);
    let from = 0;
    for (let i = 0; i < rare; from = places[i++]) {
      target.fill(sum, start + from, start + places[i]);
      sum = (sum + steps[i]) | 0;
    }
    target.fill(sum, start + from, start + count);
  } else {
    const steps = new ({ 1: Int8Array, 2: Int16Array, 4: Int32Array }[width])(buffer, at, count);
    for (let i = 0; i < count; i++) target[start + i] = sum = (sum + steps[i]) | 0;
  }
}

// The values of a signed column that is no sum, or of an unsigned one.
function copy(buffer, at, width, count, target, start) {
  const signed = target instanceof Int32Array;
  if (width === 0) target.fill(new (signed ? Int32Array : Uint32Array)(buffer, at, 1)[0], start, start + count);
  else if (width === 3 || width === SPARSE) {
    addUp(buffer, at, width, count, 0, target, start);
    for (let i = start + count - 1; i > start; i--) target[i] = (target[i] - target[i - 1]) | 0;
  } else {
    const kinds = signed ? { 1: Int8Array, 2: Int16Array, 4: Int32Array } : { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };
    target.set(new kinds[width](buffer, at, count), start);
  }
}

function readBlocks(buffer, head) {
  const axes = head.axes.length;
  const { vertices, arcs, blocks } = head.levels[head.level];
  const places = Array.from({ length: axes }, () => new Int32Array(vertices));
  const lines = new Int32Array(vertices);
  const columns = {
    kinds: new Uint8Array(vertices), feedIds: new Uint32Array(vertices), toolIds: new Uint32Array(vertices),
    frameIds: new Uint32Array(vertices), unknown: new Uint16Array(vertices),
  };
  const sweepBits = new Uint32Array(arcs);
  const curves = { first: new Int32Array(arcs), second: new Int32Array(arcs), sweepBits, planes: new Uint8Array(arcs) };
  const sums = [...places, lines], values = Object.values(columns), arcValues = Object.values(curves);
  const width = axes + 6 + arcValues.length;
  let at = head.headBytes, start = 0, arc = 0;
  for (let block = 0; block < blocks; block++) {
    const [count, bytes, arcCount] = new Uint32Array(buffer, at, 3);
    const bases = new Int32Array(buffer, at + 12, axes + 1);
    const widths = new Uint8Array(buffer, at + 16 + 4 * axes, width);
    let column = align(at + 16 + 4 * axes + width, 4), number = 0;
    const next = (length) => (column = columnEnd(buffer, column, widths[number++], length));
    for (const target of sums) {
      addUp(buffer, column, widths[number], count, bases[number], target, start);
      next(count);
    }
    for (const target of values) {
      copy(buffer, column, widths[number], count, target, start);
      next(count);
    }
    for (const target of arcCount ? arcValues : []) {
      copy(buffer, column, widths[number], arcCount, target, arc);
      next(arcCount);
    }
    start += count;
    arc += arcCount;
    at += bytes;
  }
  if (at !== buffer.byteLength || start !== vertices || arc !== arcs) throw new Error("the toolpath breaks off");
  return { places, lines: new Uint32Array(lines.buffer), ...columns, ...curves, sweeps: new Float32Array(sweepBits.buffer) };
}

// The middle of the bounds where float32 would lose microns otherwise, in whole mm.
function originOf(head, letter) {
  const axis = head.axes.indexOf(letter);
  if (axis < 0) return 0;
  const [low, high] = head.bounds[axis];
  return Math.max(Math.abs(low), Math.abs(high)) > EXACT_MM ? Math.round((low + high) / 2) : 0;
}

// Whether an edge leads to each vertex that may be drawn: see "unknown" in docs/toolpath.md.
function edgesOf(head, kinds, unknown) {
  let harmless = ~head.knownAxes;
  for (let axis = 0; axis < head.axes.length; axis++) if ("ZABC".includes(head.axes[axis])) harmless |= 1 << axis;
  const edges = new Uint8Array(kinds.length);
  for (let i = 1; i < kinds.length; i++) {
    edges[i] = !(kinds[i] & START) && unknown[i] === unknown[i - 1] && !(unknown[i] & ~harmless) ? 1 : 0;
  }
  return edges;
}

const isArc = (kind) => kind === CW || kind === CCW;

// Into how many parts each edge is to be divided: arcs by the chord tolerance, turns by their angle.
function partsOf(head, file, edges, chordMm, turnDegrees) {
  const parts = new Uint16Array(edges.length).fill(1);
  const turning = [...head.axes].flatMap((letter, axis) => ("ABC".includes(letter) ? [file.places[axis]] : []));
  const turnCounts = turnDegrees / head.unit;
  let more = 0;
  for (let i = 1, arc = 0; i < edges.length; i++) {
    const curved = isArc(file.kinds[i]);
    let wanted = 1;
    if (edges[i]) for (const places of turning) wanted = Math.max(wanted, Math.abs(places[i] - places[i - 1]) / turnCounts);
    if (curved && edges[i]) {
      const radius = Math.max(Math.hypot(file.first[arc], file.second[arc]) * head.unit, 1e-9);
      const step = 4 * Math.asin(Math.sqrt(Math.min(chordMm / (2 * radius), 1)));
      wanted = Math.max(wanted, Math.abs(file.sweeps[arc]) / Math.min(step, (2 * Math.PI) / FEWEST_A_TURN));
    }
    arc += curved ? 1 : 0;
    parts[i] = Math.min(Math.ceil(wanted), MOST_PARTS);
    more += parts[i] - 1;
  }
  return { parts, more };
}

// The corners between the ends of each edge, in counts; which vertex of the file each corner belongs to.
function divided(head, file, parts, more) {
  const total = file.kinds.length + more;
  const source = new Uint32Array(total);
  const places = file.places.map(() => new Float64Array(total));
  for (let i = 0, arc = 0, to = 0; i < file.kinds.length; i++) {
    const curved = isArc(file.kinds[i]), count = parts[i];
    if (count > 1) between(head, file, i, curved ? arc : -1, count, places, to);
    to += count;
    places.forEach((column, axis) => (column[to - 1] = file.places[axis][i]));
    source.fill(i, to - count, to);
    arc += curved ? 1 : 0;
  }
  return { source, places };
}

function between(head, file, i, arc, count, places, to) {
  places.forEach((column, axis) => {
    const begin = file.places[axis][i - 1], way = file.places[axis][i] - begin;
    for (let part = 1; part < count; part++) column[to + part - 1] = begin + (way * part) / count;
  });
  if (arc < 0) return;
  const [first, second] = [...PLANES[file.planes[arc]]].map((letter) => head.axes.indexOf(letter));
  if (first < 0 || second < 0) return;
  const across = file.first[arc], up = file.second[arc], sweep = file.sweeps[arc];
  const x = file.places[first][i - 1] + across, y = file.places[second][i - 1] + up;
  const radius = Math.hypot(across, up), angle = Math.atan2(-up, -across);
  const grown = Math.hypot(file.places[first][i] - x, file.places[second][i] - y) - radius;
  for (let part = 1; part < count; part++) {
    const share = part / count, here = radius + grown * share;
    places[first][to + part - 1] = x + here * Math.cos(angle + sweep * share);
    places[second][to + part - 1] = y + here * Math.sin(angle + sweep * share);
  }
}

function expanded(head, file, edges, options) {
  let chordMm = Math.max(options.chordMm ?? CHORD_MM, head.levels[head.level].tolerance);
  let turnDegrees = options.turnDegrees ?? TURN_DEGREES;
  let found = partsOf(head, file, edges, chordMm, turnDegrees);
  for (let times = 0; found.more > PARTS_BUDGET && times < 24; times++) {
    found = partsOf(head, file, edges, (chordMm *= 4), (turnDegrees *= 2));
  }
  if (!found.more) return { source: null, places: file.places, chordMm };
  return { ...divided(head, file, found.parts, found.more), chordMm };
}

function positionsOf(head, places, origin, count) {
  const found = new Float32Array(3 * count);
  ["X", "Y", "Z"].forEach((letter, offset) => {
    const axis = head.axes.indexOf(letter);
    if (axis < 0) return;
    const counts = places[axis];
    for (let i = 0; i < count; i++) found[3 * i + offset] = counts[i] * head.unit - origin[offset];
  });
  return found;
}

// A column by corner instead of by vertex of the file.
function spread(column, source) {
  if (!source) return column;
  const found = new column.constructor(source.length);
  for (let i = 0; i < source.length; i++) found[i] = column[source[i]];
  return found;
}

function lookedUp(ids, table, made) {
  for (let i = 0; i < ids.length; i++) made[i] = table[ids[i]];
  return made;
}

// All of one level, as corners joined by straight edges. positions: x, y, z in mm of each, less `origin`, machine
// coordinates as far as they are known; lines, kinds, tools, feeds (NaN: none): of the edge that leads to it; edges: 1
// where there is one to draw; rotary: degrees at each corner by letter, of the axes that are known anywhere.
// options: chordMm, turnDegrees. `chordMm` in the answer is what was kept, more where there were too many arcs.
export function decodeToolpath(buffer, options = {}) {
  const head = readHead(buffer);
  const file = readBlocks(buffer, head);
  const origin = ["X", "Y", "Z"].map((letter) => originOf(head, letter));
  const inFile = edgesOf(head, file.kinds, file.unknown);
  const { source, places, chordMm } = expanded(head, file, inFile, options);
  const [kinds, feedIds, toolIds] = [file.kinds, file.feedIds, file.toolIds].map((column) => spread(column, source));
  const rotary = {};
  [...head.axes].forEach((letter, axis) => {
    if (!"ABC".includes(letter) || !((head.knownAxes >> axis) & 1)) return;
    rotary[letter] = Float64Array.from(places[axis], (count) => count * head.unit);
  });
  return {
    head, origin, rotary, kinds, chordMm,
    lines: spread(file.lines, source),
    unknown: spread(file.unknown, source),
    frames: spread(file.frameIds, source),
    positions: positionsOf(head, places, origin, kinds.length),
    edges: spread(inFile, source),
    tools: lookedUp(toolIds, head.toolTable, new Int32Array(kinds.length)),
    feeds: lookedUp(feedIds, head.feedTable, new Float32Array(kinds.length)),
  };
}
