// Parts of the operator's page beside the map: gauges and figures, open tasks, alarms, a card for each robot, and the actions after the end.

import { conditionOf, isCrashed, isMoving, isPlaced, isStale, showCondition } from "./condition_view.js";
import { linked } from "./links.js";
import { clock, html, hue, say, set } from "./shapes.js";
import { CONDITIONS } from "./signs.js";

const SEEN = "sar-seen";
// A robot within this distance of a landmark is at the landmark.
const NEAR_M = 0.5;
// The number of acknowledged alarms to store.
const REMEMBERED = 200;

/** The times of a mission: elapsed, expected remaining, and the limit. */
export function showTimes(place, stream, run) {
  const { estimate, time, run: { number } } = run;
  const ended = !isMoving(stream, run);
  const left = ended || estimate.end == null || estimate.end < time ? null : estimate.end - time;
  const isOld = isStale(stream, run);
  const rows = !number ? [] : [
    [isOld ? "last contact" : "time", `${clock(time)}${number > 1 ? `, run ${number}` : ""}`],
    ...(ended ? [] : [["to go", left == null ? "–" : `about ${clock(left)}`]]),
    ...(estimate.limit && !isOld ? [["limit", clock(estimate.limit), !ended && left != null && time + left > estimate.limit]] : []),
  ];
  showRows(place, rows);
}

/** The counts and measurements of the mission. */
export function showFigures(place, run) {
  place.hidden = !run.figures.length;
  showRows(place, run.figures.map(({ name, value, of, unit }) => [name, `${round(value)}${of == null ? "" : ` of ${round(of)}`}${unit ? ` ${unit}` : ""}`]));
}

function showRows(place, rows) {
  const key = rows.map(([name]) => name).join("\n");
  if (place.dataset.key !== key) {
    place.dataset.key = key;
    place.replaceChildren(...rows.map(([name]) => html("div", {}, html("dt", {}, name), html("dd"))));
  }
  rows.forEach(([, value, isTight], index) => {
    say(place.children[index].lastChild, value);
    set(place.children[index], { class: isTight ? "tight" : null });
  });
}

/** Show the gauges, as bars if their maximum is known. */
export function showGauges(place, stream, run) {
  const last = isStale(stream, run) ? "last " : "";
  const gauges = run.gauges.filter(({ value }) => Number.isFinite(value)).map((gauge) => ({ ...gauge, name: `${last}${gauge.name}` }));
  const key = gauges.map(({ name }) => name).join("\n");
  place.hidden = !gauges.length;
  if (place.dataset.key !== key) {
    place.dataset.key = key;
    place.replaceChildren(...gauges.map(({ name, unit }) => {
      const bar = unit === "%" ? html("div", { class: "bar-of" }, html("meter", { min: 0, max: 100, "aria-label": name }), html("i", { "aria-hidden": "true" })) : "";
      return html("div", { class: "gauge" }, html("span", {}, name, html("small")), bar, html("b"));
    }));
  }
  gauges.forEach(({ name, value, unit, least }, index) => {
    const gauge = place.children[index];
    const isLow = least != null && value < least;
    set(gauge, { class: `gauge${isLow ? " low" : ""}${last && " old"}` });
    say(gauge.lastChild, `${isLow ? "▼ " : ""}${round(value)} ${unit}`.trim());
    say(gauge.firstChild.lastChild, least == null ? "" : `, low below ${round(least)} ${unit}`.trimEnd());
    const bar = gauge.querySelector("meter");
    if (!bar) return;
    set(bar, { value, low: least ?? 0 });
    bar.nextSibling.hidden = least == null;
    bar.nextSibling.style.left = `${least ?? 0}%`;
  });
}

function round(value) {
  return Number(value.toFixed(1));
}

/** Return the remaining part of the current drive. Only this line of the page shows it. */
export function driveLeft(stream, run) {
  if (!run.drive || !isMoving(stream, run)) return "";
  const { distance, time_left: left } = run.drive;
  return `${distance.toFixed(1)} m${left == null ? "" : `, about ${clock(left)}`}`;
}

/** Describe the position of the robot by the nearest landmark, or the remaining part of its drive while it is moving. */
export function whereabouts(stream, run) {
  const moving = driveLeft(stream, run);
  const places = run.pose ? [...run.landmarks.values()].filter((each) => !each.corners.length && !run.kindOf(each).is_found) : [];
  if (moving || !places.length) return moving;
  const away = ({ x, y }) => Math.hypot(x - run.pose.x, y - run.pose.y);
  const nearest = places.reduce((one, other) => (away(other) < away(one) ? other : one));
  const words = away(nearest) < NEAR_M ? `at ${nearest.name}` : `${away(nearest).toFixed(1)} m from ${nearest.name}`;
  return isPlaced(stream, run) ? words : `last seen ${words}`;
}

