// The status page: machines, jobs and messages over the WebSocket, and the e-stop button.
// Not the full dashboard. Two rules: what a machine or a file says is shown as text, never as markup;
// and the e-stop does not depend on the WebSocket.

const API = "/api/v1";
const RETRY_MS = 1500;
const ESTOP_ANSWER_MS = 400; // after this the stop goes out over HTTP too
const NOTICE_MS = 8000;
const LOG_LINES = 30;
const JOB_ROWS = 12;
const NARROW = 0.2; // a range no wider than this part of the estimate is shown as one figure
const ENDED = new Set(["completed", "failed", "cancelled"]);
const ACTIVE = new Set(["checking", "running", "paused", "waiting", "interrupted"]);

const byId = (id) => document.getElementById(id);
const machines = new Map(); // name -> machine of api.md
const jobs = new Map(); // id -> job of api.md
const cards = new Map(); // name -> parts of its card
const answers = new Map(); // id of a message -> what waits for its result
let socket = null;
let since = null;
let role = "public";
let messageId = 0;

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

// --- the daemon ---------------------------------------------------------------------------------------------

async function request(method, path, body) {
  const options = { method, headers: {} };
  if (body !== undefined) {
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const response = await fetch(API + path, options);
  const answer = response.status === 204 ? null : await response.json();
  if (!response.ok) throw new Error(answer.detail || answer.title);
  return answer;
}

function connect() {
  const address = new URL(`${API}/events`, location.href);
  address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  address.searchParams.set("topics", "state,job,queue,alarm,tool,log");
  address.searchParams.set("rate", "10");
  if (since !== null) address.searchParams.set("since", since);
  socket = new WebSocket(address);
  socket.addEventListener("message", (event) => receive(JSON.parse(event.data)));
  socket.addEventListener("close", disconnected);
}

async function disconnected() {
  showConnection("broken", "no connection: what you see is old");
  for (const settle of answers.values()) settle(null);
  answers.clear();
  try {
    const session = await request("GET", "/session");
    byId("sign-in").hidden = session.role !== "public";
    if (session.role === "public") {
      showConnection("broken", "sign in first");
      return;
    }
  } catch {
    // The daemon is away; try again like after any other break.
  }
  setTimeout(connect, RETRY_MS);
}

function receive(message) {
  if (message.seq > (since ?? -1)) since = message.seq;
  const { type, machine, data } = message;
  if (type === "hello") greet(data);
  else if (type === "result") answers.get(message.id)?.(message);
  else if (type === "state") setState(machine, data);
  else if (type === "job") setJob(data);
  else if (type === "alarm" && data.alarm) log(message, `alarm: ${data.alarm.message}`);
  else if (type === "tool") log(message, `tool ${data.tool ?? ""} wanted`);
  else if (type === "log") log(message, data.message ?? "");
  if (type === "queue") render();
}

function greet(data) {
  role = data.role ?? "viewer";
  machines.clear();
  jobs.clear();
  for (const machine of data.machines) machines.set(machine.name, machine);
  for (const job of data.jobs) jobs.set(job.id, job);
  showConnection("live", role === "viewer" ? "live, read only" : "live");
  byId("sign-in").hidden = true;
  if (data.problem) notice(data.problem.detail);
  request("GET", "/session").then((session) => { byId("sign-out").hidden = session.open; }, () => {});
  render();
}

function setState(name, data) {
  const machine = machines.get(name);
  if (!machine) return;
  machines.set(name, { ...machine, state: data, link: data.link ?? machine.link });
  renderMachine(name);
}

function setJob(job) {
  if (job.id === undefined) return;
  jobs.set(job.id, job);
  renderMachine(job.machine);
  renderJobs();
}

// Over the WebSocket; the result, or null when it could not be delivered.
function say(message, withinMs) {
  if (socket?.readyState !== WebSocket.OPEN) return Promise.resolve(null);
  const id = ++messageId;
  const result = new Promise((resolve) => {
    answers.set(id, resolve);
    setTimeout(resolve, withinMs, null);
  }).finally(() => answers.delete(id));
  socket.send(JSON.stringify({ ...message, id }));
  return result;
}

async function estop() {
  const result = await say({ type: "estop" }, ESTOP_ANSWER_MS);
  if (result?.ok) return notice("Emergency stop sent to every machine.");
  const names = [...machines.keys()];
  const sent = await Promise.allSettled(names.map((name) => request("POST", `/machines/${encodeURIComponent(name)}/estop`)));
  const failed = sent.flatMap((one, index) => (one.status === "rejected" ? [`${names[index]}: ${one.reason.message}`] : []));
  if (names.length === 0) notice("No machine is known here: press the emergency button at the machine.");
  else if (failed.length) notice(`NOT STOPPED BY THIS BUTTON. ${failed.join(" ")}`);
  else notice("Emergency stop sent to every machine.");
}

async function act(name, path) {
  try {
    await request("POST", `/machines/${encodeURIComponent(name)}/${path}`);
  } catch (error) {
    notice(error.message);
  }
}

// --- the page -----------------------------------------------------------------------------------------------

function showConnection(className, text) {
  byId("connection").className = className;
  byId("connection").textContent = text;
}

let noticeTimer = 0;
function notice(text) {
  byId("notice").textContent = text;
  byId("notice").hidden = false;
  clearTimeout(noticeTimer);
  noticeTimer = setTimeout(() => { byId("notice").hidden = true; }, NOTICE_MS);
}

function log(message, text) {
  const at = new Date(message.at).toLocaleTimeString();
  byId("log").prepend(element("li", "", `${at}  ${message.machine ?? ""}  ${text}`));
  while (byId("log").childElementCount > LOG_LINES) byId("log").lastElementChild.remove();
  byId("messages").hidden = false;
}

function render() {
  for (const [name, parts] of cards) {
    if (!machines.has(name)) {
      parts.card.remove();
      cards.delete(name);
    }
  }
  for (const name of machines.keys()) renderMachine(name);
  renderJobs();
}

function makeCard(name) {
  const card = element("article", "card");
  const title = element("h2");
  const status = element("span", "status");
  title.append(element("span", "", name), status);
  const parts = { card, status, alarm: element("p", "alarm-text"), tool: element("p", "tool-text"),
    axes: element("ul", "axes"), figures: element("p", "figures"), job: element("p"), bar: element("progress"),
    left: element("p", "figures"), buttons: {} };
  const actions = element("div", "actions");
  for (const [path, label] of [["pause", "Pause"], ["resume", "Resume"], ["stop", "Stop job"],
    ["tool/confirm", "Tool is in"], ["unlock", "Clear alarm"], ["connect", "Connect"]]) {
    const button = element("button", "", label);
    button.type = "button";
    button.addEventListener("click", () => act(name, path));
    parts.buttons[path] = button;
    actions.append(button);
  }
  card.append(title, parts.alarm, parts.tool, parts.axes, parts.figures, parts.job, parts.bar, parts.left, actions);
  byId("machines").append(card);
  cards.set(name, parts);
  return parts;
}

function renderMachine(name) {
  const machine = machines.get(name);
  if (!machine) return;
  const parts = cards.get(name) ?? makeCard(name);
  const { state, link } = machine;
  const job = [...jobs.values()].find((one) => one.machine === name && ACTIVE.has(one.status));
  const offline = link !== "connected";
  parts.card.className = `card ${offline ? "offline" : state.status}`;
  parts.status.textContent = offline ? link : state.status;
  show(parts.alarm, state.alarm && `Alarm${state.alarm.axis ? ` on ${state.alarm.axis.toUpperCase()}` : ""}: ${state.alarm.message}`);
  const tool = job?.status === "waiting" ? job.tool : state.tool_requested;
  const waits = job?.status === "waiting" || state.status === "tool";
  show(parts.tool, waits && `Put in tool ${tool ?? "?"}, then confirm.`);
  parts.axes.replaceChildren(...Object.entries(state.position.work).map(([axis, value]) => {
    const item = element("li");
    item.append(element("b", "", axis), element("span", "", value.toFixed(3)));
    return item;
  }));
  parts.figures.textContent = [state.feed !== null && `F ${state.feed} mm/min`, state.spindle !== null && `S ${state.spindle} rpm`,
    state.tool !== null && `T ${state.tool}`, state.absolute === false && "relative"].filter(Boolean).join(" · ");
  renderProgress(parts, job);
  const shown = { pause: job?.status === "running" || job?.status === "waiting", resume: job?.status === "paused", stop: Boolean(job),
    "tool/confirm": waits, unlock: state.status === "alarm", connect: link === "disconnected" };
  for (const [path, button] of Object.entries(parts.buttons)) {
    button.hidden = !shown[path];
    button.disabled = role === "viewer";
  }
}

function renderProgress(parts, job) {
  parts.bar.hidden = !job;
  show(parts.job, job && `${job.program_name ?? `Job ${job.id}`}: ${job.status}${job.error ? `, ${job.error.message}` : ""}`);
  if (!job) return show(parts.left, "");
  const { line, lines, seconds_elapsed: elapsed } = job.progress;
  parts.bar.max = Math.max(lines, 1);
  parts.bar.value = line;
  show(parts.left, [`line ${line} of ${lines}`, elapsed !== null && `${clock(elapsed)} so far`,
    remaining(job.progress)].filter(Boolean).join(" · "));
}

function renderJobs() {
  const rows = [...jobs.values()].sort((a, b) => b.id - a.id);
  const open = rows.filter((job) => !ENDED.has(job.status));
  const listed = [...open, ...rows.filter((job) => ENDED.has(job.status))].slice(0, JOB_ROWS);
  byId("jobs").replaceChildren(...listed.map((job) => {
    const row = element("tr");
    const status = job.error ? `${job.status}: ${job.error.message}` : job.status;
    // The last lines of a program are often a % and nothing else: "1066 of 1067" of a completed job would only puzzle.
    const { line, lines } = job.progress;
    const done = job.status === "completed" ? lines : `${line} / ${lines}`;
    for (const text of [job.id, job.program_name ?? job.program, job.machine, status, done]) {
      row.append(element("td", "", String(text)));
    }
    return row;
  }));
  byId("waiting").hidden = listed.length === 0;
}

function show(part, text) {
  part.textContent = text || "";
  part.hidden = !text;
}

/** What is left in words: one figure, or a range while it is uncertain. */
function remaining({ seconds_left: left, seconds_left_min: least, seconds_left_max: most }) {
  if (left === null) return "";
  const narrow = most - least <= NARROW * left || duration(least) === duration(most);
  return narrow ? `about ${duration(left)} left` : `${duration(least)} to ${duration(most)} left`;
}

function duration(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 90 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

function clock(seconds) {
  const whole = Math.round(seconds);
  const minutes = Math.floor(whole / 60);
  return minutes >= 60 ? `${Math.floor(minutes / 60)} h ${minutes % 60} min` : `${minutes}:${String(whole % 60).padStart(2, "0")}`;
}

byId("estop").addEventListener("click", estop);
byId("sign-out").addEventListener("click", async () => {
  await request("DELETE", "/session");
  location.reload();
});
byId("sign-in").addEventListener("submit", async (event) => {
  event.preventDefault();
  try {
    await request("POST", "/session", { token: byId("token").value });
    byId("token").value = "";
    byId("sign-in").hidden = true;
    connect();
  } catch (error) {
    notice(error.message);
  }
});
connect();
