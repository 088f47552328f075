// The names of landmarks in texts, as links to the map and the lists.

import { html } from "./shapes.js";

// Caches: for each run, the names of its landmarks; for each line of a log, the first name in the line.
const [known, inLines] = [new WeakMap(), new WeakMap()];

/** Return the landmark that a line of the log names first; undefined if it names none. */
export function landmarkIn(run, line) {
  const { pattern, places } = namesOf(run);
  let found = inLines.get(line);
  if (!found || found.pattern !== pattern) inLines.set(line, (found = { pattern, name: pattern?.exec(line.text)?.[0] }));
  const place = places.get(found.name);
  return place && run.landmarks.get(`${place.kind}/${place.name}`);
}

/** Return the parts of a text, each name of a landmark as a button that shows it. */
export function linked(run, text, look) {
  const { pattern, places } = namesOf(run);
  if (!pattern) return [text];
  const parts = [];
  let at = 0;
  for (const { 0: name, index } of text.matchAll(new RegExp(pattern, "gu"))) {
    parts.push(text.slice(at, index), link(name, places.get(name), look));
    at = index + name.length;
  }
  return [...parts, text.slice(at)];
}

/** Return a button that shows a landmark. */
export function link(text, landmark, look) {
  const button = html("button", { type: "button", class: "link" }, text);
  button.addEventListener("click", () => look(landmark));
  return button;
}

function namesOf(run) {
  const last = known.get(run);
  if (last?.version === run.version) return last;
  const places = new Map();
  // A point takes precedence over the outline of the same name.
  for (const { kind, name, corners } of run.landmarks.values()) if (!corners.length || !places.has(name)) places.set(name, { kind, name });
  const written = [...places.keys()].join("\n");
  if (last?.written === written) return Object.assign(last, { version: run.version, places });
  const names = [...places.keys()].filter(Boolean).sort((one, other) => other.length - one.length).map((name) => name.replace(/[\\^$.*+?()[\]{}|/-]/g, "\\$&"));
  const pattern = names.length ? new RegExp(`(?<![\\p{L}\\p{N}_])(?:${names.join("|")})(?![\\p{L}\\p{N}_])`, "u") : null;
  known.set(run, { version: run.version, written, pattern, places });
  return known.get(run);
}