/** Describe the start of a run by this computer's clock. */
export function beginning({ run }) {
  return run.wall ? new Date(1000 * run.wall).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }) : "";
}

/** Return a text without the addresses of browsers, which follow the authors of commands. */
export function withoutAddress(text) {
  return text.replace(/ \((?:page,|team page of) [^)]*\)/g, "");
}

const STOP_BUTTON = "Press the emergency stop on the robot: STOP on the page may not reach it";

/** The open tasks, the most urgent first, each with its command if available. Alarms have a separate list. */
export class TasksView {
  constructor(place, orders, alarms, look) {
    Object.assign(this, { place, orders, alarms, look, known: new Set() });
  }

  show(stream) {
    const { run, silent, isReplay } = stream;
    const all = stream.runs.flatMap((each, robot) => each.tasks.filter((task) => !task.is_alarm).map((task) => ({ ...task, text: withoutAddress(task.text), robot, who: stream.isTeam ? `${stream.names[robot]}: ` : "" })));
    if (silent && !isReplay && !run.run.ended) all.unshift({ level: "error", text: STOP_BUTTON, name: "", command: "", robot: stream.chosen, who: "" });
    const told = all.map((task) => ({ ...task, verb: task.robot === stream.chosen ? this.orders.find(task.command) : undefined }));
    const key = JSON.stringify([told, run.run.number, run.awaited, isReplay]);
    if (key === this.key) return;
    this.key = key;
    const added = told.filter(({ level, who, text }) => level === "error" && !this.known.has(who + text));
    this.alarms.ring(added.length);
    for (const { who, text } of added) this.known.add(who + text);
    this.place.hidden = !stream.isTold;
    const items = told.map(({ level, who, text, name, robot, verb }) => {
      const item = html("li", { class: level }, html("b", { "aria-hidden": "true" }, CONDITIONS[level]), html("span", {}, who, ...linked(stream.runs[robot], text, (landmark) => this.look({ ...landmark, robot }))));
      if (!verb) return item;
      const button = html("button", { type: "button", "aria-label": `${verb.label}: ${text}` }, verb.label);
      button.addEventListener("click", () => this.orders.begin(verb, name));
      item.append(button);
      return item;
    });
    const list = items.length ? items : [html("li", { class: "nothing" }, nothingToDo(run))];
    const recorded = isReplay ? [html("li", { class: "nothing" }, html("b", {}, "This is a recording"), ` of ${beginning(run)}. Nothing shown here is happening now.${items.length ? " To do at that time:" : ""}`)] : [];
    this.place.querySelector("ul").replaceChildren(...recorded, ...(isReplay && !items.length ? [] : list), ...awaited(run));
  }
}

/** Return the text that the page shows if there are no tasks. */
function nothingToDo(run) {
  if (run.awaited.length) return "Nothing to do: the run starts now.";
  return run.run.number ? "Nothing to do" : "The run has not started yet. Its terminal lists the requirements for which it waits.";
}

/** The checklist of a run that has not started. */
function awaited(run) {
  if (!run.awaited.length) return [];
  const items = run.awaited.map(({ name, problem }) => html("span", { class: problem ? "missing" : "there" }, html("b", { "aria-hidden": "true" }, problem ? "…" : "✓"), html("span", { class: "unseen" }, problem ? "waiting for " : "available: "), name));
  return [html("li", { class: "checklist" }, ...items)];
}

/** The alarms, which stay until the operator has acknowledged them. */
export class AlarmsView {
  /**
   * @param {HTMLElement} place the element of the alarms.
   * @param {HTMLInputElement} sound the switch for the sound of new alarms.
   * @param {Function} look shows a landmark that an alarm names.
   */
  constructor(place, sound, look) {
    Object.assign(this, { place, sound, look });
    this.seen = new Set(remembered());
    this.known = new Set();
  }

  show(stream) {
    const all = stream.runs.flatMap((run, robot) => run.alarms.map((alarm) => ({ ...alarm, robot, who: stream.isTeam ? stream.names[robot] : "", id: [stream.names[robot], run.run.wall, alarm.run, alarm.text].join("\n") })));
    const open = all.filter(({ id, is_over: isOver }) => !isOver || !this.seen.has(id)).sort((one, other) => this.seen.has(one.id) - this.seen.has(other.id) || other.run - one.run || other.time - one.time);
    const told = open.map((each) => ({ ...each, isSeen: this.seen.has(each.id) }));
    this.ring(told.filter(({ isSeen, id }) => !isSeen && !this.known.has(id)).length);
    for (const { id } of told) this.known.add(id);
    const key = JSON.stringify(told);
    if (key === this.key) return;
    this.key = key;
    this.place.hidden = !told.length;
    this.place.querySelector("ul").replaceChildren(...told.map((alarm) => this.item(alarm, stream)));
  }

