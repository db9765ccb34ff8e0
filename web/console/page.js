// The console: the wire both ways as it is, with a filter, and a line for blocks by hand.
// The rule: what a machine says is text and nothing else.

import { html, useEffect, useLayoutEffect, useRef, useState } from "../lib/ui.js";
import { t, time } from "../lib/i18n.js";
import { wantConsole } from "../net/daemon.js";
import { against, can, chosen, live } from "../state/store.js";
import { attempt, run } from "../state/actions.js";
import { fill, ringOf, version } from "./lines.js";

const SHOWN = 400;
const REMEMBERED = 50;
/** @type {string[]} */
const said = [];

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
      <div class="filters" role="radiogroup" aria-label=${t("console.direction")}>
        ${["", ">", "<"].map((one) => html`<button type="button" class="button" role="radio" key=${one}
          aria-checked=${direction === one}
          onClick=${() => setDirection(one)}>${t(one === "" ? "console.both" : one === ">" ? "console.out" : "console.in")}</button>`)}</div>
      <button type="button" class="button" aria-pressed=${still !== null}
        onClick=${() => setStill(still ? null : [...all])}>${t(still ? "console.go_on" : "console.hold")}</button>
    </header>
    <ol ref=${end} class="wire" tabindex="0" data-name="wire">${lines.map((one, index) => html`<li key=${index}
      class=${one.direction === ">" ? "out" : "in"}>
      <time>${time(one.at)}</time><i aria-label=${t(one.direction === ">" ? "console.out" : "console.in")}>${one.direction}</i><code>${one.text}</code></li>`)}</ol>
    ${can("commands") && html`<${CommandLine} />`}
  </section>`;
}

function CommandLine() {
  const [text, setText] = useState("");
  const [back, setBack] = useState(0);
  const [answer, setAnswer] = useState("");
  const reason = against("by_hand");
  async function submit(/** @type {Event} */ event) {
    event.preventDefault();
    const block = text.trim();
    if (!block || reason) return;
    if (said[said.length - 1] !== block) said.push(block);
    if (said.length > REMEMBERED) said.shift();
    setText("");
    setBack(0);
    setAnswer(t("console.sent", { block }));
    const done = await attempt(() => run([block]));
    setAnswer(done ? t("console.done", { block }) : t("console.refused", { block }));
  }
  function key(/** @type {KeyboardEvent} */ event) {
    if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
    event.preventDefault();
    const next = Math.min(said.length, Math.max(0, back + (event.key === "ArrowUp" ? 1 : -1)));
    setBack(next);
    setText(next ? said[said.length - next] : "");
  }
  return html`<form class="command" onSubmit=${submit}>
    <input type="text" name="block" autocomplete="off" autocapitalize="characters" spellcheck=${false} maxlength="1024"
      value=${text}
      placeholder=${reason ? t(reason) : t("console.command")} aria-label=${t("console.command")} disabled=${Boolean(reason)}
      onInput=${(/** @type {any} */ event) => setText(event.target.value)} onKeyDown=${key} />
    <button type="submit" class="button primary" disabled=${Boolean(reason)}>${t("console.send")}</button>
    <output data-name="answer">${answer}</output>
  </form>`;
}
