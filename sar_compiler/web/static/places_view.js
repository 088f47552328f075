// A list of all landmarks of each kind that have a state.

import { clock, html, icon, mark } from "./shapes.js";

export class PlacesView {
  constructor(place) {
    this.place = place;
  }

  show(stream) {
    const { run } = stream;
    const all = [...run.landmarks.values()];
    const lists = Object.values(run.kinds).map((kind) => [kind, all.filter((each) => each.kind === kind.name && each.state)]).filter(([, found]) => found.length);
    const told = lists.map(([kind, found]) => [kind, found.map((each) => ({ ...each, name: stream.nameOf(run, each.name) }))]);
    const key = JSON.stringify(told);
    if (this.key === key) return;
    this.key = key;
    this.place.hidden = !told.length;
    this.place.replaceChildren(...told.flatMap(([kind, found]) => [html("h2", {}, `${kind.plural}${found.length > 1 ? ` (${found.length})` : ""}`), html("ul", {}, ...found.map((each) => item(each, kind)))]));
  }
}

function item(landmark, kind) {
  const { name, x, y, state, reason } = landmark;
  const where = kind.is_found ? [`x ${x.toFixed(2)}, y ${y.toFixed(2)}`] : [];
  const more = [...where, ...details(landmark)].join(" · ");
  return html("li", {}, icon(mark(landmark, kind)), html("span", {}, html("strong", {}, name), ` ${[state, reason].filter(Boolean).join(", ")}`, ...(more ? [html("small", {}, more)] : [])));
}

/** All that is known of a landmark: its state, the reason, and what else there is. */
export function inWords(landmark) {
  const { state, reason } = landmark;
  return [[state, reason].filter(Boolean).join(", "), ...details(landmark)].filter(Boolean).join("; ");
}

/** What else is known of a landmark; a number that is nought says nothing. */
function details({ within, details: known }) {
  const where = within ? [`in ${within}`] : [];
  return [...where, ...Object.entries(known ?? {}).filter(([, value]) => value !== 0).map(([name, value]) => `${name} ${said(value)}`)];
}

function said(value) {
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : value.toFixed(2);
  if (typeof value !== "object") return String(value);
  return Number.isFinite(value.time) ? `at ${clock(value.time)}${value.run > 1 ? ` of run ${value.run}` : ""}` : JSON.stringify(value);
}
