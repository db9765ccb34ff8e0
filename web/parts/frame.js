// The frame of every page: header with the machines, tabs, and the warning when the daemon is gone.
// The rule: whoever looks sees at once whether what is shown is true now.

import { html, useEffect, useRef, useState } from "../lib/ui.js";
import { LANGUAGES, spoken, t, time } from "../lib/i18n.js";
import { language, soundOn, theme } from "../lib/prefs.js";
import { PAGES, route, to } from "../lib/router.js";
import { request } from "../net/http.js";
import { attempt } from "../state/actions.js";
import { activeJob, shownStatus } from "../state/reduce.js";
import { can, chosen, connection, live, lostAt, operator, signedIn, world } from "../state/store.js";
import { Icon } from "./icon.js";

export function Header() {
  return html`<header class="top">
    <a class="brand" href=${to("machine")} aria-label="millstream"><img src="/web/icon.svg" alt="" width="28" height="28" /><span>millstream</span></a>
    <${Machines} />
    <p class=${`connection ${live.value ? "live" : "broken"}`} role="status" data-name="connection">
      ${live.value ? t(operator.value ? "connection.live" : "connection.read_only") : t(`connection.${connection.value}`)}</p>
    <${Menu} />
  </header>`;
}

function Machines() {
  const nav = useRef(/** @type {HTMLElement | null} */ (null));
  const { order, machines } = world.value, now = chosen.value;
  // Where there is no room for all of them, the one that is looked at is in sight.
  useEffect(() => { nav.current?.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest", inline: "nearest" }); }, [now, order.length]);
  if (order.length < 2) return null;
  return html`<nav ref=${nav} class="machines" aria-label=${t("machine.choose")}>
    ${order.map((name) => {
      const status = shownStatus(machines[name], activeJob(world.value, name));
      return html`<a key=${name} href=${to(route.value.page, null, null, name)} class=${`chip s-${status}`}
        aria-current=${name === now ? "true" : undefined}>
        <${Icon} name=${status} size=${20} /><b>${name}</b><span>${t(`status.${status}`)}</span></a>`;
    })}
  </nav>`;
}

function Menu() {
  const [open, setOpen] = useState(false), box = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => {
    if (!open) return undefined;
    const away = (/** @type {Event} */ event) => { if (!box.current?.contains(/** @type {Node} */ (event.target))) setOpen(false); };
    const key = (/** @type {KeyboardEvent} */ event) => {
      if (event.key !== "Escape") return;
      setOpen(false);
      box.current?.querySelector("button")?.focus();
    };
    addEventListener("pointerdown", away);
    addEventListener("keydown", key);
    return () => {
      removeEventListener("pointerdown", away);
      removeEventListener("keydown", key);
    };
  }, [open]);
  return html`<div ref=${box} class="menu">
    <button type="button" class="button plain" aria-expanded=${open} aria-label=${t("menu.title")} data-name="menu"
      onClick=${() => setOpen(!open)}><${Icon} name="more" /></button>
    ${open && html`<div class="menu-body">
      <label>${t("menu.language")}
        <select value=${spoken.value} onChange=${(/** @type {any} */ event) => { language.value = event.target.value; }}>
          ${Object.entries(LANGUAGES).map(([tag, name]) => html`<option value=${tag}>${name}</option>`)}</select></label>
      <label>${t("menu.theme")}
        <select value=${theme.value} onChange=${(/** @type {any} */ event) => { theme.value = event.target.value; }}>
          ${["auto", "light", "dark"].map((one) => html`<option value=${one}>${t(`theme.${one}`)}</option>`)}</select></label>
      <button type="button" class="button" aria-pressed=${soundOn.value} onClick=${() => { soundOn.value = !soundOn.value; }}>
        <${Icon} name=${soundOn.value ? "sound" : "mute"} /><span
          class="label">${t(soundOn.value ? "menu.sound_on" : "menu.sound_off")}</span></button>
      <a class="button" href="/docs">${t("menu.api")}</a>
      ${signedIn.value && html`<button type="button" class="button" data-name="sign-out"
        onClick=${signOut}>${t("menu.sign_out")}</button>`}
    </div>`}
  </div>`;
}

const signOut = () => attempt(async () => {
  await request("DELETE", "/session");
  location.reload();
});

/** @type {Record<string, string>} */
const TAB_ICONS = { machine: "gauge", programs: "file", jobs: "list", plots: "chart", console: "terminal", card: "card", tools: "tool", settings: "sliders" };
/** Pages that need something of the controller. @type {Record<string, string>} */
const NEEDS = { card: "sd", tools: "io", settings: "settings" };

export function Tabs() {
  const nav = useRef(/** @type {HTMLElement | null} */ (null));
  const { page } = route.value;
  // On a phone not all of them are in sight.
  useEffect(() => { nav.current?.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest", inline: "nearest" }); }, [page]);
  return html`<nav ref=${nav} class="tabs" aria-label=${t("tab.title")}>
    ${PAGES.filter((one) => !NEEDS[one] || can(NEEDS[one])).map((one) => html`<a key=${one} href=${to(one)}
      data-name=${`tab-${one}`}
      aria-current=${one === page ? "page" : undefined}>
      <${Icon} name=${TAB_ICONS[one]} /><span>${t(`tab.${one}`)}</span></a>`)}
  </nav>`;
}

/** Over everything while the daemon cannot be reached. */
export function Lost() {
  if (live.value || !lostAt.value) return null;
  return html`<p class="lost" role="alert" data-name="lost"><${Icon} name="offline" />
    <span><b>${t("lost.title")}</b> ${t("lost.text", { time: time(lostAt.value) })}</span></p>`;
}
