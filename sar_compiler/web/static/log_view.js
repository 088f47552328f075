// The log, its last lines: what the mission says, and what is true of it.

import { duration, html } from "./shapes.js";

const LINES = 400;

export class LogView {
  constructor(place) {
    this.place = place;
    this.shown = 0;
    this.onlyFacts = false;
  }

  /** Show what is there by now. */
  show({ log, logged }) {
    if (logged === this.shown) return;
    const atEnd = this.place.scrollTop + this.place.clientHeight > this.place.scrollHeight - 40;
    if (logged < this.shown || logged - this.shown > LINES) {
      this.place.replaceChildren();
      this.shown = Math.max(0, logged - LINES);
    }
    const lines = log.slice(this.shown, logged).filter(({ level }) => !this.onlyFacts || level !== "info");
    this.place.append(...lines.map(line));
    this.shown = logged;
    while (this.place.childElementCount > LINES) this.place.firstElementChild.remove();
    if (atEnd) this.place.scrollTop = this.place.scrollHeight;
  }

  again(run) {
    this.place.replaceChildren();
    this.shown = Infinity;
    this.show(run);
  }
}

function line({ time, level, text }) {
  const mark = { warning: "!", error: "✗", fact: "•" }[level] ?? "";
  return html("li", { class: level }, html("time", {}, duration(time)), html("b", { "aria-label": level }, mark), html("span", {}, text));
}
