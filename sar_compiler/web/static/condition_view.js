// The status line of a mission, as sent by the server, or the state of the connection to the server.

import { clock, html, say, set } from "./shapes.js";
import { CONDITIONS } from "./signs.js";

const SEVERITY = ["quiet", "good", "warning", "error"];
// The duration is shown for these states. The reason for a lost contact already contains it.
const COUNTED = ["paused", "waiting", "position lost"];
// On the page, "crashed" alone could mean that the robot has crashed.
const LABELS = { crashed: "program crashed" };
// A robot in one of these states does not drive, regardless of earlier data.
const STANDING = ["paused", "waiting", "aborted"];
const UNPLACED = "position lost";

/** Return a run's status for a page: word, level, reason, and duration in seconds (null if it is not shown). If an open task determines the level, also return the number of open tasks in words. */
export function conditionOf(stream, run) {
  const { silent, isReplay, isTold, trouble } = stream;
  if (isReplay && silent) return { word: "not connected", level: "error", reason: "other times cannot be shown", lasts: null };
  if (trouble) return { word: "trouble", level: "error", reason: trouble, lasts: null };
  if (!isTold) return { word: silent > 4 ? "not connected" : "connecting", level: silent > 4 ? "error" : "quiet", reason: "", lasts: null };
  const { word, level, since } = run.condition;
  // The details of a wait name nodes, and are for engineers.
  const reason = word === "waiting" ? run.condition.reason.split(": ")[0] : run.condition.reason;
  if (silent && !run.run.ended) return { word: "lost", level: "error", reason: `No contact for ${clock(silent)}. The robot may still be driving.`, lasts: null };
  const shown = worst([level, ...run.tasks.map((task) => task.level)]);
  return { word: LABELS[word] ?? word, level: shown, reason, lasts: COUNTED.includes(word) ? run.time - since : null, open: shown === level ? "" : counted(run.tasks) };
}

/** Return the numbers of open tasks and alarms in words. */
function counted(all) {
  const alarms = all.filter((task) => task.is_alarm).length;
  const words = [[all.length - alarms, "task"], [alarms, "alarm"]];
  return words.filter(([count]) => count).map(([count, name]) => `${count} ${name}${count > 1 ? "s" : ""}`).join(", ");
}

/** Whether the program of a run has crashed. */
export function isCrashed({ condition }) {
  return condition.word === "crashed";
}

/** Whether the server has lost contact with a driving robot. */
export function isLost({ condition }) {
  return condition.word === "lost";
}

/** Whether the shown data of a run may be stale: its connection is lost, or its program has crashed. All views use this rule. */
export function isStale(stream, run) {
  return !run.run.ended && (isCrashed(run) || isLost(run) || (Boolean(stream.silent) && !stream.isReplay));
}

/** Whether the drive, the plan and the remaining time of a run are current. */
export function isMoving(stream, run) {
  const { word } = run.condition;
  return !run.run.ended && !isStale(stream, run) && !STANDING.includes(word) && word !== UNPLACED;
}

/** Whether the position of a robot is current. */
export function isPlaced(stream, run) {
  return !isStale(stream, run) && run.condition.word !== UNPLACED;
}

/** Return the most severe of the levels. */
export function worst(levels) {
  return levels.reduce((one, other) => (SEVERITY.indexOf(other) > SEVERITY.indexOf(one) ? other : one));
}

/** Show a status in an element: sign, word, duration with open tasks, and reason. */
export function showCondition(place, { word, level, reason, lasts, open }, isLong = true) {
  if (!place.childElementCount) place.append(html("b", { "aria-hidden": "true" }), html("strong"), html("time"), html("span"));
  const [sign, name, time, why] = place.children;
  set(place, { "data-level": level, "data-word": word });
  say(sign, CONDITIONS[level] ?? "");
  say(name, word);
  say(time, [lasts === null ? "" : `for ${clock(lasts)}`, open].filter(Boolean).join(", "));
  say(why, isLong ? reason : "");
  set(why, { title: isLong ? reason : null });
}
