// What a person can answer to a wanted tool: it is in, it cannot be changed. In the dialog of calls.js.
// The rule: only what the changer of this machine takes from a person; where a device changes the tool, people watch.

import { html, useEffect, useState } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { get } from "../net/http.js";
import { verb } from "../state/actions.js";
import { against, can } from "../state/store.js";
import { Button } from "../parts/button.js";
import { useIo } from "./io.js";

/** What the tool table says of a tool. @param {{machine: string, tool: number | null}} props */
export function ToolFacts({ machine, tool }) {
  const [known, setKnown] = useState(/** @type {any} */ (null));
  const able = can("tools") && tool !== null;
  useEffect(() => {
    let wanted = able;
    if (able) {
      get(`/machines/${encodeURIComponent(machine)}/tools`).then(({ tools }) => {
        if (wanted) setKnown((tools ?? []).find((/** @type {{number: number}} */ one) => one.number === tool) ?? null);
      }, () => {});
    }
    return () => { wanted = false; };
  }, [machine, tool, able]);
  const said = known ? [known.diameter ? `⌀ ${known.diameter} ${t("unit.mm")}` : "", known.comment ?? ""].filter(Boolean).join(" · ") : "";
  return said && html`<p class="call-text" data-name="tool-facts">${said}</p>`;
}

/** @param {{machine: string, stop: unknown}} props */
export function ToolAnswers({ machine, stop }) {
  const { io } = useIo(machine);
  if (!io) return html`${stop}`;
  // The changer has given up, but the controller still asks: it is told that a tool is in, and stands.
  const left = io.waiting_for === null;
  return html`<div class="tool-answers">
    ${!io.may_confirm && io.waiting_for && html`<p class="hint" data-name="call-changer">${t(io.connected ? "tools.changer_works" : "tools.changer_away", { pin: io.waiting_for })}</p>`}
    ${io.overdue && html`<p class="problem">${t("tools.overdue")}</p>`}
    <div class="row end">${stop}
      ${io.may_fail && html`<${Button} name="call-fail" kind="end" label=${t("tools.fail")} reason=${against("operate")} onPress=${() => verb("tool/fail")} />`}
      ${(io.may_confirm || left) && html`<${Button} name="call-confirm" kind="go" icon="run" label=${t("call.tool_in")} reason=${against("confirm")}
        onPress=${() => verb("tool/confirm")} />`}</div></div>`;
}
