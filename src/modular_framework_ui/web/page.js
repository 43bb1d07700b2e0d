// SPDX-License-Identifier: BSD-3-Clause
// Shows the state of a task from the changes that the server sends; page_protocol.py defines the messages.

import { isSide, onPairMessage, tellPair } from "./pair_link.js";
import { Player } from "./player.js";
import { Plots } from "./plots.js";

const RETRY_MS = 1000;
const AXIS_STEPS_S = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600];
const PLOT_PERIOD_MS = 200;
const MAX_ITEMS = 300; // per list
const ROUNDING_S = 1e-4;
const MARGIN_S = 0.5; // log lines within this time of a selected run belong to the run

// A frame from another host name has its own browser process, so the view of the world does not slow down the page.
const OTHER_LOOPBACK_NAMES = { "127.0.0.1": "localhost", localhost: "127.0.0.1" };

const element = (id) => document.getElementById(id);

/** State received from the server; times are in seconds of the server's clock. */
const state = { task: null, runs: new Map(), log: new Map(), samples: new Map(), joints: [], drawing: "", viewer: "", record: { title: "", omissions: [], marks: [] }, offset_s: 0, selected: null, view_s: null, pair_s: 0 };
const rows = new Map(); // rows of the time line, keyed by state path
const bars = new Map(); // bars of the time line, keyed by run index
let socket = null;
const plots = new Plots(element("plots"), (time_s) => { showCursor(time_s); tellPair({ cursor_s: time_s }); });

