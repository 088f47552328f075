// The properties for which a run is watched: a card for each, with what is known of it in this run, and of all runs. The chance of success is another one.

import { clock, html } from "./shapes.js";
import { PROOFS, PROPERTIES } from "./signs.js";

const WORDS = { watched: "watched", owed: "owed: something still has to come", kept: "kept" };
const DONE = { hold: "if broken, the mission is held", abort: "if broken, the mission is broken off" };

export class PropertiesView {
  /**
   * @param {HTMLDetailsElement} place where they are.
   */
  constructor(place) {
    this.place = place;
  }

  show({ properties: { watched, doubted }, proofs, chance, run: { ended } }) {
    // Once the run is over there is nothing to expect.
    const expected = ended ? null : chance;
    const key = JSON.stringify([watched, doubted, proofs?.verdicts, expected]);
    if (key === this.key) return;
    this.key = key;
    this.place.hidden = !watched.length && !expected;
    const counts = Object.keys(PROPERTIES).reverse().map((word) => [watched.filter((each) => each.word === word).length, word]);
    const [summary, note, list] = ["summary", "p", "ul"].map((each) => this.place.querySelector(each));
    const said = counts.filter(([count]) => count).map(([count, word]) => `${count} ${word}`).join(", ");
    const success = expected && expected.low !== null ? [html("span", { class: "chance" }, html("b", {}, "Success"), `: ${inPercent(expected)}`)] : [];
    summary.replaceChildren(html("span", {}, html("b", {}, "Properties"), `: ${said}`), ...success);
    summary.classList.toggle("broken", counts[0][0] > 0);
    note.hidden = doubted === null;
    note.textContent = doubted === null ? "" : `From ${clock(doubted)} on the run contradicts what proofs assume; they do not speak of it any more.`;
    const order = [...watched].sort((one, other) => (other.word === "broken") - (one.word === "broken"));
    list.replaceChildren(...(expected ? [chanceCard(expected)] : []), ...order.map((each) => card(each, proofs?.verdicts[each.name])));
  }
}

function chanceCard({ low, said, time, ...more }) {
  const known = low === null ? `not known: ${said}` : inPercent({ low, ...more });
  return html("li", { class: "chance" }, html("strong", {}, "Chance of success from here"), html("div", {}, known), html("small", {}, `at ${clock(time)}, by the chances of the file`));
}

/** A chance, or the bounds of one; what is not certain is never told as if it were. */
function inPercent({ low, high }) {
  const [least, most] = [low, high].map((each) => Math.min(Math.max(Math.round(100 * each), each > 0 ? 1 : 0), each < 1 ? 99 : 100));
  return least === most ? `${least} %` : `between ${least} and ${most} %`;
}

function card({ name, word, since, event, if_broken: done }, proof) {
  const said = word === "broken" ? `broken since ${clock(since)} (${event || "at the end"})` : WORDS[word];
  const more = word === "broken" || !DONE[done] ? [] : [html("small", {}, DONE[done])];
  return html("li", { class: PROPERTIES[word].word }, html("strong", {}, name), html("div", {}, state(PROPERTIES[word], said), ...(proof ? [state(PROOFS[proof], `in all runs: ${proof}`)] : [])), ...more);
}

function state({ word, sign }, said) {
  return html("span", { class: word }, html("b", { "aria-hidden": "true" }, sign), ` ${said}`);
}
