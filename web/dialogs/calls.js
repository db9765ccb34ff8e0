// What a person must answer: an alarm, a tool that is wanted, a message of the program. With sound, on every screen.
// The rule: a call is made of the state alone, so it closes everywhere when one person has answered; hiding it here
// answers nothing.

import { computed, effect, html, signal } from "../lib/ui.js";
import { t } from "../lib/i18n.js";
import { call as ring } from "../lib/sound.js";
import { onJob, verb } from "../state/actions.js";
import { activeJob } from "../state/reduce.js";
import { against, can, chosen, live, world } from "../state/store.js";
import { go, route, to } from "../lib/router.js";
import { ToolAnswers, ToolFacts } from "../tools/answers.js";
import { Button } from "../parts/button.js";
import { Dialog } from "../parts/dialog.js";
import { Icon } from "../parts/icon.js";

/** @typedef {{key: string, kind: "alarm" | "tool" | "message", machine: string, job: number | null, tool: number | null, text: string}} Call */

/**
 * Alarms before all else, and of the same the one of the machine that is looked at.
 * @param {import("../types.js").World} now @param {string | null} here @returns {Call[]}
 */
export function callsIn(now, here) {
  const names = [...now.order.filter((name) => name === here), ...now.order.filter((name) => name !== here)];
  const all = names.flatMap((name) => /** @type {Call[]} */ (callsOf(now, name)));
  return [...all.filter(({ kind }) => kind === "alarm"), ...all.filter(({ kind }) => kind !== "alarm")];
}

/** @param {import("../types.js").World} now @param {string} name */
function callsOf(now, name) {
  const { state, link } = now.machines[name];
  const job = activeJob(now, name);
  const base = { machine: name, job: job?.id ?? null, tool: null, text: "" };
  if (link === "connected" && state.status === "alarm") {
    const { alarm } = state;
    const text = `${alarm?.axis ? `${alarm.axis.toUpperCase()}: ` : ""}${alarm?.message ?? ""}`;
    return [{ ...base, kind: /** @type {const} */ ("alarm"), key: `${name} alarm ${text}`, text }];
  }
  const waits = job?.status === "waiting";
  if (!waits && state.status !== "tool") return [];
  const tool = waits ? job.tool : state.tool_requested;
  const kind = waits && tool === null ? /** @type {const} */ ("message") : /** @type {const} */ ("tool");
  const text = waits ? t("call.line", { line: job.progress.line, name: job.program_name }) : "";
  return [{ ...base, kind, tool, text, key: `${name} ${kind} ${base.job} ${tool} ${job?.progress.line}` }];
}

const calls = computed(() => (live.value ? callsIn(world.value, chosen.value) : []));
const NONE = /** @type {string[]} */ ([]);
/** The keys of those put aside on this screen. One that is put aside hides no other. */
const aside = signal(NONE);
const first = computed(() => calls.value.find((one) => !aside.value.includes(one.key)) ?? null);
const firstKey = computed(() => first.value?.key ?? "");
const kindOf = computed(() => first.value?.kind ?? null);

// A call that is over was put aside for good; the next one is a new one, even if it says the same.
effect(() => {
  const there = aside.value.filter((key) => calls.value.some((one) => one.key === key));
  if (live.value && there.length < aside.value.length) aside.value = there;
});

effect(() => {
  const kind = kindOf.value;
  return kind && firstKey.value ? ring(kind) : undefined;
});

const ICONS = { alarm: "alarm", tool: "tool", message: "interrupted" };

/** @param {Call} call */
const titleOf = ({ kind, tool }) => (kind === "tool" ? t("call.tool", { tool: tool ?? "?" }) : t(`call.${kind}`));

export function Calls() {
  const now = first.value, put = calls.value.filter((one) => aside.value.includes(one.key));
  return html`<div class="call-strips">${put.map((one) => html`<button key=${one.key} type="button" class=${`call-strip c-${one.kind}`}
      data-name="call-strip" onClick=${() => { aside.value = aside.peek().filter((key) => key !== one.key); }}>
      <${Icon} name=${ICONS[one.kind]} /><b>${titleOf(one)}</b><span>${one.machine}</span></button>`)}</div>
    ${now && html`<${Dialog} key=${now.key} title=${titleOf(now)} kind=${`c-${now.kind}`} icon=${ICONS[now.kind]}
      name="call" onClose=${() => { aside.value = [...aside.peek(), now.key]; }}>
      <p class="call-machine">${now.machine}</p>
      ${now.kind === "tool" && now.machine === chosen.value && html`<${ToolFacts} machine=${now.machine} tool=${now.tool} />`}
      ${now.text && html`<p class="call-text">${now.text}</p>`}
      <p>${t(`call.${now.kind}_text`)}</p>
      <div class="row end"><${Answers} call=${now} /></div>
    <//>`}`;
}

/** @param {{call: Call}} props */
function Answers({ call }) {
  if (call.machine !== chosen.value) {
    return html`<button type="button" class="button primary" onClick=${() => go(to(route.value.page, null, null, call.machine))}>${t("call.go_there")}</button>`;
  }
  const stop = call.job !== null && html`<${Button} name="call-stop" kind="end" icon="stop" label=${t("control.stop")}
    reason=${against("operate")}
    onPress=${() => onJob(/** @type {number} */ (call.job), "cancel")} />`;
  if (call.kind === "alarm") {
    return html`${can("home") && against("home") === null && html`<${Button} name="call-home" icon="home" label=${t("jog.home")}
      onPress=${() => verb("home")} />`}
      <${Button} name="call-unlock" kind="primary" icon="unlock" label=${t("service.unlock")} reason=${against("unlock")}
        onPress=${() => verb("unlock")} />`;
  }
  if (call.kind === "tool" && can("io")) return html`<${ToolAnswers} machine=${call.machine} stop=${stop} />`;
  return html`${stop}<${Button} name="call-confirm" kind="go" icon="run"
    label=${t(call.kind === "tool" ? "call.tool_in" : "call.go_on")}
    reason=${against("confirm")} onPress=${() => verb("tool/confirm")} />`;
}
