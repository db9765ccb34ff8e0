// The one door to the libraries: everything else imports them from here, so a change of library is a change of one file.
// The rule: nothing is rendered but through `html`, which sets text as text.

import { h, render } from "../vendor/preact.js";
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "../vendor/hooks.js";
import { batch, computed, effect, signal } from "../vendor/signals.js";
import htm from "../vendor/htm.js";

export const html = htm.bind(h);
export { batch, computed, effect, render, signal, useEffect, useLayoutEffect, useMemo, useRef, useState };
