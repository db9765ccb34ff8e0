// An open preview: the drawing of a path, how it is looked at, and tool, progress and reach kept up to date in it.
// The rule: progress is what is certainly done; where there is no WebGL the figures are there all the same.

import { effect, html, useEffect, useRef, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { theme } from "../lib/prefs.js";
import { job, machine } from "../state/store.js";
import { Icon } from "../parts/icon.js";
import { fitted, VIEWS, zoomed } from "./eye.js";
import { Facts } from "./facts.js";
import { Filters } from "./filters.js";
import { takeHold } from "./hand.js";
import { offsetAt } from "./path.js";
import { reachIn, toolAt } from "./place.js";
import { coloursOf, readPath, sizeOf } from "./reader.js";

/** @typedef {ReturnType<typeof readPath>} Reader */

const ZOOM = 1.4;
/** @type {import("./path.js").Wish} */
const EVERYTHING = { tools: null, lowest: null, highest: null, rapids: true };

/** @param {{program: string, name: string | null}} props `name` of the machine whose profile reads it */
export function View({ program, name }) {
  const host = useRef(/** @type {HTMLElement | null} */ (null));
  const look = useRef(/** @type {ReturnType<typeof lookAt> | null} */ (null));
  const [reader, setReader] = useState(/** @type {Reader | null} */ (null));
  const [wish, setWish] = useState(EVERYTHING);
  useEffect(() => {
    const on = /** @type {HTMLElement} */ (host.current), made = readPath(on, program, name);
    look.current = lookAt(on, made);
    setReader(made);
    const stops = [look.current.stop, keepUp(made, program), keepColours(on, made)];
    return () => {
      for (const stop of stops) stop();
      made.close();
    };
  }, []);
  const found = reader?.found.value ?? null, problem = reader?.problem.value ?? "", blind = reader?.blind.value ?? false;
  const drawn = reader?.drawn.value, reach = found && reachNow(found, program);
  const press = (/** @type {string} */ label, /** @type {string} */ icon, /** @type {number} */ times) => html`
    <button type="button" class="button icon-only" aria-label=${label} onClick=${() => look.current?.zoom(times)}><${Icon} name=${icon} /></button>`;
  return html`<div>
    ${problem && html`<p class="problem" data-name="preview-problem">${problem}</p>`}
    ${blind && html`<p class="problem" data-name="no-webgl">${t("preview.no_webgl")}</p>`}
    <div class="path-view" hidden=${blind || problem !== ""} data-name="path-view" data-quality=${drawn?.quality}
        data-drawn=${drawn?.count} data-complete=${drawn?.complete} data-level=${drawn?.level}>
      <div ref=${host} class="path-canvas" role="img" aria-label=${t("preview.title")}></div>
      <div class="path-tools row">
        ${Object.keys(VIEWS).map((one) => html`<button key=${one} type="button" class="button" data-name=${`view-${one}`}
          onClick=${() => look.current?.view(/** @type {import("./eye.js").View} */ (one))}>${t(`preview.view.${one}`)}</button>`)}
        ${press(t("preview.closer"), "plus", ZOOM)}${press(t("preview.farther"), "minus", 1 / ZOOM)}
      </div>
      ${!found && html`<p class="empty">${t("preview.reading")}</p>`}</div>
    ${found && reader && html`${!blind && html`<${Filters} reach=${reach !== null} tools=${found.tools} heights=${found.heights} wish=${wish}
        onWish=${(/** @type {import("./path.js").Wish} */ next) => { setWish(next); reader.tell("wish", { wish: next }); }} />`}
      <${Facts} found=${found} reach=${reach} coarse=${(drawn?.level ?? 0) > 0} />`}
  </div>`;
}

/** The eye, the hand that moves it, and the size of the picture. @param {HTMLElement} host @param {Reader} reader */
function lookAt(host, reader) {
  /** @type {import("./eye.js").Eye} */
  let eye = { target: [0, 0, 0], azimuth: 0, polar: 0, mmPerPx: 1 };
  const set = (/** @type {import("./eye.js").Eye} */ next, /** @type {boolean} */ turning) => {
    eye = next;
    reader.tell("eye", { eye, turning });
  };
  const view = (/** @type {import("./eye.js").View} */ name) => {
    const { width, height } = sizeOf(host), bounds = reader.found.peek()?.bounds;
    if (bounds) set(fitted(name, bounds, width, height), false);
  };
  let begun = false;
  const letGo = takeHold(host, () => eye, set);
  const resized = new ResizeObserver(() => reader.tell("size", { size: sizeOf(host) }));
  resized.observe(host);
  const stop = effect(() => {
    if (!reader.found.value || begun) return;
    begun = true;
    view("iso");
  });
  return {
    view,
    zoom: (/** @type {number} */ times) => set(zoomed(eye, times), false),
    stop() {
      stop();
      letGo();
      resized.disconnect();
    },
  };
}

/** @param {HTMLElement} host @param {Reader} reader */
function keepColours(host, reader) {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const tell = () => setTimeout(() => reader.tell("colours", { colours: coloursOf(host) })); // when the page has them
  system.addEventListener("change", tell);
  const stop = effect(() => { void theme.value; tell(); });
  return () => {
    stop();
    system.removeEventListener("change", tell);
  };
}

/** The line that is certainly done, 0 where no job runs this program. @param {string} program */
const lineNow = (program) => (job.value?.program === program ? job.value.progress.line : 0);

/** Where the machine stands, while it says so. */
const standing = () => (machine.value?.link === "connected" ? machine.value : null);

/** @param {import("./reader.js").Found} found @param {string} program */
function reachNow(found, program) {
  const now = standing();
  return now && reachIn(now.travel ?? {}, now.state.position, offsetAt(found.frames, lineNow(program)), found.bounds);
}

/** Everything that changes while it is open. @param {Reader} reader @param {string} program */
function keepUp(reader, program) {
  const stops = [
    effect(() => reader.tell("line", { line: lineNow(program) })),
    effect(() => {
      const now = standing(), found = reader.found.value;
      reader.tell("tool", { at: now && found && toolAt(now.state.position, offsetAt(found.frames, lineNow(program))) });
    }),
    effect(() => {
      const found = reader.found.value;
      reader.tell("reach", { box: found && reachNow(found, program) });
    }),
  ];
  return () => { for (const stop of stops) stop(); };
}
