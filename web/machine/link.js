// How good the link is: repeats, errors by kind, age of the last report, and the way from this page to the daemon.
// The rule: counted by the daemon, not judged here; a number that is not 0 is worth a look at the cable.

import { html, useEffect, useState } from "../lib/ui.js";
import { number, t } from "../lib/i18n.js";
import { daemon } from "../net/daemon.js";
import { live, machine, secondsSince } from "../state/store.js";

const EVERY_MS = 1000;

export function LinkPanel() {
  const [, tick] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => tick((n) => n + 1), EVERY_MS);
    return () => clearInterval(timer);
  }, []);
  const now = machine.value;
  if (!now) return null;
  const { retries = 0, errors = {} } = now.link_stats;
  const kinds = Object.entries(errors).filter(([, count]) => count > 0);
  const total = kinds.reduce((sum, [, count]) => sum + count, 0);
  const { at } = now.state;
  const age = at === null ? null : secondsSince(at);
  return html`<section class="panel link" aria-label=${t("link.title")}>
    <h2>${t("link.title")} <small>${now.port}</small></h2>
    <dl>
      <div><dt>${t("link.state")}</dt><dd>${t(`link.${now.link}`)}</dd></div>
      <div><dt>${t("link.retries")}</dt><dd class=${retries ? "warn" : ""} data-name="retries">${number(retries)}</dd></div>
      <div><dt>${t("link.errors")}</dt><dd class=${total ? "warn" : ""} data-name="errors">${number(total)}</dd></div>
      <div><dt>${t("link.age")}</dt><dd>${age === null ? "–" : age < 90 ? `${number(age)} ${t("unit.s")}` : `${number(age / 60)} ${t("unit.min")}`}</dd></div>
      <div><dt>${t("link.round_trip")}</dt><dd>${live.value && daemon.roundTripMs !== null ? `${number(daemon.roundTripMs)} ${t("unit.ms")}` : "–"}</dd></div>
    </dl>
    ${kinds.length > 0 && html`<p class="kinds">${kinds.map(([kind, count]) => html`<span
      key=${kind}>${kind}: ${number(count)}</span>`)}</p>`}
  </section>`;
}