function make(kind, className, text) {
  const made = document.createElement(kind);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

const now_s = () => performance.now() / 1000 + state.offset_s;
const seconds = (value) => `${value.toFixed(1)} s`;
const sinceStart = (time_s) => time_s - state.task.start_s;
/** Returns the shown time, in seconds of the server's clock; infinite for the latest state. */
const viewed_s = () => (state.view_s === null ? Infinity : state.task.start_s + state.view_s + ROUNDING_S);

/** Returns the runs as they were at the shown time. */
function viewedRuns() {
  const started = [...state.runs.values()].filter((run) => run.start_s <= viewed_s());
  return started.map((run) => (run.end_s === null || run.end_s <= viewed_s() ? run
    : { ...run, end_s: null, outcome: "", reason: "", has_failed: false, outputs: {} }));
}

const shortName = (path) => path.split("/").slice(2).join("/");

function kindOf(run) {
  if (run.end_s === null) return "active";
  if (run.has_failed) return "failed";
  return run.outcome === "" ? "unknown" : "done";
}

function describe(run) {
  const name = shortName(run.path);
  const start = seconds(sinceStart(run.start_s));
  if (run.end_s === null) return `${name}: running since ${start}`;
  const outcome = run.outcome === "" ? "ended, outcome unknown" : run.outcome;
  const reason = run.reason === "" ? "" : `. ${run.reason}`;
  return `${name}: ${outcome}, ${start} to ${seconds(sinceStart(run.end_s))}${reason}`;
}

// ---- messages ------------------------------------------------------------------------------------------------------
function receive(message) {
  state.offset_s = message.now_s - performance.now() / 1000;
  const isNewTask = state.task === null || state.task.number !== message.task.number;
  if (isNewTask) {
    state.runs.clear();
    state.samples.clear();
    state.view_s = null;
    state.record = message.record;
    select(null);
    clearTimeLine();
  }
  state.task = message.task;
  merge(state.runs, message.runs, message.oldest_run);
  merge(state.log, message.log, message.oldest_line);
  merge(state.samples, message.samples, message.oldest_sample);
  state.joints = message.joints;
  if (message.drawing !== null) showDrawing(message.drawing);
  if (message.viewer !== state.viewer) showWorld(message.viewer);
  showTask();
  colourGraph(message.runs.some((run) => run.end_s === null));
  if (isNewTask || message.runs.length > 0) {
    showTimeLine();
    showRuns();
    showState();
  }
  if (isNewTask || message.log.length > 0) showLog();
  if (isNewTask || message.samples.length > 0) arePlotsOld = true;
  if (isNewTask && message.task.phase !== "waiting") tellPair({ end_s: end_s() });
  if (isNewTask) showRecordedWorld();
}

function merge(entries, changed, oldest) {
  for (const entry of changed) entries.set(entry.index, entry);
  for (const index of entries.keys()) { // ascending
    if (index >= oldest) break;
    entries.delete(index);
  }
}

function connect() {
  const address = new URL(`live${location.search}`, location.href);
  address.protocol = address.protocol.replace("http", "ws");
  socket = new WebSocket(address);
  let isFirst = true;
  socket.onmessage = (event) => {
    if (isFirst) { // a restarted server restarts its indices
      isFirst = false;
      state.task = null;
      state.log.clear();
      element("connection").textContent = "";
    }
    const message = JSON.parse(event.data);
    if (message.fault === undefined) { receive(message); return; }
    socket.onclose = null;
    setText("sentence", message.fault);
  };
  socket.onclose = () => {
    element("connection").textContent = "Connection lost. The page shows the last known state.";
    setTimeout(connect, RETRY_MS);
  };
}

/** Adds links to the other episodes of the experiment, if the address names an episode. */
async function showRunLinks() {
  const number = new URLSearchParams(location.search).get("episode");
  if (number === null || isSide) return;
  const answer = await fetch(`run.json?episode=${number}`);
  const partners = answer.ok ? (await answer.json()).partners : [];
  const links = partners.map((partner) => [`Side by side with ${partner.number} (${partner.method})`, `./?pair=${number},${partner.number}`]);
  for (const [text, target] of [...links, ["All episodes", "./"]]) {
    const link = make("a", "", text);
    link.href = target;
    element("run-links").append(link);
  }
}

// ---- summary of the task -------------------------------------------------------------------------------------------
const PHASES = {
  waiting: "waiting", running: "running", succeeded: "succeeded", failed: "failed", ended: "ended", lost: "lost",
};

function showTask() {
  const { task } = state;
  const name = task.root.replace(/^\//, "") || "No task";
  element("name").textContent = state.record.title === "" ? name : `${name}, ${state.record.title}`;
  document.title = `${name}: ${task.phase}`;
  element("phase").textContent = PHASES[task.phase];
  element("phase").className = `badge ${task.phase}`;
  setText("sentence", sentence(task));
  showElapsed();
}

function setText(id, text) { // setting the same text makes a screen reader repeat it
  if (element(id).textContent !== text) element(id).textContent = text;
}

function sentence(task) {
  if (viewed_s() < (task.end_s ?? Infinity)) return `At ${seconds(state.view_s)}: ${runningSentence(task)}`;
  const ending = task.outcome === "" ? "" : ` with outcome '${task.outcome}'`;
  switch (task.phase) {
    case "waiting": return "Waiting for a task. The page shows the next task automatically.";
    case "running": return runningSentence(task);
    case "succeeded": return `The task succeeded${ending}.`;
    case "failed": return `The task failed${ending}. ${task.reason}`;
    case "lost": return task.reason;
    default: return `The task ended${ending}. Its topics do not state whether it succeeded.`;
  }
}

function runningSentence(task) {
  const running = viewedRuns().filter((run) => run.end_s === null && !run.is_machine);
  const names = running.map((run) => {
    const activity = state.view_s === null ? task.feedback[run.path] : "";
    return activity ? `${shortName(run.path)} (${activity})` : shortName(run.path);
  });
  return names.length === 0 ? "Between two states." : `Running: ${names.join(", ")}.`;
}

function showElapsed() {
  const { task } = state;
  const isStarted = task !== null && task.phase !== "waiting";
  element("elapsed").textContent = isStarted ? seconds(sinceStart(task.end_s ?? now_s())) : "";
}

// ---- state machine -------------------------------------------------------------------------------------------------
function showDrawing(text) {
  state.drawing = text;
  const svg = text === "" ? null : new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
  element("graph").replaceChildren(...(svg === null ? [] : [document.importNode(svg, true)]));
  for (const title of element("graph").querySelectorAll("title")) title.remove(); // node names by Graphviz
  for (const link of element("graph").querySelectorAll("a")) link.removeAttributeNS("http://www.w3.org/1999/xlink", "title");
  for (const node of element("graph").querySelectorAll(".node")) {
    if (node.id.includes("|") || node.id === "") continue; // outcomes
    node.setAttribute("tabindex", "0");
    node.setAttribute("role", "button");
    node.addEventListener("click", () => selectLast(`/${node.id}`));
    node.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === " ") { event.preventDefault(); selectLast(`/${node.id}`); }
    });
  }
  fit();
}

