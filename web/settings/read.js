// What a controller is asked for when somebody looks: the answer, and how to ask again. A hook.
// The rule: the controller is asked when it can answer, once, and never by a clock.

import { useEffect, useState } from "../lib/ui.js";
import { get } from "../net/http.js";
import { notify } from "../parts/notices.js";
import { against, chosen } from "../state/store.js";

const WITHIN_MS = 30_000;

/** @param {string} what an address under the machine */
export const here = (what) => `/machines/${encodeURIComponent(chosen.value ?? "")}/${what}`;

/** @param {string} what an address under the machine */
export function useRead(what) {
  const [value, setValue] = useState(/** @type {any} */ (null));
  const reason = against("read"), path = here(what);
  const read = async () => { setValue(await get(path, { withinMs: WITHIN_MS })); };
  useEffect(() => { if (!reason && value === null) read().catch((error) => notify(error.message)); }, [reason, path]);
  return { value, setValue, read, reason };
}
