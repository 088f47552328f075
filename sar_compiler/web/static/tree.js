// The engineer's page: the tree with the status of each node, the running nodes, and every line of the log.

import { conditionOf, isStale, showCondition } from "./condition_view.js";
import { showDetails } from "./details.js";
import { LanesView } from "./lanes_view.js";
import { LogView } from "./log_view.js";
import { MapView } from "./map_view.js";
import { Orders } from "./orders.js";
import { CardsView, beginning } from "./panels.js";
import { PlacesView } from "./places_view.js";
import { PropertiesView } from "./properties_view.js";
import { ReplayBar } from "./replay_bar.js";
import { STATUS_WORDS, badge, clock, duration, html, say, svg } from "./shapes.js";
import { DECORATORS } from "./signs.js";
import { Stream, drawer } from "./stream.js";
import { Tools } from "./tools.js";
import { TreeView } from "./tree_view.js";
import { WhyView } from "./why_view.js";

// The maximum number of running nodes to list.
const SHOWN = 6;
const at = (id) => document.getElementById(id);

const stream = new Stream({ begin, change: drawer(show) });
const tree = new TreeView(at("tree"), showChosen);
const map = new MapView(at("map"));
const places = new PlacesView(at("places"), find);
map.onChosen = (landmark) => [places, log].forEach((view) => view.look(landmark));
const properties = new PropertiesView(at("properties"));
const log = new LogView(at("log"), find);
const cards = new CardsView(at("robots"));
const replay = new ReplayBar(at("timeline"), stream);
const why = new WhyView(at("why"), select);
const lanes = new LanesView(at("lanes"), stream, select);
const tools = new Tools({ bar: at("tools"), board: at("board"), otherwise: at("otherwise") }, stream, tree);
const orders = new Orders(at("orders"), stream, { pick: onMap((answer) => map.pick(answer)), draw: onMap((answer) => map.draw(answer)) });

/** Show a node in the tree. */
function select(id) {
  look("tree");
  tree.select(id);
}

/** Show a landmark on the map, in its list and in the log. */
function find(landmark) {
  [places, log, map].forEach((view) => view.look(landmark));
}

/** Open a failed run at the cause, unless the user has selected a node. */
function openAtCause({ why: cause, run }) {
  const key = cause && run.ended ? `${run.number} ${run.wall}` : "";
  if (!key || key === openAtCause.key) return;
  openAtCause.key = key;
  at("why").open = true;
  const [first] = cause.causes;
  if (!tree.isAsked && first?.node != null) tree.select(first.node);
}

/** Show the map before it is used for picking. */
function onMap(ask) {
  return (answer) => {
    look("map");
    ask(answer);
  };
}

function begin() {
  orders.again();
  tools.again();
  replay.begin();
  at("other").href = `./${location.hash}`;
}

function show() {
  const { run } = stream;
  showCondition(at("condition"), conditionOf(stream, run));
  document.body.classList.toggle("stale", isStale(stream, run));
  at("replaying").hidden = !stream.isReplay;
  if (stream.isReplay) say(at("began"), ` of ${beginning(run)}`);
  orders.show();
  if (!stream.isTold) return;
  const { number, mission = "mission", is_simulated: isSimulated, node = "" } = run.run;
  say(at("mission"), `${stream.isTeam ? `${stream.names[stream.chosen]}: ` : ""}${mission.replaceAll("_", " ")}${isSimulated ? ", simulated" : ""}`);
  at("mission").title = node;
  document.title = `${stream.isReplay ? "replay: " : ""}${mission}`;
  say(at("clock"), number ? `${clock(run.time)}${number > 1 ? `, run ${number}` : ""}` : "");
  say(at("progress"), progress(run));
  running(run);
  tree.show(run);
  showSigns(run);
  map.show(stream);
  places.show(stream);
  properties.show(run);
  cards.show(stream);
  log.show(run);
  lanes.show(run);
  why.show(run);
  openAtCause(run);
  showChosen();
  if (stream.isReplay) replay.show();
  document.body.classList.add("ready");
}

/** Show the details of the selected node. */
function showChosen() {
  at("chosen").hidden = !tree.isAsked;
  showDetails(at("details"), stream.run, tree.isAsked ? tree.chosen : -1);
  tools.show();
}

