// A list of all landmarks of each kind that have a state.

import { clock, html, icon, mark } from "./shapes.js";

const DONE = 2;
// The levels in the order of the rows: what is in hand, what was given up, what is to come, what is done.
const ORDER = { 1: 0, 3: 1, 0: 2, [DONE]: 3 };

export class PlacesView {
  /** @param {Function} look shows a landmark on the map. */
  constructor(place, look = () => {}) {
    Object.assign(this, { place, lookOnMap: look });
  }

  /** Bring the row of a landmark into sight, and mark it. */
  look({ kind, name }) {
    for (const row of this.place.querySelectorAll("li")) {
      const isIt = row.dataset.key === `${kind}/${name}`;
      row.classList.toggle("looked-at", isIt);
      if (isIt) row.scrollIntoView({ block: "nearest" });
    }
  }

  show(stream) {
    const { run } = stream;
    const all = [...run.landmarks.values()];
    const lists = Object.values(run.kinds).map((kind) => [kind, all.filter((each) => each.kind === kind.name && each.state)]).filter(([, found]) => found.length);
    const told = lists.map(([kind, found]) => [kind, [...found].sort((one, other) => ORDER[one.level] - ORDER[other.level]).map((each) => ({ ...each, shown: stream.nameOf(run, each.name) }))]);
    const key = JSON.stringify(told);
    if (this.key === key) return;
    this.key = key;
    this.place.hidden = !told.length;
    this.place.replaceChildren(...told.flatMap(([kind, found]) => [html("h2", {}, `${kind.plural}${found.length > 1 ? ` (${found.length})` : ""}`), html("ul", {}, ...found.map((each) => this.item(each, kind)))]));
  }
  item(landmark, kind) {
    const { name, shown, x, y, state, reason, level } = landmark;
    const where = kind.is_found ? [`x ${x.toFixed(2)}, y ${y.toFixed(2)}`] : [];
    // Of what is done, the state is enough.
    const more = level === DONE && !kind.is_found ? "" : [...where, ...details(landmark)].join(" · ");
    const link = html("button", { type: "button", class: "link" }, shown);
    link.addEventListener("click", () => this.lookOnMap(landmark));
    return html("li", { "data-key": `${landmark.kind}/${name}` }, icon(mark(landmark, kind)), html("span", {}, link, ` ${[state, reason].filter(Boolean).join(", ")}`, ...(more ? [html("small", {}, more)] : [])));
  }
}

/** Return the known data of a landmark: state, reason and further values. */
export function inWords(landmark) {
  const { state, reason } = landmark;
  return [[state, reason].filter(Boolean).join(", "), ...details(landmark)].filter(Boolean).join("; ");
}

/** Return the further values of a landmark; zeros are omitted. */
function details({ within, details: known }) {
  const where = within ? [`in ${within}`] : [];
  return [...where, ...Object.entries(known ?? {}).filter(([, value]) => value !== 0).map(([name, value]) => `${name} ${said(value)}`)];
}

function said(value) {
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : value.toFixed(2);
  if (typeof value !== "object") return String(value);
  return Number.isFinite(value.time) ? `at ${clock(value.time)}${value.run > 1 ? ` of run ${value.run}` : ""}` : JSON.stringify(value);
}
