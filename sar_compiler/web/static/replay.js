// Runs that are over, through which one goes back and forth; one of each robot, side by side.

import { Run, putBack, snapshot } from "./run.js";

const EVERY = 2000;
// Robots whose clocks are farther apart have nothing to do with each other, in seconds.
const APART = 24 * 3600;

export class Recording {
  /** @param {number} count how many robots there are. */
  constructor(count) {
    this.runs = Array.from({ length: count }, () => new Run());
    // Of each robot: when it first began, the beginning of its present run, what passed before that, and its end so far.
    this.tracks = this.runs.map(() => ({ first: null, began: 0, before: 0, end: 0 }));
    this.steps = [];
    this.copies = [];
    this.last = this.runs.map(() => null);
    this.next = 0;
  }

  /** Take further entries: the runs of a robot come one after the other, without what passed between them. */
  add(entries) {
    for (const entry of entries) {
      const track = this.tracks[entry.robot];
      if (entry.kind === "run_began") Object.assign(track, { began: entry.time, before: track.end, first: track.first ?? entry.time });
      track.end = Math.max(track.end, track.before + entry.time - track.began);
      this.steps.push({ entry, time: track.end });
    }
  }

  /** Put the robots side by side, once all entries are there. */
  ready() {
    const firsts = this.tracks.map(({ first }) => first ?? Infinity);
    const begin = Math.min(...firsts);
    const later = firsts.map((first) => (first - begin < APART ? first - begin : 0));
    for (const step of this.steps) step.time += later[step.entry.robot];
    this.tracks.forEach((track, robot) => { track.end += later[robot]; });
    this.steps.sort((one, other) => one.time - other.time);
  }

  /** The length of it, in seconds of the mission's clock. */
  get end() {
    return this.steps.length ? this.steps[this.steps.length - 1].time : 0;
  }

  /** Put the runs to how they were at a time. */
  at(time) {
    if (this.next > 0 && this.steps[this.next - 1].time > time) this.back(time);
    while (this.next < this.steps.length && this.steps[this.next].time <= time) {
      if (this.copies.length * EVERY === this.next) this.copies.push({ runs: this.runs.map(snapshot), last: this.last.slice() });
      const step = this.steps[this.next];
      this.runs[step.entry.robot].apply(step.entry);
      this.last[step.entry.robot] = step;
      this.next += 1;
    }
    // Between two entries time passes as well; not beyond the last one.
    this.last.forEach((step, robot) => {
      if (step) this.runs[robot].time = step.entry.time + Math.max(0, Math.min(time, this.tracks[robot].end) - step.time);
    });
  }

  back(time) {
    let copy = this.copies.length - 1;
    while (copy > 0 && this.steps[copy * EVERY - 1].time > time) copy -= 1;
    this.runs.forEach((run, robot) => putBack(run, this.copies[copy].runs[robot]));
    this.last = this.copies[copy].last.slice();
    this.next = copy * EVERY;
  }
}
