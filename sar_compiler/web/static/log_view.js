// The last lines of the log: the mission's messages, and its changes of state.

import { landmarkIn, linked } from "./links.js";
import { clock, html } from "./shapes.js";

const LINES = 400;

export class LogView {
  /**
   * @param {HTMLElement} place the element of the lines.
   * @param {Function} look shows a landmark that a line names.
   */
  constructor(place, look = () => {}) {
    Object.assign(this, { place, lookElsewhere: look });
    // The levels that are shown; null for all.
    this.levels = null;
    // Whether the log follows the newest line. It stops when the user scrolls up.
    this.follows = true;
    this.again();
    place.addEventListener("scroll", () => {
      if (place.clientHeight) this.follows = place.scrollTop + place.clientHeight > place.scrollHeight - 40;
    });
    new ResizeObserver(() => this.follow()).observe(place);
  }

  /** Show the current lines. */
  show(run) {
    const { log } = run;
    if (log === this.log) return;
    const wanted = log.filter(({ level }) => !this.levels || this.levels.includes(level)).slice(-LINES);
    // Existing lines are kept, because the user may be reading or selecting them.
    const known = new Map(this.lines);
    this.lines = new Map(wanted.map((each) => [each, known.get(each) ?? this.line(run, each)]));
    for (const [each, element] of known) if (!this.lines.has(each)) element.remove();
    let at = this.place.firstChild;
    for (const element of this.lines.values()) {
      if (element === at) at = at.nextSibling;
      else this.place.insertBefore(element, at);
    }
    [this.log, this.run] = [log, run];
    this.follow();
  }

  /** Mark the lines that name a landmark, and scroll the last of these lines into view. */
  look({ kind, name }) {
    for (const [each, element] of this.lines) {
      const landmark = this.run && landmarkIn(this.run, each);
      element.classList.toggle("looked-at", Boolean(landmark) && landmark.kind === kind && landmark.name === name);
    }
    const last = [...this.place.querySelectorAll(".looked-at")].pop();
    if (last) this.place.scrollTop = last.offsetTop - this.place.offsetTop - this.place.clientHeight / 2;
  }

  /** Clear the log. */
  again() {
    this.place.replaceChildren();
    this.lines = new Map();
    this.log = null;
  }

  follow() {
    if (this.follows) this.place.scrollTop = this.place.scrollHeight;
  }

  line(run, { time, level, text }) {
    const mark = { warning: "!", error: "✗", fact: "•" }[level] ?? "";
    return html("li", { class: level }, html("time", {}, clock(time)), html("b", mark ? { role: "img", "aria-label": level } : {}, mark), html("span", {}, ...linked(run, text, this.lookElsewhere)));
  }
}
