// The landmarks in words: of each kind all that have a state.

import { duration, html, sign } from "./shapes.js";

export class PlacesView {
  constructor(place) {
    this.place = place;
  }

  show(run) {
    const kinds = Object.values(run.kinds);
    const all = [...run.landmarks.values()];
    const lists = kinds.map((kind) => [kind, all.filter((each) => each.kind === kind.name && each.state)]).filter(([, found]) => found.length);
    const told = lists.map(([{ plural }, found]) => [plural, found.map((each) => [sign(each, run.kindOf(each)), each.name, inWords(each)])]);
    const key = JSON.stringify(told);
    if (this.key === key) return;
    this.key = key;
    this.place.hidden = !told.length;
    this.place.replaceChildren(...told.flatMap(([plural, found]) => [html("h2", {}, `${plural} (${found.length})`), html("ul", {}, ...found.map(item))]));
  }
}

function item([mark, name, words]) {
  return html("li", {}, html("b", {}, mark), html("span", {}, html("strong", {}, name), ` ${words}`));
}

/** All that is known of a landmark: its state, the reason, and what else there is. */
export function inWords({ state, reason, within, details }) {
  const more = Object.entries(details ?? {}).map(([name, value]) => `${name} ${said(value)}`);
  const where = within ? [`in ${within}`] : [];
  return [[state, reason].filter(Boolean).join(", "), ...where, ...more].filter(Boolean).join("; ");
}

function said(value) {
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : value.toFixed(2);
  if (typeof value !== "object") return String(value);
  return Number.isFinite(value.time) ? `at ${duration(value.time)}${value.run > 1 ? ` of run ${value.run}` : ""}` : JSON.stringify(value);
}