  item({ text, level, is_over: isOver, isSeen, time, who, id, robot }, stream) {
    const said = [who, text].filter(Boolean).join(": ");
    const serious = level >= 40 ? "error" : "warning";
    const item = html("li", { class: `${serious}${isSeen ? " seen" : ""}` }, html("b", { "aria-hidden": "true" }, CONDITIONS[serious]), html("span", {}, ...(who ? [`${who}: `] : []), ...linked(stream.runs[robot], text, (landmark) => this.look({ ...landmark, robot })), html("small", {}, `at ${clock(time)}${isOver ? ", over" : ""}`)));
    if (isSeen) return item;
    const button = html("button", { type: "button", "aria-label": `Seen: ${said}` }, "Seen");
    button.addEventListener("click", () => {
      this.seen.add(id);
      remember([...this.seen].slice(-REMEMBERED));
      this.show(stream);
    });
    item.append(button);
    return item;
  }

  /** Play two short tones for a new alarm if sound is on. */
  ring(count) {
    if (!count || !this.sound.checked) return;
    const audio = new AudioContext();
    for (const [at, pitch] of [[0, 880], [0.25, 660]]) {
      const [tone, volume] = [audio.createOscillator(), audio.createGain()];
      tone.frequency.value = pitch;
      volume.gain.value = 0.2;
      tone.connect(volume).connect(audio.destination);
      tone.start(audio.currentTime + at);
      tone.stop(audio.currentTime + at + 0.2);
    }
  }
}

function remembered() {
  try {
    return JSON.parse(localStorage.getItem(SEEN)) ?? [];
  } catch {
    return [];
  }
}

function remember(ids) {
  try {
    localStorage.setItem(SEEN, JSON.stringify(ids));
  } catch {
    // Without the stored alarms, a reloaded page shows seen alarms as new.
  }
}

/** Cards for the robots of a team: status, gauges, task and age of the position. The card of the selected robot is shown as pressed. */
export class CardsView {
  constructor(place) {
    this.place = place;
  }

  show(stream) {
    this.place.hidden = !stream.isTeam;
    if (!stream.isTeam) return;
    const key = stream.names.join("\n");
    if (this.place.dataset.key !== key) {
      this.place.dataset.key = key;
      this.place.replaceChildren(...stream.names.map((name, index) => this.card(name, index, stream)));
    }
    stream.runs.forEach((run, index) => {
      const card = this.place.children[index];
      const [, state, task, gauges] = card.children;
      card.setAttribute("aria-pressed", String(index === stream.chosen));
      showCondition(state, conditionOf(stream, run), false);
      const isOld = isStale(stream, run);
      card.classList.toggle("stale", isOld);
      say(task, isOld ? "" : [run.drive ? run.drive.target : run.place, driveLeft(stream, run)].filter(Boolean).join(", "));
      const age = run.times.pose === undefined ? [] : [`position ${clock(run.time - run.times.pose)} old`];
      say(gauges, [...run.gauges.filter(({ value }) => Number.isFinite(value)).map(({ name, value, unit }) => `${name} ${round(value)} ${unit}`.trim()), ...age].join(" · "));
    });
  }

  card(name, index, stream) {
    const card = html("button", { type: "button", class: "card" }, html("strong", {}, name), html("span", { class: "state" }), html("span"), html("small"));
    card.style.setProperty("--robot", hue(index));
    card.addEventListener("click", () => stream.choose(index));
    return card;
  }
}

/** The end of a run: the report, and the command that resumes an interrupted mission. */
export class EndingView {
  /** @param {HTMLElement} place the element to show it in. */
  constructor(place) {
    this.place = place;
  }

  /** @param {string} report the address of the report; empty if there is none. */
  show(stream, run, report) {
    const isOver = !stream.isReplay && (Boolean(run.run.ended) || isCrashed(run));
    const key = JSON.stringify([isOver, run.resume, report, run.condition.word]);
    if (key === this.key) return;
    this.key = key;
    this.place.hidden = !isOver || !(run.resume || report || run.run.ended);
    const copy = html("button", { type: "button" }, "Copy");
    copy.addEventListener("click", () => navigator.clipboard.writeText(run.resume));
    this.place.replaceChildren(
      html("h2", {}, "After the end"),
      ...(report ? [html("a", { class: "button", href: report, target: "_blank" }, "Open the report")] : []),
      ...(run.resume ? [html("p", {}, "Resume the mission on the robot's computer:"), html("p", { class: "command" }, html("code", {}, run.resume), copy)] : []),
      ...(run.run.ended && !run.resume ? [html("p", {}, "This mission is over. A new run starts a new mission.")] : []),
    );
  }
}
