// What a tool changer says (GET /io), read anew whenever something about it was said. A hook.
// The rule: the daemon alone knows what may be answered; the page asks it, and again after each message.

import { useEffect, useState } from "../lib/ui.js";
import { onMessage } from "../net/daemon.js";
import { get } from "../net/http.js";
import { can, live } from "../state/store.js";

const SETTLE_MS = 120; // pins change in bursts
const ABOUT = new Set(["io", "tool", "job", "hello"]);

/** @param {string} name of the machine @returns {{io: import("../types.js").Io | null, read: () => Promise<void>}} */
export function useIo(name) {
  const [io, setIo] = useState(/** @type {import("../types.js").Io | null} */ (null));
  const able = can("io") && live.value;
  const read = async () => { setIo(await get(`/machines/${encodeURIComponent(name)}/io`)); };
  useEffect(() => {
    if (!able) return undefined;
    let timer = 0;
    const ask = () => { read().catch(() => {}); };
    const stop = onMessage((message) => {
      if (!ABOUT.has(message.type) || (message.machine !== null && message.machine !== name)) return;
      clearTimeout(timer);
      timer = setTimeout(ask, SETTLE_MS);
    });
    ask();
    return () => {
      clearTimeout(timer);
      stop();
    };
  }, [name, able]);
  return { io, read };
}