function selectLast(path) {
  const found = [...state.runs.values()].filter((run) => run.path === path);
  select(found.length === 0 ? null : found[found.length - 1].index);
}

function colourGraph(follows) {
  const last = new Map();
  const taken = new Set();
  for (const run of viewedRuns()) {
    last.set(run.path, run);
    if (run.outcome !== "") taken.add(`${run.path} ${run.outcome}`);
  }
  for (const part of element("graph").querySelectorAll("g[id]")) {
    if (part.classList.contains("edge")) {
      part.classList.toggle("taken", taken.has(`/${part.id}`));
      continue;
    }
    const run = last.get(`/${part.id}`);
    const kind = run === undefined ? "" : kindOf(run);
    for (const name of ["active", "failed", "done", "unknown"]) part.classList.toggle(name, name === kind);
    part.classList.toggle("selected", run !== undefined && run.path === state.runs.get(state.selected)?.path);
    if (part.getAttribute("role") === "button") {
      part.setAttribute("aria-label", run === undefined ? `${part.id.split("/").pop()}: not run` : describe(run));
    }
  }
  if (follows) scrollToActive();
}

function scrollToActive() {
  const box = element("graph").getBoundingClientRect();
  const active = element("graph").querySelector(".node.active")?.getBoundingClientRect();
  if (active === undefined || (active.top >= box.top && active.bottom <= box.bottom && active.left >= box.left && active.right <= box.right)) return;
  element("graph").scrollTop += active.top + active.height / 2 - box.top - box.height / 2;
  element("graph").scrollLeft += active.left + active.width / 2 - box.left - box.width / 2;
}

function fit() {
  element("graph").classList.toggle("fit", element("fit").getAttribute("aria-pressed") === "true");
}

// ---- world ---------------------------------------------------------------------------------------------------------
function showWorld(address) {
  state.viewer = address;
  element("world-panel").hidden = address === "";
  const isShown = address !== "" && element("world-switch").getAttribute("aria-pressed") === "true";
  element("panels").classList.toggle("without-world", address === "");
  element("panels").classList.toggle("world-off", address !== "" && !isShown);
  if (!isShown) {
    element("world").replaceChildren();
    return;
  }
  const url = new URL(address);
  url.hostname = OTHER_LOOPBACK_NAMES[location.hostname] ?? location.hostname; // the browser may run on another computer
  const frame = make("iframe");
  frame.title = "World";
  frame.setAttribute("sandbox", "allow-scripts allow-same-origin");
  frame.src = url.href;
  element("world").replaceChildren(frame);
}

/** Tells the server of a record the shown time, so that the world is drawn at this time. */
function showRecordedWorld() {
  const isRecord = state.record.title !== "" && state.viewer !== "";
  if (isRecord && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ view_s: state.view_s }));
}

// ---- time line -----------------------------------------------------------------------------------------------------
function clearTimeLine() {
  rows.clear();
  bars.clear();
  element("time").replaceChildren(make("div", "row axis"));
  element("time").firstChild.append(make("span", "", "Time"), make("div", "bars"));
  delete element("time").dataset.step;
  element("time").classList.remove("with-view");
  element("time").append(...state.record.marks.map(markRow));
}

/** Returns the row of a milestone. */
function markRow(mark) {
  const row = make("div", "row");
  const isMissed = mark.time_s === null;
  row.append(make("span", "", `◆ ${mark.name}`), make("div", "bars"));
  row.firstChild.title = isMissed ? `milestone ${mark.name}: missed` : `milestone ${mark.name}: ${seconds(mark.time_s)}`;
  const shown = make("span", isMissed ? "mark missed" : "mark", isMissed ? "missed" : "◆");
  shown.style.setProperty("--start", mark.time_s ?? 0);
  row.lastChild.append(shown);
  return row;
}

