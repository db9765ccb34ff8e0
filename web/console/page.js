// The console: the wire both ways as it is, with a filter. Blocks by hand are command.js.
// The rule: what a machine says is text and nothing else.

import { html, useEffect, useLayoutEffect, useRef, useState } from "../lib/ui.js";
import { t, time } from "../lib/i18n.js";
import { wantConsole } from "../net/daemon.js";
import { can, chosen, live } from "../state/store.js";
import { attempt } from "../state/actions.js";
import { Radios } from "../parts/radios.js";
import { CommandLine } from "./command.js";
import { fill, ringOf, version } from "./lines.js";

const SHOWN = 400;
const DIRECTIONS = ["", ">", "<"];

export function ConsolePage() {
  const machine = chosen.value;
  const [filter, setFilter] = useState("");
  const [direction, setDirection] = useState("");
  const [still, setStill] = useState(/** @type {import("./lines.js").Line[] | null} */ (null));
  const end = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => {
    wantConsole(true);
    if (machine !== null && live.value) attempt(() => fill(machine));
    return () => wantConsole(false);
  }, [machine, live.value]);
  const seen = version.value;
  const needle = filter.toLowerCase();
  const all = still ?? (machine === null ? [] : ringOf(machine));
  const lines = all.filter((one) => (!direction || one.direction === direction) && (!needle || one.text.toLowerCase().includes(needle))).slice(-SHOWN);
  useLayoutEffect(() => { if (end.current && !still) end.current.scrollTop = end.current.scrollHeight; }, [seen, filter, direction]);
  return html`<section class="panel console" aria-label=${t("console.title")}>
    <header><h2>${t("console.title")}</h2>
      <input type="search" placeholder=${t("console.filter")} aria-label=${t("console.filter")} value=${filter}
        data-name="console-filter"
        onInput=${(/** @type {any} */ event) => setFilter(event.target.value)} />
      <${Radios} label=${t("console.direction")} of=${DIRECTIONS} value=${direction} onValue=${setDirection}
        text=${(/** @type {string} */ one) => t(one === "" ? "console.both" : one === ">" ? "console.out" : "console.in")}
        mark=${(/** @type {string} */ one) => ({ "data-direction": one })} />
      <button type="button" class="button" aria-pressed=${still !== null}
        onClick=${() => setStill(still ? null : [...all])}>${t(still ? "console.go_on" : "console.hold")}</button>
    </header>
    <ol ref=${end} class="wire" tabindex="0" data-name="wire">${lines.map((one, index) => html`<li key=${index}
      class=${one.direction === ">" ? "out" : "in"}>
      <time>${time(one.at)}</time><i aria-label=${t(one.direction === ">" ? "console.out" : "console.in")}>${one.direction}</i><code>${one.text}</code></li>`)}</ol>
    ${can("commands") && html`<${CommandLine} />`}
  </section>`;
}
