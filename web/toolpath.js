// Reads the packed path of a program (docs/toolpath.md, version 1) into typed arrays for drawing.
// Not the fetching and not the drawing. The rule: positions are added up as integers, so nothing drifts.

export const RAPID = 0, FEED = 1, CW = 2, CCW = 3, HOMING = 5, PROBE = 6;
export const START = 0x80; // nothing leads to this vertex

const VERSION = 1;
const HEAD_BYTES = 64;
const LEVEL_BYTES = 24;
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
    knownAxes: view.getUint32(16, true), unit: view.getFloat64(32, true), chordTolerance: view.getFloat64(40, true),
    segments: Number(view.getBigUint64(48, true)), lastLine: view.getUint32(56, true), levels: [], bounds: [], frames: [],
  };
  let at = HEAD_BYTES;
  for (let level = 0; level < levelCount; level++, at += LEVEL_BYTES) {
    head.levels.push({
      tolerance: view.getFloat64(at, true), vertices: view.getUint32(at + 8, true), blocks: view.getUint32(at + 12, true),
      bytes: Number(view.getBigUint64(at + 16, true)),
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

function copy(buffer, at, width, count, target, start) {
  if (width === 0) target.fill(new Uint32Array(buffer, at, 1)[0], start, start + count);
  else target.set(new ({ 1: Uint8Array, 2: Uint16Array, 4: Uint32Array }[width])(buffer, at, count), start);
}

function readBlocks(buffer, head) {
  const axes = head.axes.length;
  const { vertices, blocks } = head.levels[head.level];
  const places = Array.from({ length: axes }, () => new Int32Array(vertices));
  const lines = new Int32Array(vertices);
  const columns = {
    kinds: new Uint8Array(vertices), feedIds: new Uint32Array(vertices), toolIds: new Uint32Array(vertices),
    frameIds: new Uint32Array(vertices), unknown: new Uint16Array(vertices),
  };
  const sums = [...places, lines], values = Object.values(columns);
  let at = head.headBytes, start = 0;
  for (let block = 0; block < blocks; block++) {
    const [count, bytes] = new Uint32Array(buffer, at, 2);
    const bases = new Int32Array(buffer, at + 8, axes + 1);
    const widths = new Uint8Array(buffer, at + 12 + 4 * axes, axes + 6);
    let column = align(at + 12 + 4 * axes + widths.length, 4);
    sums.forEach((target, number) => {
      addUp(buffer, column, widths[number], count, bases[number], target, start);
      column = columnEnd(buffer, column, widths[number], count);
    });
    values.forEach((target, number) => {
      copy(buffer, column, widths[axes + 1 + number], count, target, start);
      column = columnEnd(buffer, column, widths[axes + 1 + number], count);
    });
    start += count;
    at += bytes;
  }
  if (at !== buffer.byteLength || start !== vertices) throw new Error("the toolpath breaks off");
  return { places, lines: new Uint32Array(lines.buffer), ...columns };
}

// The middle of the bounds where float32 would lose microns otherwise, in whole mm.
function originOf(head, letter) {
  const axis = head.axes.indexOf(letter);
  if (axis < 0) return 0;
  const [low, high] = head.bounds[axis];
  return Math.max(Math.abs(low), Math.abs(high)) > EXACT_MM ? Math.round((low + high) / 2) : 0;
}

function positionsOf(head, places, origin) {
  const found = new Float32Array(3 * head.levels[head.level].vertices);
  ["X", "Y", "Z"].forEach((letter, offset) => {
    const axis = head.axes.indexOf(letter);
    if (axis < 0) return;
    const counts = places[axis];
    for (let i = 0; i < counts.length; i++) found[3 * i + offset] = counts[i] * head.unit - origin[offset];
  });
  return found;
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

function lookedUp(ids, table, made) {
  for (let i = 0; i < ids.length; i++) made[i] = table[ids[i]];
  return made;
}

// All of one level. positions: x, y, z in mm of each vertex, less `origin`, machine coordinates as far as they are known;
// lines, kinds, tools, feeds (NaN: none): of the edge that leads to it; edges: 1 where there is one to draw;
// rotary: degrees by letter, of the axes that are known anywhere.
export function decodeToolpath(buffer) {
  const head = readHead(buffer);
  const { places, lines, kinds, feedIds, toolIds, frameIds, unknown } = readBlocks(buffer, head);
  const origin = ["X", "Y", "Z"].map((letter) => originOf(head, letter));
  const rotary = {};
  [...head.axes].forEach((letter, axis) => {
    if (!"ABC".includes(letter) || !((head.knownAxes >> axis) & 1)) return;
    rotary[letter] = Float64Array.from(places[axis], (count) => count * head.unit);
  });
  return {
    head, origin, rotary, lines, kinds, unknown, frames: frameIds,
    positions: positionsOf(head, places, origin),
    edges: edgesOf(head, kinds, unknown),
    tools: lookedUp(toolIds, head.toolTable, new Int32Array(kinds.length)),
    feeds: lookedUp(feedIds, head.feedTable, new Float32Array(kinds.length)),
  };
}
