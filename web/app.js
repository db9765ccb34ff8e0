// The dashboard: puts the pages together. Not what they do.
// The rule: everything that is shown comes from the store; opening or reloading a page moves nothing.

import { computed, effect, html, render } from "./lib/ui.js";
import { speak, spoken, t } from "./lib/i18n.js";
import { percent } from "./lib/format.js";
import { theme } from "./lib/prefs.js";
import { route } from "./lib/router.js";
import { words } from "./estop.js";
import { connection, job, live, machine, order, status } from "./state/store.js";
import { Calls } from "./dialogs/calls.js";
import { ConsolePage } from "./console/page.js";
import { CardPage } from "./console/card.js";
import { Header, Lost, Tabs } from "./parts/frame.js";
import "./jobs/ended.js";
import { JobsPage } from "./jobs/page.js";
import { AskTakeover } from "./machine/control.js";
import { MachinePage } from "./machine/page.js";
import { Notices } from "./parts/notices.js";
import { PlotsPage } from "./telemetry/page.js";
import { ProgramsPage } from "./programs/page.js";
import { SettingsSections } from "./settings/sections.js";
import { SignIn } from "./parts/signin.js";
import { ToolsPage } from "./tools/page.js";
import { StatusBand } from "./machine/band.js";

/** @type {Record<string, () => unknown>} */
const VIEWS = { machine: MachinePage, programs: ProgramsPage, jobs: JobsPage, plots: PlotsPage, console: ConsolePage, card: CardPage, tools: ToolsPage,
  settings: SettingsSections };

const present = computed(() => machine.value !== null);

function App() {
  if (connection.value === "sign-in") return html`<${SignIn} /><${Notices} />`;
  const { page } = route.value;
  const known = order.value.length > 0;
  return html`
    <${Header} />
    <${Lost} />
    <div class=${`shell ${live.value ? "" : "stale"}`}>
      <${Tabs} />
      <main>
        ${present.value && html`<${StatusBand} large=${page === "machine"} />`}
        ${known || !live.value ? html`<${VIEWS[page]} key=${page} />` : html`<p class="empty">${t("machine.none")}</p>`}
      </main>
    </div>
    <${Calls} />
    <${AskTakeover} />
    <${Notices} />`;
}

const place = computed(() => `${route.value.page} ${route.value.id}`);
// Another page begins at its top; when it is drawn, for a scroll before that takes the keyboard's place from it.
effect(() => { if (place.value) requestAnimationFrame(() => scrollTo(0, 0)); });
// What a tab in the background shows.
effect(() => {
  const now = machine.value, part = job.value ? ` ${percent(job.value).percent} %` : "";
  document.title = now ? `${live.value ? t(`status.${status.value}`) + part : t("connection.lost")} · ${now.name}` : "millstream";
});
effect(() => { document.documentElement.dataset.theme = theme.value; });
effect(() => {
  speak(spoken.value).then(() => {
    const button = document.getElementById("estop");
    if (button) button.textContent = t("estop.label");
    button?.setAttribute("aria-label", `${t("estop.label")}: ${t("estop.title")}`);
    words.sent = t("estop.sent");
    words.failed = t("estop.failed");
    words.partly = t("estop.partly");
  }, () => {});
});
const app = /** @type {HTMLElement} */ (document.getElementById("app"));
await speak(spoken.peek()).catch(() => speak("en")).catch(() => {});
app.replaceChildren();
render(html`<${App} />`, app);