function rowOf(run) {
  if (!rows.has(run.path)) {
    const row = make("div", "row");
    const label = make("span", "", shortName(run.path));
    label.title = shortName(run.path);
    row.append(label, make("div", "bars"));
    rows.set(run.path, row);
    element("time").append(row);
  }
  rows.get(run.path).classList.toggle("machine", run.is_machine);
  return rows.get(run.path);
}

function showTimeLine() {
  for (const [index, bar] of bars) {
    if (!state.runs.has(index)) { bar.remove(); bars.delete(index); }
  }
  for (const run of state.runs.values()) {
    if (!bars.has(run.index)) {
      const bar = make("button", "bar");
      bar.type = "button";
      bar.addEventListener("click", () => select(run.index));
      rowOf(run).lastChild.append(bar);
      bars.set(run.index, bar);
    }
    rowOf(run);
    const bar = bars.get(run.index);
    bar.className = `bar ${kindOf(run)}${run.index === state.selected ? " selected" : ""}`;
    bar.style.setProperty("--start", Math.max(0, sinceStart(run.start_s)));
    if (run.end_s !== null) bar.style.setProperty("--end", sinceStart(run.end_s));
    bar.title = describe(run);
    bar.setAttribute("aria-label", describe(run));
    bar.textContent = run.has_failed ? "✕" : "";
  }
  moveTimeLine();
}

function moveTimeLine() {
  if (state.task === null || state.task.phase === "waiting") return;
  const elapsed_s = Math.max(1, sinceStart(state.task.end_s ?? now_s()), ...state.record.marks.map((mark) => mark.time_s ?? 0), state.pair_s);
  for (const [index, bar] of bars) {
    if (state.runs.get(index)?.end_s === null) bar.style.setProperty("--end", elapsed_s);
  }
  const step_s = AXIS_STEPS_S.find((step) => elapsed_s / step <= 8) ?? Math.ceil(elapsed_s / 8);
  const total_s = Math.ceil(elapsed_s / step_s) * step_s;
  const time = element("time");
  time.style.setProperty("--total", total_s);
  alignPlots(total_s);
  showMoment(total_s);
  if (time.dataset.step === `${step_s} ${total_s}`) return;
  time.dataset.step = `${step_s} ${total_s}`;
  const marks = [];
  for (let at_s = 0; at_s < total_s; at_s += step_s) {
    const mark = make("span", "", `${at_s} s`);
    mark.style.setProperty("--start", at_s);
    marks.push(mark);
  }
  time.firstChild.lastChild.replaceChildren(...marks);
}

// ---- plots ---------------------------------------------------------------------------------------------------------
let arePlotsOld = false;

/** Gives the plots the time axis of the time line. */
function alignPlots(total_s) {
  const outer = element("scrub").getBoundingClientRect();
  const inner = element("time").querySelector(".bars").getBoundingClientRect();
  const right = Math.round(outer.right - inner.right);
  element("scrub").lastElementChild.style.marginRight = `${right}px`;
  plots.setAxis(total_s, Math.round(inner.left - outer.left), right);
}

function showPlots() {
  if (!arePlotsOld || state.task === null) return;
  arePlotsOld = false;
  const samples = [...state.samples.values()].map((sample) => ({ ...sample, time_s: sinceStart(sample.time_s) }));
  plots.setSamples(state.joints, samples);
}

function showQuantities() {
  const pressed = element("quantities").querySelectorAll('[aria-pressed="true"]');
  plots.show([...pressed].map((button) => button.value));
}

/** Shows a time [s since the start of the task] in the time line; null hides the cursor. */
function showCursor(time_s) {
  element("time").classList.toggle("with-cursor", time_s !== null);
  element("time").style.setProperty("--cursor", time_s ?? 0);
  const shown_s = time_s ?? state.view_s;
  element("time").querySelector(".axis span").textContent = shown_s === null ? "Time" : `Time ${shown_s.toFixed(2)} s`;
}

/** Returns the time at a position of the mouse in the time line [s since the start of the task]; null beside it. */
function timeAt(event) {
  const inner = element("time").querySelector(".bars").getBoundingClientRect();
  const fraction = (event.clientX - inner.left) / inner.width;
  return fraction < 0 || fraction > 1 ? null : fraction * Number(element("time").style.getPropertyValue("--total"));
}