/** Show the meanings of the tree's signs: statuses and kinds of nodes. */
function showSigns({ nodes }) {
  if (showSigns.nodes === nodes) return;
  showSigns.nodes = nodes;
  const item = (sign, text) => html("li", {}, sign, ` ${text}`);
  const drawn = (...status) => svg("svg", { viewBox: "0 0 16 16", width: 14, height: 14, "aria-hidden": "true" }, badge(...status));
  const kinds = new Map(nodes.filter(({ sign }) => sign).map(({ sign, shape }) => [sign, DECORATORS[sign] ?? `${shape}${sign.endsWith("R") ? ", reactive" : ""}`]));
  at("signs").lastElementChild.replaceChildren(
    ...Object.entries(STATUS_WORDS).map(([status, words]) => item(drawn(status), words)),
    item(drawn("SUCCESS", true), "hollow: from an earlier activation"),
    ...[...kinds].map(([sign, shape]) => item(html("b", {}, sign), shape)),
  );
}

function progress(run) {
  const gauges = run.gauges.filter(({ value }) => Number.isFinite(value)).map(({ name, value, unit }) => `${name} ${Number(value.toFixed(1))} ${unit}`.trim());
  const raised = run.alarms.filter((each) => !each.is_over).sort((one, other) => one.run - other.run || one.time - other.time).map(({ text }) => text);
  return [...run.figures.map(({ text }) => text), ...gauges, ...raised].join(" · ");
}

function running(run) {
  const list = at("now").querySelector("ul");
  const isOver = run.run.ended || run.condition.word === "crashed";
  const all = isOver ? [] : run.running();
  const leaves = all.slice(0, SHOWN);
  const key = `${all.map((id) => `${id} ${run.nodes[id].name}`).join("\n")}${JSON.stringify(run.awaited)}`;
  if (list.dataset.key !== key || list.childElementCount === 0) {
    list.dataset.key = key;
    list.replaceChildren(...leaves.map((id) => runner(run, id)));
    const rest = all.length - leaves.length;
    const awaited = run.awaited.map(({ name, problem }) => (problem ? `waiting for ${name}: ${problem}` : `${name}: available`)).join("; ") || "none";
    if (rest || !all.length) list.append(html("li", { class: "nobody" }, rest ? `and ${rest} more` : awaited));
  }
  leaves.forEach((id, index) => {
    const { since, message } = run.states[id];
    const item = list.children[index];
    say(item.querySelector(".for"), `for ${duration(run.time - since)}`);
    say(item.querySelector(".message"), message);
  });
}

function runner(run, id) {
  const button = html("button", { type: "button" }, svg("svg", { viewBox: "0 0 16 16", width: 14, height: 14, "aria-hidden": "true" }, badge("RUNNING")), run.nodes[id].name);
  button.addEventListener("click", () => tree.select(id));
  return html("li", {}, button, html("span", { class: "for" }), html("span", { class: "message" }));
}

// --- user input ------------------------------------------------------------------------------------

function look(view) {
  document.querySelector("main").dataset.view = view;
  for (const button of document.querySelectorAll("nav button")) button.setAttribute("aria-pressed", button.dataset.view === view);
  stream.page.change();
}

for (const button of document.querySelectorAll("nav button")) button.addEventListener("click", () => look(button.dataset.view));
at("fold").addEventListener("click", () => tree.fold());
at("unfold").addEventListener("click", () => {
  at("follow").checked = tree.follows = tree.follows && !tree.isLarge;
  tree.unfold();
});
at("all-time").addEventListener("click", () => lanes.zoom(null));
at("follow").addEventListener("change", () => {
  tree.follows = at("follow").checked;
  stream.page.change();
});
at("facts").addEventListener("change", () => {
  log.levels = at("facts").checked ? ["fact", "warning", "error"] : null;
  log.again();
  stream.page.change();
});
at("search").addEventListener("input", () => {
  const count = tree.search(at("search").value);
  say(at("found"), at("search").value.trim() ? `${count} of ${stream.run.nodes.length}` : "");
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
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input, select, button, textarea, summary, a") || orders.isOpen) return;
  if (event.key === "/") {
    look("tree");
    at("search").focus();
  } else if (!replay.key(event)) return;
  event.preventDefault();
});
document.addEventListener("visibilitychange", () => stream.listen());
// The address of another run on the same port has a different token.
window.addEventListener("hashchange", () => location.reload());
// A page without contact for a long time is closed.
setInterval(() => stream.page.change(), 1000);
tree.show(stream.run);
stream.listen();
