// The operator's page: the map, the status line, the commands, and the events.

import { conditionOf, isStale, showCondition } from "./condition_view.js";
import { LogView } from "./log_view.js";
import { MapView } from "./map_view.js";
import { Orders } from "./orders.js";
import { AlarmsView, CardsView, TasksView, driveLeft, showFigures, showGauges } from "./panels.js";
import { PlacesView } from "./places_view.js";
import { PropertiesView } from "./properties_view.js";
import { ReplayBar } from "./replay_bar.js";
import { say } from "./shapes.js";
import { Stream, drawer } from "./stream.js";
import { WhyView } from "./why_view.js";

const at = (id) => document.getElementById(id);
const stream = new Stream({ begin, change: drawer(show) });
const map = new MapView(at("map"), at("legend").querySelector("table"));
const orders = new Orders(at("orders"), stream, map);
const alarms = new AlarmsView(at("alarms"), at("sound"));
const tasks = new TasksView(at("tasks"), orders);
const cards = new CardsView(at("robots"));
const places = new PlacesView(at("places"));
const properties = new PropertiesView(at("properties"));
const log = new LogView(at("log"));
const why = new WhyView(at("why"));
const replay = new ReplayBar(at("timeline"), stream);
log.onlyFacts = true;

function begin() {
  orders.again();
  replay.begin();
  at("replaying").hidden = !stream.isReplay;
  at("other").href = `tree${location.hash}`;
}

function show() {
  const { run } = stream;
  const condition = conditionOf(stream, run);
  showCondition(at("condition"), condition);
  // What is read out changes with the word, and not every second.
  say(at("said"), `${condition.word}${condition.level === "error" && condition.lasts === null ? "" : `, ${condition.reason}`}`);
  document.body.dataset.level = condition.level;
  document.body.classList.toggle("stale", isStale(stream, run));
  orders.show();
  // A run in the server's own process has none before its end.
  at("report").hidden = !stream.tools.includes("report") || (stream.tools.includes("entries") && !run.run.ended);
  at("report").href = `report?robot=${stream.chosen}`;
  if (!stream.isTold) return;
  const { mission = "mission", is_simulated: isSimulated, node = "" } = run.run;
  say(at("mission"), `${stream.isTeam ? `${stream.names[stream.chosen]}: ` : ""}${mission.replaceAll("_", " ")}${isSimulated ? ", simulated" : ""}`);
  at("mission").title = node;
  document.title = `${run.tasks.length ? `(${run.tasks.length}) ` : ""}${condition.word}: ${mission}`;
  // What is still to come is said as long as something does.
  say(at("drive"), driveLeft(stream, run));
  showFigures(at("figures"), stream, run);
  showGauges(at("gauges"), run);
  map.show(stream);
  tasks.show(stream);
  alarms.show(stream);
  cards.show(stream);
  places.show(stream);
  properties.show(run);
  log.show(run);
  why.show(run);
  if (stream.isReplay) replay.show();
  document.body.classList.add("ready");
}

at("all").addEventListener("change", () => {
  log.onlyFacts = !at("all").checked;
  log.again();
  show();
});
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && map.picking) map.picked(null);
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input, select, button, textarea, summary, a") || orders.isOpen) return;
  if (replay.key(event)) event.preventDefault();
});
at("legend").open = matchMedia("(min-width: 1500px)").matches;
at("legend").addEventListener("toggle", () => map.again());
document.addEventListener("visibilitychange", () => stream.listen());
// The address of another run on the same port: with another token.
window.addEventListener("hashchange", () => location.reload());
// A page that is silent for long is closed.
setInterval(() => stream.page.change(), 1000);
stream.listen();
