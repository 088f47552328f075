// The page of a run: what the server tells of it, and what is shown of that.

import { showDetails } from "./details.js";
import { LogView } from "./log_view.js";
import { MapView } from "./map_view.js";
import { Orders } from "./orders.js";
import { PlacesView } from "./places_view.js";
import { Run } from "./run.js";
import { WhyView } from "./why_view.js";
import { badge, duration, html, say, svg } from "./shapes.js";
import { TreeView } from "./tree_view.js";

const SILENCE_MS = 4000;
// A browser has six connections to one server, for orders as well: of more pages than these, those that nobody sees let theirs go.
const MANY = 4;
// Of more nodes that run at once, the first.
const SHOWN = 6;
const at = (id) => document.getElementById(id);

const tree = new TreeView(at("tree"), () => showDetails(at("details"), run, tree.chosen));
const map = new MapView(at("map"));
const places = new PlacesView(at("places"));
const log = new LogView(at("log"));
const why = new WhyView(at("why"), (id) => {
  look("tree");
  tree.select(id);
});
const orders = new Orders({ bar: at("verbs"), ask: at("ask"), answer: at("answer") }, (answer) => map.pick(answer));

// A run for each robot, and the one whose tree and log are shown.
let runs = [new Run()];
let run = runs[0];
let names = [];
let alive = [];
// How long a replay is, in seconds; null for a live run.
let end = null;
// Whether there is something to show.
let isTold = false;
let heard = 0;
let drawing = false;
// Of a replay: what draws the next moment of it, and the time that is shown.
let playing = 0;
let place = 0;
// The moment that was told last, by its number and its time, and whether another one is being asked for.
let moment = 0;
let shown = 0;
let isAsking = false;
let asking = new AbortController();
let trouble = "";

// --- what the server tells -------------------------------------------------------------------------

function hello({ mode, robots, verbs, end: length }) {
  // Whatever was known is told again: by the same run, or by another one that has taken its place.
  play(false);
  names = robots ?? ["run"];
  runs = names.map(() => new Run());
  alive = [];
  moment = 0;
  // One that a server that is gone has left open.
  asking.abort();
  asking = new AbortController();
  end = length ?? null;
  isTold = false;
  offerRobots();
  document.body.dataset.mode = mode;
  document.body.classList.remove("ready");
  at("timeline").hidden = end === null;
  orders.offer(verbs ?? []);
  if (end === null) return;
  // In whole steps, or the end could not be reached.
  at("time").max = Math.ceil(end * 100) / 100;
  // Where it was before the connection came again.
  go(place);
}

function take(changes) {
  for (const { robot, ...change } of changes) runs[robot].take(change);
  isTold = true;
  later();
}

function beat({ time, verbs, running, pages }) {
  if (document.hidden && pages > MANY) {
    source.close();
    gone();
  }
  alive = running ?? [];
  if (time !== undefined && run.run.number && !run.run.ended) run.time = Math.max(run.time, time - run.run.began);
  orders.allow(verbs ?? [], run);
  later();
}

let source = null;

function listen() {
  if (source && source.readyState !== EventSource.CLOSED) return;
  source = new EventSource("events");
  const on = (name, heed) => source.addEventListener(name, ({ data }) => {
    heard = performance.now();
    heed(JSON.parse(data));
  });
  on("hello", hello);
  on("changes", take);
  on("beat", beat);
  on("bye", () => gone());
  source.addEventListener("error", () => {
    gone();
    // A browser gives up where a proxy answers in the server's place.
    setTimeout(() => document.hidden || listen(), 2000);
    later();
  });
}

document.addEventListener("visibilitychange", listen);

function gone() {
  heard = 0;
  orders.allow([], run);
}

// --- what is shown ---------------------------------------------------------------------------------

function later() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    show();
  });
}