for (const button of element("quantities").children) {
  button.addEventListener("click", () => {
    button.setAttribute("aria-pressed", button.getAttribute("aria-pressed") !== "true");
    showQuantities();
  });
}
element("time").addEventListener("mousemove", (event) => {
  plots.setCursor(timeAt(event));
  showCursor(timeAt(event));
  tellPair({ cursor_s: timeAt(event) });
});
element("time").addEventListener("mouseleave", () => {
  plots.setCursor(state.view_s);
  showCursor(null);
  tellPair({ cursor_s: null });
});
new ResizeObserver(() => plots.build()).observe(element("plots"));

// ---- shown time ----------------------------------------------------------------------------------------------------
const player = new Player(element("play"), end_s, view);

/** Shows the task at a time [s since its start]; null shows the latest state. */
function view(view_s) {
  state.view_s = view_s;
  showRecordedWorld();
  element("time").classList.toggle("with-view", view_s !== null);
  element("time").style.setProperty("--view", view_s ?? 0);
  plots.setCursor(view_s);
  showCursor(null);
  moveTimeLine();
  showTask();
  colourGraph(true);
  showRuns();
  showState();
  showLog();
}

/** Shows a time as `view`, in both episodes of a pair. */
function viewInPair(view_s) {
  view(view_s);
  tellPair({ view_s });
}

function end_s() {
  return sinceStart(state.task.end_s ?? now_s());
}

/** Shows the shown time on the slider, whose range is the time axis. */
function showMoment(total_s) {
  const slider = element("moment");
  slider.max = total_s;
  slider.value = state.view_s ?? end_s();
  slider.setAttribute("aria-valuetext", state.view_s === null ? "latest" : seconds(state.view_s));
  element("latest").disabled = state.view_s === null;
}

/** Advances the shown time with the clock, from the start if the latest state is shown. */
function togglePlaying() {
  if (player.isPlaying) { player.stop(); return; }
  if (state.task === null || state.task.phase === "waiting") return;
  select(null);
  player.start(state.view_s ?? 0);
}

/** Shows the first failure of a state after the shown time, or the first failure of the task. */
function showNextFailure() {
  player.stop();
  const failed = [...state.runs.values()].filter((run) => run.has_failed && !run.is_machine).sort((first, second) => first.end_s - second.end_s);
  const next = failed.find((run) => state.view_s !== null && run.end_s > viewed_s()) ?? failed[0];
  if (next === undefined) return;
  select(next.index);
  viewInPair(sinceStart(next.end_s));
}

element("moment").addEventListener("input", () => {
  player.stop();
  if (state.task === null || state.task.phase === "waiting") return;
  const chosen_s = Number(element("moment").value); // before the selection is redrawn, which sets the slider
  select(null);
  viewInPair(Math.min(chosen_s, Math.max(end_s(), state.pair_s)));
});
element("play").addEventListener("click", togglePlaying);
element("failure").addEventListener("click", showNextFailure);
element("latest").addEventListener("click", () => { player.stop(); view(null); });

onPairMessage(({ data, source }) => {
  if (source !== window.parent || !isSide || state.task === null) return;
  if (data.total_s !== undefined) {
    state.pair_s = data.total_s;
    moveTimeLine();
  }
  if (data.view_s !== undefined) view(data.view_s);
  if (data.cursor_s !== undefined) {
    plots.setCursor(data.cursor_s ?? state.view_s);
    showCursor(data.cursor_s);
  }
});

// ---- state ---------------------------------------------------------------------------------------------------------
/** Returns the selected run, or else the latest running state, or else the latest ended state. */
function shownRun() {
  const runs = viewedRuns().filter((run) => !run.is_machine).reverse();
  return state.runs.get(state.selected) ?? runs.find((run) => run.end_s === null) ?? runs[0];
}

function showState() {
  const run = shownRun();
  if (run === undefined) {
    element("state").replaceChildren(make("p", "empty", "No state has started."));
    return;
  }
  const heading = make("p", "");
  heading.append(make("b", "", shortName(run.path)));
  if (run.location !== "") {
    const location = make("span", "location", shortLocation(run.location));
    location.title = run.location;
    heading.append(location);
  }
  element("state").replaceChildren(heading, userdataTable(run));
}

