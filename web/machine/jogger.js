// A jog that is held: repeats the wish while a finger or a key is down, and ends it when it is not. No drawing.
// Not the stop of last resort: the daemon ends a held jog by itself 200 ms after the last word. The rule: whatever
// happens to the page (touch lost, window left, tab hidden), the jog ends.

import { daemon } from "../net/daemon.js";

const BEAT_MS = 90; // the daemon allows 200

/** @typedef {(problem: string) => void} Refused */

export class Jogger {
  /** @param {{send?: (message: object, answered: (result: any) => void) => void}} [wiring] */
  constructor(wiring = {}) {
    this.send = wiring.send ?? ((message, answered) => daemon.send(message, answered));
    /** @type {ReturnType<typeof setInterval> | null} */
    this.timer = null;
    this.machine = "";
  }

  /**
   * @param {string} machine
   * @param {Record<string, number>} way the direction; its length does not matter
   * @param {number} feed mm/min
   * @param {Refused} refused
   */
  hold(machine, way, feed, refused) {
    this.release();
    this.machine = machine;
    const beat = () => this.send({ type: "jog", machine, ...way, feed, hold: true }, (result) => {
      if (result && !result.ok) {
        const held = this.timer !== null;
        this.release();
        if (held) refused(result.error.detail);
      }
    });
    this.timer = setInterval(beat, BEAT_MS);
    beat();
  }

  /** The finger is up. Harmless when nothing is held. */
  release() {
    if (this.timer === null) return;
    clearInterval(this.timer);
    this.timer = null;
    this.send({ type: "jog_stop", machine: this.machine }, () => {});
  }
}

export const jogger = new Jogger();
const let_go = () => jogger.release();
globalThis.addEventListener?.("blur", let_go);
globalThis.addEventListener?.("pagehide", let_go);
globalThis.document?.addEventListener("visibilitychange", let_go);
