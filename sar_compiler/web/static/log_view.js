// The log, its last lines: what the mission says, and what is true of it.

import { duration, html } from "./shapes.js";

const LINES = 400;

export class LogView {
  constructor(place) {
    this.place = place;
    this.onlyFacts = false;
    // Whether it stays at the newest line: until somebody scrolls up.
    this.follows = true;
    this.again();
    place.addEventListener("scroll", () => {
      if (place.clientHeight) this.follows = place.scrollTop + place.clientHeight > place.scrollHeight - 40;
    });
    new ResizeObserver(() => this.follow()).observe(place);
  }

  /** Show what is there by now. */
  show({ log, logged }) {
    // Else the lines are another run's, or of a time before which a replay has gone back.
    const goesOn = this.shown <= logged && log[this.shown - 1] === this.last;
    if (goesOn && logged === this.shown) return;
    if (!goesOn) this.again();
    const lines = [];
    for (let at = logged - 1; at >= this.shown && lines.length < LINES; at -= 1) {
      if (!this.onlyFacts || log[at].level !== "info") lines.push(line(log[at]));
    }
    this.place.append(...lines.reverse());
    while (this.place.childElementCount > LINES) this.place.firstElementChild.remove();
    this.shown = logged;
    this.last = log[logged - 1];
    this.follow();
  }

  /** Forget what is shown. */
  again() {
    this.place.replaceChildren();
    this.shown = 0;
    this.last = undefined;
  }

  follow() {
    if (this.follows) this.place.scrollTop = this.place.scrollHeight;
  }
}

function line({ time, level, text }) {
  const mark = { warning: "!", error: "✗", fact: "•" }[level] ?? "";
  return html("li", { class: level }, html("time", {}, duration(time)), html("b", { "aria-label": level }, mark), html("span", {}, text));
}
