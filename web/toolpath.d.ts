// Hand-written: what web/preview/ takes from the reader, no more.
export const CHORD_MM: number;
export const RAPID: number, FEED: number, CW: number, CCW: number, HOMING: number, PROBE: number, START: number;

export interface Level {
  tolerance: number;
  bytes: number;
  vertices: number;
  arcs: number;
}

export interface Toolpath {
  head: { level: number; levels: Level[]; axes: string; bounds: number[][]; frames: number[][]; segments: number };
  origin: number[];
  rotary: Record<string, Float64Array>;
  positions: Float32Array;
  edges: Uint8Array;
  kinds: Uint8Array;
  lines: Uint32Array;
  tools: Int32Array;
  frames: Uint32Array;
}

export function decodeToolpath(buffer: ArrayBuffer, options?: { chordMm?: number; turnDegrees?: number }): Toolpath;
