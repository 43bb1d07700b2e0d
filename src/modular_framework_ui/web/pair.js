// SPDX-License-Identifier: BSD-3-Clause
// Shows two episodes side by side: their differences, and their pages as frames with one time and one cursor.

import { onPairMessage } from "./pair_link.js";
import { Player } from "./player.js";

const element = (id) => document.getElementById(id);
const frames = [];
const ends_s = [0, 0]; // ends of the tasks, in simulated time since their starts

function make(kind, className, text) {
  const made = document.createElement(kind);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

// ---- contents ------------------------------------------------------------------------------------------------------
async function load() {
  const answer = await fetch(`run.json${location.search}`);
  if (!answer.ok) {
    element("sentence").textContent = await answer.text();
    return;
  }
  const { title, sides, differences, note } = await answer.json();
  element("name").textContent = `${title}: episodes ${sides.map((side) => side.number).join(" and ")}`;
  document.title = element("name").textContent;
  element("sentence").textContent = `${note} Simulated time since the start of the task.`.trim();
  const names = sides.map((side) => `${side.method}, episode ${side.number}`);
  element("differences").append(differenceTable(names, differences));
  for (const [index, side] of sides.entries()) {
    const frame = make("iframe");
    frame.title = names[index];
    frame.src = `./?episode=${side.number}&clock=simulated`;
    frames.push(frame);
  }
  element("sides").append(...frames);
}

function differenceTable(names, differences) {
  const table = make("table");
  const heading = make("tr");
  heading.append(...["", ...names, "difference"].map((text) => make("th", "", text)));
  table.append(heading);
  for (const each of differences) {
    const row = make("tr");
    row.append(make("th", "", each.name), ...[each.first, each.second, each.difference].map((text) => make("td", "", text)));
    table.append(row);
  }
  return table;
}

// ---- shared time ---------------------------------------------------------------------------------------------------
const total_s = () => Math.max(...ends_s);

/** Sends a message to the pages of the episodes, except the page that caused the message. */
function tellSides(message, source = null) {
  for (const frame of frames) {
    if (frame.contentWindow !== source) frame.contentWindow.postMessage(message, location.origin);
  }
}

/** Shows both tasks at a time [s since their starts]; null shows their ends. */
function view(view_s, source = null) {
  element("moment").value = view_s ?? total_s();
  element("shown").textContent = view_s === null ? "end" : `${view_s.toFixed(2)} s`;
  element("latest").disabled = view_s === null;
  tellSides({ view_s }, source);
}

const player = new Player(element("play"), total_s, view);

function togglePlaying() {
  if (player.isPlaying) { player.stop(); return; }
  const shown_s = Number(element("moment").value);
  player.start(shown_s < total_s() ? shown_s : 0);
}

onPairMessage(({ data, source }) => {
  const index = frames.findIndex((frame) => frame.contentWindow === source);
  if (index < 0) return;
  if (data.end_s !== undefined) {
    ends_s[index] = data.end_s;
    element("moment").max = total_s();
    tellSides({ total_s: total_s() });
    view(null);
  }
  if (data.view_s !== undefined) { player.stop(); view(data.view_s, source); }
  if (data.cursor_s !== undefined) tellSides({ cursor_s: data.cursor_s }, source);
});
element("moment").addEventListener("input", () => { player.stop(); view(Number(element("moment").value)); });
element("play").addEventListener("click", togglePlaying);
element("latest").addEventListener("click", () => { player.stop(); view(null); });

load();
