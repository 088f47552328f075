// Elements of the page, and the appearance of statuses: each status has its own colour, shape and letter.

import { FOUND, LEVELS, MARKS, STATUSES } from "./signs.js";

const SVG = "http://www.w3.org/2000/svg";

/** Create an HTML element. Strings among the children become text nodes, never markup. */
export function html(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** Create an SVG element. */
export function svg(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

function filled(element, attributes, children) {
  set(element, attributes);
  element.append(...children);
  return element;
}

/** Set an element's attributes; remove those that are undefined, null or false. */
export function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) element.removeAttribute(name);
    else element.setAttribute(name, value);
  }
}

/** Set the text of an element if it differs. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Format seconds as minutes and seconds, with tenths below ten seconds. */
export function duration(seconds) {
  const whole = Math.max(0, seconds);
  if (whole < 10) return `${whole.toFixed(1)} s`;
  if (whole < 100) return `${Math.round(whole)} s`;
  const minutes = Math.floor(whole / 60);
  const rest = String(Math.floor(whole % 60)).padStart(2, "0");
  return minutes < 60 ? `${minutes}:${rest}` : `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${rest}`;
}

/** Format seconds for operators as hours (if any), minutes and seconds. */
export function clock(seconds) {
  const whole = Math.max(0, Math.floor(seconds ?? 0));
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60), String(whole % 60).padStart(2, "0")];
  return hours ? `${hours}:${String(minutes % 60).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}

/** Draw the sign of a status, 16 units wide: a shape with a letter. `former` signs, from an earlier activation, are hollow. */
export function badge(status, former = false) {
  const [letter, path] = STATUSES[status] ?? STATUSES[""];
  const sign = svg("g", { class: `badge ${status || "none"}${former ? " former" : ""}` }, svg("path", { d: path }));
  if (letter) sign.append(svg("text", { x: status === "RUNNING" ? 6.7 : 8, y: 11.6, "text-anchor": "middle" }, letter));
  return sign;
}

// The names of the colours of a team's robots.
const HUES = ["trail", "success", "skipped"];

/** Return the colour of a robot by its index; empty for the default colour. */
export function hue(index) {
  const name = HUES[(index % (HUES.length + 1)) - 1];
  return name ? `var(--${name})` : "";
}

/** The meanings of the status signs. */
export const STATUS_WORDS = { RUNNING: "running", SUCCESS: "success", FAILURE: "failure", HALTED: "halted", SKIPPED: "skipped", "": "not ticked yet" };

/** The sign of a landmark's progress, or of a detection that needs a review. */
export function sign({ level }, { is_found: isFound }) {
  return isFound && level < 2 ? FOUND.sign : (LEVELS[level]?.sign ?? "");
}

/** Draw the mark of a landmark for the map and for texts, about 24 units wide and centred at the origin. */
export function mark(landmark, kind) {
  const known = [LEVELS[landmark.level]?.word, kind.is_found && FOUND.word, landmark.is_certain && "certain"].filter(Boolean).join(" ");
  const group = svg("g", { class: `mark ${known}` }, svg("path", { d: MARKS[kind.shape] ?? MARKS.circle }));
  const text = sign(landmark, kind);
  if (text) group.append(svg("text", { class: "sign", y: 5 }, text));
  return group;
}

/** Return a mark as a separate SVG picture. */
export function icon(drawn) {
  return svg("svg", { viewBox: "-14 -14 28 28", width: 22, height: 22, "aria-hidden": "true" }, drawn);
}