/** Returns the file name and the line of a location "folder/file:line:column". */
function shortLocation(location) {
  const [, file, line] = location.match(/([^/]*):(\d+):\d+$/) ?? [null, location, ""];
  return line === "" ? file : `${file}, line ${line}`;
}

function userdataTable(run) {
  const keys = [...new Set([...Object.keys(run.inputs), ...Object.keys(run.outputs)])];
  if (keys.length === 0) return make("p", "empty", "No userdata.");
  const table = make("table");
  table.append(userdataRow(["Userdata", "at the start", "written"], "th"));
  for (const key of keys) table.append(userdataRow([key, run.inputs[key] ?? "", run.outputs[key] ?? ""], "td"));
  return table;
}

function userdataRow(texts, kind) {
  const row = make("tr");
  row.append(make("th", "", texts[0]), ...texts.slice(1).map((text) => make(kind, "", text)));
  return row;
}

// ---- lists ---------------------------------------------------------------------------------------------------------
function showRuns() {
  const ended = viewedRuns().filter((run) => run.end_s !== null);
  ended.sort((first, second) => second.end_s - first.end_s || second.index - first.index);
  const items = ended.slice(0, MAX_ITEMS).map((run) => {
    const item = make("li", `${kindOf(run)}${run.is_machine ? " machine" : ""}${run.index === state.selected ? " selected" : ""}`);
    item.append(make("span", "when", seconds(sinceStart(run.end_s))), make("b", "", shortName(run.path)), " ");
    item.append(make("span", "outcome", run.outcome === "" ? "outcome unknown" : run.outcome));
    item.append(` after ${seconds(run.end_s - run.start_s)}`);
    if (run.reason !== "") item.append(make("span", "reason", run.reason));
    return item;
  });
  replaceItems("runs", items, "No state has ended.");
}

function showLog() {
  const run = state.runs.get(state.selected);
  const lines = [...state.log.values()].filter((line) => line.time_s <= viewed_s()).filter(
    (line) => run === undefined || (line.time_s >= run.start_s - MARGIN_S && line.time_s <= (run.end_s ?? Infinity) + MARGIN_S),
  );
  const items = lines.reverse().slice(0, MAX_ITEMS).map((line) => {
    const item = make("li", line.level);
    const isStarted = state.task !== null && state.task.phase !== "waiting";
    item.append(make("span", "when", isStarted ? seconds(sinceStart(line.time_s)) : ""));
    item.append(make("span", "level", line.level), " ", make("b", "", line.node), ` ${line.text}`);
    return item;
  });
  const { omissions } = state.record;
  if (omissions.length > 0) items.unshift(make("li", "empty", `Not shown: ${omissions.join(", ")}.`));
  replaceItems("log", items, run === undefined ? "No warning and no error." : "No warning and no error at this time.");
}

function replaceItems(id, items, empty) {
  element(id).replaceChildren(...(items.length === 0 ? [make("li", "empty", empty)] : items));
}

// ---- selection -----------------------------------------------------------------------------------------------------
function select(index) {
  state.selected = index;
  const run = state.runs.get(index);
  element("selected").textContent = run === undefined ? "" : describe(run);
  element("selected").title = element("selected").textContent;
  element("deselect").hidden = run === undefined;
  if (state.task === null) return;
  colourGraph(false);
  showTimeLine();
  showRuns();
  showState();
  showLog();
}

element("deselect").addEventListener("click", () => select(null));
element("fit").addEventListener("click", () => {
  const button = element("fit");
  button.setAttribute("aria-pressed", button.getAttribute("aria-pressed") !== "true");
  fit();
  scrollToActive();
});
element("world-switch").addEventListener("click", () => {
  const button = element("world-switch");
  button.setAttribute("aria-pressed", button.getAttribute("aria-pressed") !== "true");
  showWorld(state.viewer);
});

document.body.classList.toggle("side", isSide);
clearTimeLine();
showWorld("");
showRunLinks();
showQuantities();
connect();
setInterval(showPlots, PLOT_PERIOD_MS);
setInterval(() => {
  if (state.task !== null && state.task.phase === "running") { showElapsed(); moveTimeLine(); }
}, 100);
