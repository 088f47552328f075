// The details of the selected node.

import { clock, duration, html, say } from "./shapes.js";

const WORDS = ["SUCCESS", "FAILURE", "HALTED"];

/** Show a node of a run in a list of terms. */
export function showDetails(place, run, id) {
  const node = run.nodes[id];
  if (!node) {
    delete place.dataset.terms;
    place.replaceChildren();
    return;
  }
  const state = run.states[id];
  const ago = (time) => `${duration(run.time - time)} ago, at ${clock(time)}`;
  const former = state.status && !run.isCurrent(id) ? " (of an earlier activation)" : "";
  const rows = [
    ["node", node.name],
    ["type", node.path],
    ["status", state.status ? `${state.status}${former} for ${duration(run.time - state.since)}` : "not ticked yet"],
    ["answer", state.label],
    ["says", state.message],
    ["last change", state.status ? `${ago(state.time)}, tick ${state.tick}` : ""],
    ["last failure", state.failed === null ? "" : `${state.failure || "without a reason"}, ${ago(state.failed)}`],
    ["ended", ended(state)],
    ["written at", node.file ? `${node.file}:${node.line}` : ""],
    ...Object.entries(node.attributes).map(([key, value]) => [key, typeof value === "object" ? JSON.stringify(value) : String(value)]),
  ];
  const shown = rows.filter(([, value]) => value);
  const terms = shown.map(([term]) => term).join("\n");
  if (place.dataset.terms !== terms) {
    place.dataset.terms = terms;
    place.replaceChildren(...shown.flatMap(([term]) => [html("dt", {}, term), html("dd")]));
  }
  // Only what is another text is written, so that the rest can be selected meanwhile.
  shown.forEach(([, value], row) => say(place.children[2 * row + 1], value));
}

/** How often it has ended with which status, and how long that took. */
function ended({ ends, ran, longest }) {
  const times = ends.flatMap((count, status) => (count ? [`${WORDS[status]} ${count}×`] : []));
  const took = ran ? [`after ${duration(ran / ends.reduce((sum, count) => sum + count))} on average, ${duration(longest)} at most`] : [];
  return [...times, ...took].join(", ");
}
