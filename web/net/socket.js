// The one WebSocket of a page: opens it, notices within two seconds when the daemon is gone, comes back by itself.
// Not what the messages mean (state/). The rule: a connection counts as alive only while something was heard on it; an
// idle machine says nothing, so the page asks (an empty `subscribe` is answered and changes nothing).

const BEAT_MS = 500;
const DEAD_MS = 1000; // asked, and nothing heard for so long: the daemon or the way to it is gone
const OPEN_MS = 4000; // an attempt that is neither refused nor accepted
export const BACK_OFF_MS = [200, 400, 800, 1500, 2500];

/**
 * @typedef {"connecting" | "live" | "lost" | "sign-in"} Status
 * @typedef {{
 *   make: (since: number | null) => WebSocket,
 *   mayEnter: () => Promise<boolean>,
 *   onMessage: (message: any) => void,
 *   onStatus: (status: Status) => void,
 *   now?: () => number,
 * }} Wiring `mayEnter`: false when the daemon asks for a token first; rejects when it does not answer.
 */

export class Connection {
  /** @param {Wiring} wiring */
  constructor(wiring) {
    this.wiring = wiring;
    this.now = wiring.now ?? (() => performance.now());
    /** @type {Status} */
    this.status = "connecting";
    /** @type {WebSocket | null} */
    this.socket = null;
    /** @type {number | null} */
    this.since = null;
    this.attempts = 0;
    this.wasLive = false;
    this.askedAt = 0; // when the page first asked since it last heard something; 0: not yet
    /** @type {number | null} */
    this.roundTripMs = null;
    this.lastId = 0;
    /** @type {Map<number, (result: any) => void>} */
    this.answers = new Map();
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
  }

  /** Open, or open again at once. */
  start() {
    clearTimeout(this.timer);
    this.drop();
    const socket = this.wiring.make(this.since);
    this.socket = socket;
    this.askedAt = 0;
    socket.addEventListener("message", (event) => this.socket === socket && this.hear(event.data));
    socket.addEventListener("close", () => this.socket === socket && this.lose());
    this.timer = setTimeout(() => this.lose(), OPEN_MS);
  }

  /** @param {string} text */
  hear(text) {
    const message = JSON.parse(text);
    this.askedAt = 0;
    if (message.type === "result") {
      this.answers.get(message.id)?.(message);
      this.answers.delete(message.id);
      return;
    }
    if (message.seq > (this.since ?? -1)) this.since = message.seq;
    this.wiring.onMessage(message);
    if (message.type === "hello") {
      this.attempts = 0;
      this.wasLive = true;
      this.say("live");
      this.beat();
    }
  }

  beat() {
    clearTimeout(this.timer);
    const now = this.now();
    if (this.askedAt && now - this.askedAt >= DEAD_MS) return this.lose();
    if (!this.askedAt) this.askedAt = now;
    this.send({ type: "subscribe" }, (result) => {
      if (result) this.roundTripMs = this.now() - now;
    });
    this.timer = setTimeout(() => this.beat(), BEAT_MS);
  }

  /** The connection is gone; try again after a while, unless a token is needed first. */
  lose() {
    clearTimeout(this.timer);
    this.drop();
    if (this.wasLive || this.attempts > 0) this.say("lost");
    const wait = BACK_OFF_MS[Math.min(this.attempts, BACK_OFF_MS.length - 1)];
    this.attempts += 1;
    this.timer = setTimeout(() => this.again(), wait);
  }

  /** Open, if the daemon lets us in. */
  async again() {
    try {
      if (!(await this.wiring.mayEnter())) return this.say("sign-in");
    } catch {
      return this.lose();
    }
    this.start();
  }

  drop() {
    const socket = this.socket;
    this.socket = null;
    for (const settle of this.answers.values()) settle(null);
    this.answers.clear();
    socket?.close();
  }

  /** @param {Status} status */
  say(status) {
    if (status === this.status) return;
    this.status = status;
    this.wiring.onStatus(status);
  }

  /** Whether something can be sent now. */
  get open() {
    return this.socket?.readyState === 1;
  }

  /**
   * Send without waiting. `answered` gets the result, or null when the connection was lost.
   * @param {object} message
   * @param {(result: any) => void} answered
   */
  send(message, answered) {
    if (!this.socket || !this.open) return answered(null);
    const id = ++this.lastId;
    this.answers.set(id, answered);
    this.socket.send(JSON.stringify({ ...message, id }));
  }

  /**
   * The result of a message; null when there was none within `withinMs`.
   * @param {object} message
   * @param {number} withinMs
   * @returns {Promise<any>}
   */
  ask(message, withinMs) {
    return new Promise((resolve) => {
      const timer = setTimeout(resolve, withinMs, null);
      this.send(message, (result) => {
        clearTimeout(timer);
        resolve(result);
      });
    });
  }
}
