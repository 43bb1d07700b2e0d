// SPDX-License-Identifier: BSD-3-Clause
// Lists the finished episodes of an experiment, with filters that are part of the address.

const FILTERS = ["method", "status", "failure_class"];
const MAX_ROWS = 1000;
const element = (id) => document.getElementById(id);
let run = null;

function make(kind, className, text) {
  const made = document.createElement(kind);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

function link(text, query) {
  const made = make("a", "", text);
  made.href = `./?${query}`;
  return made;
}

async function load() {
  const answer = await fetch("run.json");
  if (!answer.ok) {
    element("sentence").textContent = await answer.text();
    return;
  }
  run = await answer.json();
  element("name").textContent = run.title;
  document.title = `${run.title}: episodes`;
  const chosen = new URLSearchParams(location.search);
  for (const name of FILTERS) fillFilter(name, chosen.get(name) ?? "");
  show();
}

/** Adds the occurring values to a filter; a chosen value without episodes stays visible. */
function fillFilter(name, chosen) {
  const values = new Set(run.episodes.map((episode) => episode[name]).filter((value) => value !== ""));
  if (chosen !== "") values.add(chosen);
  element(name).replaceChildren(new Option("all", ""), ...[...values].sort().map((value) => new Option(value, value)));
  element(name).value = chosen;
  element(name).addEventListener("change", () => {
    const query = new URLSearchParams(FILTERS.map((each) => [each, element(each).value]).filter(([, value]) => value !== ""));
    history.replaceState(null, "", `?${query}`);
    show();
  });
}

function show() {
  const found = run.episodes.filter((episode) => FILTERS.every((name) => ["", episode[name]].includes(element(name).value)));
  const shown = found.slice(0, MAX_ROWS);
  const rest = shown.length < found.length ? ` The first ${shown.length} are listed.` : "";
  const running = run.episodes.length < run.planned ? ` of ${run.planned} planned` : "";
  element("sentence").textContent = `${found.length} of ${run.episodes.length} finished${running} episodes.${rest}`;
  const table = make("table");
  const heading = make("tr");
  const titles = ["Episode", run.compared, "Other levels", "Trial", "Outcome", "Failure class", "Progress", "Task time", "Reason", "Side by side with"];
  heading.append(...titles.map((title) => make("th", "", title)));
  const byNumber = new Map(run.episodes.map((episode) => [episode.number, episode]));
  table.append(heading, ...shown.map((episode) => row(episode, byNumber)));
  element("episodes").replaceChildren(table);
}

function row(episode, byNumber) {
  const made = make("tr", episode.status === "succeeded" ? "" : "failed");
  const number = make("td");
  if (episode.is_replayable) number.append(link(episode.number, `episode=${episode.number}`));
  else number.append(`${episode.number} (no record of the task)`);
  const partners = make("td");
  for (const other of episode.partners.map((each) => byNumber.get(each))) {
    if (!episode.is_replayable || !other.is_replayable) continue;
    partners.append(link(`${other.number} (${other.method})`, `pair=${episode.number},${other.number}`), " ");
  }
  const progress = episode.progress === null ? "" : `${(100 * episode.progress).toFixed(0)} %`;
  const time = episode.task_time_s === null ? "" : `${episode.task_time_s.toFixed(1)} s`;
  const texts = [episode.method, episode.levels, episode.trial, episode.status, episode.failure_class, progress, time, episode.reason];
  made.append(number, ...texts.map((text) => make("td", "", text)), partners);
  return made;
}

load();
