// The monitored properties of a run: a card for each property with its state in this run.

import { clock, html } from "./shapes.js";
import { PROPERTIES } from "./signs.js";

const WORDS = { watched: "monitored", owed: "pending: a required event is missing", kept: "satisfied" };
const DONE = { hold: "a violation pauses the mission", abort: "a violation aborts the mission" };

export class PropertiesView {
  /**
   * @param {HTMLDetailsElement} place the element of the cards.
   */
  constructor(place) {
    this.place = place;
  }

  show({ properties: { watched, assumption_failed_at } }) {
    const key = JSON.stringify([watched, assumption_failed_at]);
    if (key === this.key) return;
    this.key = key;
    this.place.hidden = !watched.length;
    const counts = Object.keys(PROPERTIES).reverse().map((word) => [watched.filter((each) => each.word === word).length, word]);
    const [summary, note, list] = ["summary", "p", "ul"].map((each) => this.place.querySelector(each));
    const said = counts.filter(([count]) => count).map(([count, word]) => `${count} ${word}`).join(", ");
    summary.replaceChildren(html("span", {}, html("b", {}, "Properties"), `: ${said}`));
    summary.classList.toggle("broken", counts[0][0] > 0);
    note.hidden = assumption_failed_at === null;
    note.textContent = assumption_failed_at === null ? "" : `Since ${clock(assumption_failed_at)}, the run contradicts an assumption of the verification, so its results no longer apply.`;
    const order = [...watched].sort((one, other) => (other.word === "broken") - (one.word === "broken"));
    list.replaceChildren(...order.map(card));
  }
}

function card({ name, word, since, event, if_broken: done }) {
  const said = word === "broken" ? `violated at ${clock(since)} (${event || "at the end"})` : WORDS[word];
  const more = word === "broken" || !DONE[done] ? [] : [html("small", {}, DONE[done])];
  return html("li", { class: PROPERTIES[word].word }, html("strong", {}, name), html("div", {}, state(PROPERTIES[word], said)), ...more);
}

function state({ word, sign }, said) {
  return html("span", { class: word }, html("b", { "aria-hidden": "true" }, sign), ` ${said}`);
}
