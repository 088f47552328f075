// The last lines of the log: the mission's messages, and its changes of state.

import { clock, html } from "./shapes.js";

const LINES = 400;

export class LogView {
  constructor(place) {
    this.place = place;
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
  show({ log }) {
    if (log === this.log) return;
    const wanted = log.filter(({ level }) => !this.levels || this.levels.includes(level)).slice(-LINES);
    // Existing lines are kept, because the user may be reading or selecting them.
    const known = new Map(this.lines);
    this.lines = new Map(wanted.map((each) => [each, known.get(each) ?? line(each)]));
    for (const [each, element] of known) if (!this.lines.has(each)) element.remove();
    let at = this.place.firstChild;
    for (const element of this.lines.values()) {
      if (element === at) at = at.nextSibling;
      else this.place.insertBefore(element, at);
    }
    this.log = log;
    this.follow();
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
}

function line({ time, level, text }) {
  const mark = { warning: "!", error: "✗", fact: "•" }[level] ?? "";
  return html("li", { class: level }, html("time", {}, clock(time)), html("b", mark ? { role: "img", "aria-label": level } : {}, mark), html("span", {}, text));
}
