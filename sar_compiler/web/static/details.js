// The details of the selected node.

import { clock, duration, html, say } from "./shapes.js";

const WORDS = ["SUCCESS", "FAILURE", "HALTED"];

/** Show the details of a node in a description list. */
export function showDetails(place, run, id) {
  const node = run.nodes[id];
  if (!node) {
    delete place.dataset.terms;
    place.replaceChildren();
    return;
  }
  const state = run.states[id];
  const ago = (time) => `${duration(run.time - time)} ago, at ${clock(time)}`;
  const former = state.status && !run.isCurrent(id) ? " (from an earlier activation)" : "";
  const rows = [
    ["node", node.name],
    ["type", node.path],
    ["status", state.status ? `${state.status}${former} for ${duration(run.time - state.since)}` : "not ticked yet"],
    ["outcome", state.label],
    ["message", state.message],
    ["last change", state.status ? `${ago(state.time)}, tick ${state.tick}` : ""],
    ["last failure", state.failed === null ? "" : `${state.failure || "no reason given"}, ${ago(state.failed)}`],
    ["ended", ended(state)],
    ["source", node.file ? `${node.file}:${node.line}` : ""],
    ...Object.entries(node.attributes).map(([key, value]) => [key, typeof value === "object" ? JSON.stringify(value) : String(value)]),
  ];
  const shown = rows.filter(([, value]) => value);
  const terms = shown.map(([term]) => term).join("\n");
  if (place.dataset.terms !== terms) {
    place.dataset.terms = terms;
    place.replaceChildren(...shown.flatMap(([term]) => [html("dt", {}, term), html("dd")]));
  }
  // Only changed texts are written, so that users can select other texts.
  shown.forEach(([, value], row) => say(place.children[2 * row + 1], value));
}

/** Return how often the node ended with each status, and the durations. */
function ended({ ends, ran, longest }) {
  const times = ends.flatMap((count, status) => (count ? [`${WORDS[status]} ${count}×`] : []));
  const took = ran ? [`after ${duration(ran / ends.reduce((sum, count) => sum + count))} on average, ${duration(longest)} at most`] : [];
  return [...times, ...took].join(", ");
}