function show() {
  state();
  if (!isTold) return;
  const { number, mission = "mission", is_simulated: isSimulated, node = "" } = run.run;
  say(at("mission"), `${mission.replaceAll("_", " ")}${isSimulated ? ", simulated" : ""}`);
  at("mission").title = node;
  document.title = `${end === null ? "" : "replay: "}${mission}`;
  say(at("clock"), number ? `${duration(run.time)}${number > 1 ? `, run ${number}` : ""}` : "");
  say(at("progress"), progress());
  running();
  tree.show(run);
  map.show(run, runs.length > 1 ? names : [], runs);
  places.show(run);
  log.show(run);
  why.show(run);
  showDetails(at("details"), run, tree.chosen);
  if (end !== null) timeline();
  document.body.classList.add("ready");
}

function state() {
  const [name, text] = condition();
  at("state").className = name;
  say(at("state"), text);
}

function condition() {
  const { number, ended } = run.run;
  const isSilent = performance.now() - heard > SILENCE_MS || !heard;
  if (end !== null && isSilent) return ["bad", "not connected: no other moment can be shown"];
  if (trouble) return ["bad", trouble];
  if (ended) {
    const { ending, status, reason } = ended;
    const said = reason ? `: ${reason.split(/(?<=\.) /)[0]}` : "";
    return [status === 0 ? "good" : "bad", `${ending === "over" ? "ended" : ending}, status ${status}${said}`];
  }
  if (end !== null) return ["", isTold ? "replay" : "loading"];
  if (isSilent) return ["bad", "not connected: what is shown may be old"];
  if (!number) return ["", "waiting for the run to begin"];
  if (alive[runs.indexOf(run)] === false) return ["bad", "broken off: its process is gone"];
  if (alarms().length) return ["bad", `live: ${alarms().join("; ")}`];
  if (run.lacks) return ["bad", `live: ${run.lacks}`];
  const { name, reason } = run.phase;
  return ["good", name === "held" ? `live: ${name} ${reason}` : "live"];
}

/** What a person must know, the newest last. */
function alarms() {
  return run.alarms.filter((each) => !each.is_over).sort((one, other) => one.run - other.run || one.time - other.time).map(({ text }) => text);
}

function progress() {
  const gauges = run.gauges.filter(({ value }) => Number.isFinite(value)).map(({ name, value, unit }) => `${name} ${Number(value.toFixed(1))} ${unit}`.trim());
  // Of a live run they are in its state.
  const raised = end !== null || run.run.ended ? alarms() : [];
  return [...run.figures.map(({ text }) => text), ...gauges, ...raised].join(" · ");
}

function running() {
  const list = at("now").querySelector("ul");
  const all = run.run.ended ? [] : run.running();
  const leaves = all.slice(0, SHOWN);
  const key = all.map((id) => `${id} ${run.nodes[id].name}`).join("\n");
  if (list.dataset.key !== key || list.childElementCount === 0) {
    list.dataset.key = key;
    list.replaceChildren(...leaves.map(runner));
    const rest = all.length - leaves.length;
    if (rest || !all.length) list.append(html("li", { class: "nobody" }, rest ? `and ${rest} more` : "nobody"));
  }
  say(at("drive"), run.drive && !run.lacks ? driveLeft(run.drive) : "");
  leaves.forEach((id, index) => {
    const { since, message } = run.states[id];
    const item = list.children[index];
    say(item.querySelector(".for"), `for ${duration(run.time - since)}`);
    say(item.querySelector(".message"), message);
  });
}

function driveLeft({ target, distance, time_left: left }) {
  return `${target} in ${distance.toFixed(1)} m${left == null ? "" : `, ${duration(left)} left`}`;
}

function runner(id) {
  const button = html("button", { type: "button" }, svg("svg", { viewBox: "0 0 16 16", width: 14, height: 14, "aria-hidden": "true" }, badge("RUNNING")), run.nodes[id].name);
  button.addEventListener("click", () => tree.select(id));
  return html("li", {}, button, html("span", { class: "for" }), html("span", { class: "message" }));
}

// --- robots ----------------------------------------------------------------------------------------

function offerRobots() {
  const bar = at("robots");
  bar.hidden = names.length < 2;
  bar.replaceChildren(...names.map((name, index) => {
    const button = html("button", { type: "button" }, name);
    button.addEventListener("click", () => turnTo(index));
    return button;
  }));
  turnTo(Math.max(0, names.indexOf(bar.dataset.shown)));
}

