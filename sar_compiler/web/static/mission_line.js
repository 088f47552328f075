// The mission as a line with finished and abandoned landmarks, detections, alarms, the current time, and the expected end.

import { isMoving } from "./condition_view.js";
import { landmarkIn } from "./links.js";
import { clock, html, icon, mark, say, set } from "./shapes.js";

const DONE = 2;
// The minimum distance of two marks, as a fraction of the line; equal marks that are nearer are drawn once.
const APART = 0.02;

export class MissionLine {
  /**
   * @param {HTMLElement} place the element to draw in.
   * @param {Function} look shows a landmark.
   */
  constructor(place, look) {
    Object.assign(this, { place, look });
    this.past = html("i");
    this.now = html("b", {}, "▾");
    this.marks = html("span");
    this.track = html("div", { role: "img" }, this.past, this.marks, this.now);
    this.words = html("p");
    place.append(this.track, this.words);
  }

  show(stream) {
    const { run } = stream;
    this.place.hidden = !run.run.number;
    if (!run.run.number) return;
    const isOver = !isMoving(stream, run) && Boolean(run.run.ended);
    const length = stream.isReplay ? stream.end : Math.max(run.time, isOver ? 0 : (run.estimate.end ?? 0), 1);
    const share = (time) => Math.max(0, Math.min(1, time / Math.max(length, 1)));
    const now = `${(100 * share(stream.isReplay ? stream.shown : run.time)).toFixed(1)}%`;
    this.past.style.width = this.now.style.left = now;
    if (this.log !== run.log || this.version !== run.version || this.alarms !== run.alarms) {
      Object.assign(this, { log: run.log, version: run.version, alarms: run.alarms, reached: reached(run) });
    } else if (this.shown === `${Math.floor(run.time)} ${Math.floor(length)}`) return;
    this.shown = `${Math.floor(run.time)} ${Math.floor(length)}`;
    const found = apart(this.reached.map((each) => ({ ...each, at: share(each.time) })));
    const key = found.map(({ at, name, text, landmark }) => `${at.toFixed(3)} ${name} ${text} ${landmark?.level} ${landmark?.is_certain}`).join("\n");
    if (key !== this.key) this.marks.replaceChildren(...found.map((each) => this.mark(run, each)));
    this.key = key;
    const last = run.log.findLast(({ level, run: number }) => level === "fact" && number === run.run.number);
    const end = isOver || run.estimate.end == null || run.estimate.end < run.time ? "" : `end at about ${clock(run.estimate.end)}`;
    say(this.words, [last ? `last: ${clock(last.time)} ${last.text}` : "", end].filter(Boolean).join(" · "));
    set(this.track, { "aria-label": `The mission until ${clock(run.time)}: ${found.map(({ time, text }) => `${clock(time)} ${text}`).join(", ") || "nothing yet"}` });
  }

  mark(run, { at, text, time, landmark }) {
    const sign = landmark ? icon(mark(landmark, run.kindOf(landmark))) : html("em", {}, "⚑");
    const place = html("span", { title: `${clock(time)} ${text}` }, sign);
    place.style.left = `${(100 * at).toFixed(2)}%`;
    if (landmark) place.addEventListener("click", () => this.look(landmark));
    return place;
  }
}

/** Return the landmarks that were finished, found or abandoned, and the alarms, each with its time in this run. */
function reached(run) {
  const times = new Map();
  for (const line of run.log) {
    const landmark = line.level === "fact" && line.run === run.run.number ? landmarkIn(run, line) : undefined;
    const isFound = landmark && run.kindOf(landmark).is_found;
    if (landmark && (isFound ? !times.has(landmark) : landmark.level >= DONE)) times.set(landmark, line.time);
  }
  const places = [...times].map(([landmark, time]) => ({ time, landmark, name: landmark.name, text: `${landmark.name} ${landmark.state}`.trim() }));
  const alarms = run.alarms.filter((alarm) => alarm.run === run.run.number).map(({ time, text }) => ({ time, text, name: "" }));
  return [...places, ...alarms].sort((one, other) => one.time - other.time);
}

/** Omit each mark that looks like the previous mark and would cover it. */
function apart(marks) {
  const look = ({ landmark }) => `${landmark?.kind} ${landmark?.level}`;
  return marks.filter((each, index) => !index || each.at - marks[index - 1].at >= APART || look(each) !== look(marks[index - 1]));
}
