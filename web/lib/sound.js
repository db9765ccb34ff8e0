// Calls for a person: three tones, repeated until somebody answers or turns the sound off. Made here, no file.
// The rule: a browser plays nothing before the page was touched once; then it stays silent and nothing breaks.

import { soundOn } from "./prefs.js";

const AGAIN_MS = 4000;
const TONES_HZ = { alarm: [880, 660, 880], tool: [523, 659, 784], message: [659, 659], done: [523, 784] };
/** @type {AudioContext | null} */
let context = null;

/** Once. @param {keyof typeof TONES_HZ} kind */
export function ring(kind) {
  if (!soundOn.peek() || navigator.userActivation?.hasBeenActive === false) return;
  context ??= new AudioContext();
  if (context.state !== "running") context.resume().catch(() => {});
  let at = context.currentTime + 0.02;
  for (const hertz of TONES_HZ[kind]) {
    const tone = context.createOscillator(), loudness = context.createGain();
    tone.frequency.value = hertz;
    loudness.gain.setValueAtTime(0, at);
    loudness.gain.linearRampToValueAtTime(0.25, at + 0.02);
    loudness.gain.linearRampToValueAtTime(0, at + 0.22);
    tone.connect(loudness).connect(context.destination);
    tone.start(at);
    tone.stop(at + 0.24);
    at += 0.26;
  }
}

/** Call until the returned function is called. @param {keyof typeof TONES_HZ} kind */
export function call(kind) {
  ring(kind);
  const timer = setInterval(ring, AGAIN_MS, kind);
  return () => clearInterval(timer);
}