/** Show the tree and the log of one of the robots. */
function turnTo(index) {
  run = runs[index];
  at("robots").dataset.shown = names[index];
  [...at("robots").children].forEach((button, place) => button.setAttribute("aria-pressed", place === index));
  later();
}

// --- replay ----------------------------------------------------------------------------------------

function go(time) {
  place = Math.max(0, Math.min(end, time));
  if (!isAsking) ask();
  later();
}

/** Have the server tell what was so at the time that is wanted, one time after the other, until nobody wants another one. */
async function ask() {
  isAsking = true;
  for (let [time, told] = [NaN, null]; time !== place || told !== runs; ) {
    [time, told] = [place, runs];
    const answer = await answered(`moment?time=${time}&since=${moment}`);
    // Meanwhile the connection may have come again, maybe to another server.
    if (told !== runs) continue;
    trouble = answer.trouble ?? "";
    if (!answer.changes) break;
    [moment, shown] = [answer.number, time];
    take(answer.changes);
  }
  isAsking = false;
  later();
}

/** Return what the server answers; nothing where it cannot be reached: of that the events tell, and of its return. */
async function answered(address) {
  try {
    const answer = await fetch(address, { signal: asking.signal });
    return answer.ok ? await answer.json() : { trouble: await answer.text() };
  } catch {
    return {};
  }
}

function timeline() {
  at("time").value = place;
  at("time").setAttribute("aria-valuetext", duration(place));
  say(at("at"), `${duration(shown)} of ${duration(end)}`);
}

function play(on) {
  say(at("play"), on ? "⏸" : "▶");
  at("play").setAttribute("aria-label", on ? "Pause" : "Play");
  cancelAnimationFrame(playing);
  playing = 0;
  if (!on) return;
  if (place >= end) go(0);
  let last = performance.now();
  const step = (now) => {
    go(place + ((now - last) / 1000) * Number(at("speed").value));
    last = now;
    if (place >= end) play(false);
    else playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

at("play").addEventListener("click", () => play(!playing));
at("time").addEventListener("input", () => {
  play(false);
  go(Number(at("time").value));
});

// --- what the user does ----------------------------------------------------------------------------

function look(view) {
  document.querySelector("main").dataset.view = view;
  for (const button of document.querySelectorAll("nav button")) button.setAttribute("aria-pressed", button.dataset.view === view);
  later();
}

for (const button of document.querySelectorAll("nav button")) button.addEventListener("click", () => look(button.dataset.view));
for (const button of document.querySelectorAll("[data-zoom]")) {
  const zoom = { in: () => map.nearer(1.4), out: () => map.nearer(1 / 1.4), fit: () => map.fit() }[button.dataset.zoom];
  button.addEventListener("click", zoom);
}
at("fold").addEventListener("click", () => tree.fold());
at("unfold").addEventListener("click", () => {
  at("follow").checked = tree.follows = tree.follows && tree.nodes.length <= 200;
  tree.unfold();
});
at("follow").addEventListener("change", () => {
  tree.follows = at("follow").checked;
  later();
});
at("facts").addEventListener("change", () => {
  log.onlyFacts = at("facts").checked;
  log.again();
  later();
});
at("search").addEventListener("input", () => {
  const count = tree.search(at("search").value);
  say(at("found"), at("search").value.trim() ? `${count} of ${run.nodes.length}` : "");
});
at("search").addEventListener("keydown", (event) => {
  if (event.key === "Enter") tree.next();
  else if (event.key === "Escape") {
    at("search").value = "";
    at("search").dispatchEvent(new Event("input"));
    at("tree").focus();
  } else return;
  event.preventDefault();
});
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && map.picking) map.picked(null);
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input, select, button, textarea") || at("ask").open) return;
  if (event.key === "/") {
    look("tree");
    at("search").focus();
  } else if (event.key === " " && end !== null) play(!playing);
  else return;
  event.preventDefault();
});
// The address of another run on the same port: with another token.
window.addEventListener("hashchange", () => location.reload());
// Who is silent for long is not there.
setInterval(later, 1000);
tree.show(run);
listen();
