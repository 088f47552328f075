// The operator's page: the map, the status line, the commands, and the events.

import { conditionOf, isStale, showCondition, worst } from "./condition_view.js";
import { LogView } from "./log_view.js";
import { MapView } from "./map_view.js";
import { Orders } from "./orders.js";
import { MissionLine } from "./mission_line.js";
import { AlarmsView, CardsView, EndingView, TasksView, beginning, showFigures, showGauges, showTimes, whereabouts, withoutAddress } from "./panels.js";
import { PlacesView } from "./places_view.js";
import { PropertiesView } from "./properties_view.js";
import { ReplayBar } from "./replay_bar.js";
import { say } from "./shapes.js";
import { Stream, drawer } from "./stream.js";

const at = (id) => document.getElementById(id);
const stream = new Stream({ begin, change: drawer(show) });
const map = new MapView(at("map"), at("legend").querySelector("table"));
const orders = new Orders(at("orders"), stream, map);
const alarms = new AlarmsView(at("alarms"), at("sound"), look);
const tasks = new TasksView(at("tasks"), orders, alarms, look);
const cards = new CardsView(at("robots"));
const ending = new EndingView(at("ending"));
const places = new PlacesView(at("places"), look, orders);
map.onChosen = (landmark) => [places, log].forEach((view) => view.look(landmark));
const properties = new PropertiesView(at("properties"));
const log = new LogView(at("log"), look);
const line = new MissionLine(at("line"), look);
const replay = new ReplayBar(at("timeline"), stream);
log.levels = ["fact"];

/** Show a landmark on the map, in its list and in the log. */
function look(landmark) {
  if (landmark.robot !== undefined && landmark.robot !== stream.chosen) stream.choose(landmark.robot);
  [places, log, map].forEach((view) => view.look(landmark));
}

function begin() {
  orders.again();
  replay.begin();
  at("replaying").hidden = !stream.isReplay;
  at("other").href = `tree${location.hash}`;
}

function show() {
  const { run } = stream;
  const condition = forOperators(stream, worstOf(stream));
  showCondition(at("condition"), condition);
  // Screen readers announce this text when the word changes, not every second.
  say(at("said"), [condition.word, condition.open, condition.level === "error" && condition.lasts === null ? "" : condition.reason].filter(Boolean).join(", "));
  // The colour shows the most severe state of all robots.
  const level = worst([condition.level, ...stream.runs.map((each) => conditionOf(stream, each).level)]);
  document.body.dataset.level = level;
  showIcon(level);
  document.body.classList.toggle("stale", isStale(stream, run));
  orders.show();
  // A run in the server's own process has no report before its end.
  const hasReport = stream.tools.includes("report") && (run.run.ended || !stream.tools.includes("entries"));
  const report = `report?robot=${stream.chosen}`;
  at("report").hidden = !hasReport;
  at("report").href = report;
  if (!stream.isTold) return;
  const { mission = "mission", is_simulated: isSimulated } = run.run;
  say(at("mission"), `${stream.isTeam ? `${stream.names[stream.chosen]}: ` : ""}${mission.replaceAll("_", " ")}${isSimulated ? ", simulated" : ""}`);
  const open = stream.runs.reduce((sum, each) => sum + each.tasks.length, 0);
  document.title = `${open ? `(${open}) ` : ""}${condition.word}: ${mission}`;
  if (stream.isReplay) say(at("began"), ` of ${beginning(run)}`);
  // The band shows the state of one robot.
  const shown = stream.runs[condition.index];
  say(at("drive"), whereabouts(stream, shown));
  showTimes(at("times"), stream, shown);
  showGauges(at("gauges"), stream, shown);
  showFigures(at("figures"), run);
  map.show(stream);
  tasks.show(stream);
  alarms.show(stream);
  cards.show(stream);
  ending.show(stream, run, hasReport ? report : "");
  line.show(stream);
  places.show(stream);
  properties.show(run);
  log.show(run);
  if (stream.isReplay) replay.show();
  document.body.classList.add("ready");
}

/** Return the condition of the chosen robot, or of a robot that needs the operator more urgently, with the name of that robot. */
function worstOf(stream) {
  const all = stream.runs.map((each) => conditionOf(stream, each));
  const level = worst(["good", ...all.map((each) => each.level)]);
  const chosen = all[stream.chosen];
  const index = all.findIndex((each) => each.level === level);
  return index < 0 || level === "good" || chosen.level === level ? { ...chosen, index: stream.chosen } : { ...all[index], index, word: `${stream.names[index]}: ${all[index].word}` };
}

/** Return a condition as the state band shows it: marked if replayed, without addresses of authors, and without a reason that a task states. */
function forOperators(stream, condition) {
  const { word, reason, index } = condition;
  const isStated = reason && stream.runs[index].tasks.some(({ text }) => text.endsWith(reason));
  return { ...condition, word: stream.isReplay ? `replay: ${word}` : word, reason: isStated ? "" : withoutAddress(reason) };
}

/** Set the tab's icon to the colour of the state. */
function showIcon(level) {
  if (at("icon").dataset.level === level) return;
  at("icon").dataset.level = level;
  const name = { good: "success", warning: "warning", error: "error" }[level] ?? "none";
  const colour = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  at("icon").href = `data:image/svg+xml,${encodeURIComponent(`<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><circle cx="8" cy="8" r="7" fill="${colour}"/></svg>`)}`;
}

at("all").addEventListener("change", () => {
  log.levels = at("all").checked ? null : ["fact"];
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
// The address of another run on the same port has a different token.
window.addEventListener("hashchange", () => location.reload());
// A page without contact for a long time is closed.
setInterval(() => stream.page.change(), 1000);
stream.listen();
