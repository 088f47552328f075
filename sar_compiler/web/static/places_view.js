// A list of all landmarks of each kind that have a state, with the review of detections.

import { link } from "./links.js";
import { clock, html, icon, mark } from "./shapes.js";

const [DONE, GIVEN_UP] = [2, 3];
// The levels in the order of the rows: in progress, abandoned, planned, done.
const ORDER = { 1: 0, [GIVEN_UP]: 1, 0: 2, [DONE]: 3 };

export class PlacesView {
  /**
   * @param {HTMLElement} place the element of the lists.
   * @param {Function} look shows a landmark on the map and in the log.
   * @param {import("./orders.js").Orders} orders the commands, some of which review detections.
   */
  constructor(place, look = () => {}, orders = null) {
    Object.assign(this, { place, lookElsewhere: look, orders });
  }

  /** Scroll the row of a landmark into view, and mark the row. */
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
    // Detections come first: people depend on them.
    lists.sort(([one], [other]) => other.is_found - one.is_found);
    const told = lists.map(([kind, found]) => [kind, [...found].sort((one, other) => ORDER[one.level] - ORDER[other.level]).map((each) => ({ ...each, shown: stream.nameOf(run, each.name), verdicts: this.verdicts(each, kind) }))]);
    const key = JSON.stringify(told);
    if (this.key === key) return;
    this.key = key;
    this.place.hidden = !told.length;
    this.place.replaceChildren(...told.flatMap(([kind, found]) => [html("h2", {}, `${kind.plural}${found.length > 1 ? ` (${found.length})` : ""}`), html("ul", {}, ...found.map((each) => this.item(each, kind)))]));
  }

  /** Return the choices of the command that can currently review a detection, each with field, value and label; none for other landmarks. */
  verdicts({ level, is_certain: isCertain }, { review }) {
    const verb = review && level !== GIVEN_UP && !isCertain ? this.orders?.find(review) : null;
    const field = verb?.fields.find(({ kind, optional }) => kind === "choice" && !optional);
    return field ? field.choices.map(([value, label]) => [field.name, value, label]) : [];
  }

  item(landmark, kind) {
    const { name, shown, x, y, state, reason, level, verdicts } = landmark;
    const where = kind.is_found ? [`x ${x.toFixed(2)}, y ${y.toFixed(2)}`] : [];
    // Completed items show only their state.
    const more = level === DONE && !kind.is_found ? "" : [...where, ...details(landmark)].join(" · ");
    const buttons = verdicts.map(([field, value, label]) => {
      const button = html("button", { type: "button", "aria-label": `${name} is ${label}` }, label);
      button.addEventListener("click", () => this.orders.begin(this.orders.find(kind.review), name, { [field]: value }));
      return button;
    });
    const line = html("span", {}, link(shown, landmark, this.lookElsewhere), ` ${[state, reason].filter(Boolean).join(", ")}`, ...(more ? [html("small", {}, more)] : []), ...(buttons.length ? [html("span", { class: "verdicts" }, ...buttons)] : []));
    return html("li", { "data-key": `${landmark.kind}/${name}` }, icon(mark(landmark, kind)), line);
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
