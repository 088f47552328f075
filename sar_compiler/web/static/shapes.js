// Elements of the page, and the look of a status: colour, shape and letter each identify it.

import { FOUND, LEVELS, MARKS, STATUSES } from "./signs.js";

const SVG = "http://www.w3.org/2000/svg";

/** Make an element of HTML; a text among the children is text, whatever is in it. */
export function html(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** Make an element of SVG. */
export function svg(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

function filled(element, attributes, children) {
  set(element, attributes);
  element.append(...children);
  return element;
}

/** Give an element attributes; it is without those that are undefined, null or false. */
export function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) element.removeAttribute(name);
    else element.setAttribute(name, value);
  }
}

/** Write a text into an element, if it is another one. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Seconds as minutes and seconds; tenths below ten seconds. */
export function duration(seconds) {
  const whole = Math.max(0, seconds);
  if (whole < 10) return `${whole.toFixed(1)} s`;
  if (whole < 100) return `${Math.round(whole)} s`;
  const minutes = Math.floor(whole / 60);
  const rest = String(Math.floor(whole % 60)).padStart(2, "0");
  return minutes < 60 ? `${minutes}:${rest}` : `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${rest}`;
}

/** Seconds as minutes and seconds, and hours if there are any: what an operator reads, as on the mission's clock. */
export function clock(seconds) {
  const whole = Math.max(0, Math.floor(seconds ?? 0));
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60), String(whole % 60).padStart(2, "0")];
  return hours ? `${hours}:${String(minutes % 60).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}

/** The sign of a status, 16 wide: a shape with a letter. `former` ones are hollow: they are from an earlier activation. */
export function badge(status, former = false) {
  const [letter, path] = STATUSES[status] ?? STATUSES[""];
  const sign = svg("g", { class: `badge ${status || "none"}${former ? " former" : ""}` }, svg("path", { d: path }));
  if (letter) sign.append(svg("text", { x: status === "RUNNING" ? 6.7 : 8, y: 11.6, "text-anchor": "middle" }, letter));
  return sign;
}

/** What the signs of statuses mean, in words. */
export const STATUS_WORDS = { RUNNING: "running", SUCCESS: "success", FAILURE: "failure", HALTED: "halted", SKIPPED: "skipped", "": "not ticked yet" };

/** The sign of a landmark: how far it is; of one that was found, that somebody must see to it. */
export function sign({ level }, { is_found: isFound }) {
  return isFound && level < 2 ? FOUND.sign : (LEVELS[level]?.sign ?? "");
}

/** The mark of a landmark, some 24 wide around its middle, as it is on the map and wherever it is named. */
export function mark(landmark, kind) {
  const known = [LEVELS[landmark.level]?.word, kind.is_found && FOUND.word, landmark.is_certain && "certain"].filter(Boolean).join(" ");
  const group = svg("g", { class: `mark ${known}` }, svg("path", { d: MARKS[kind.shape] ?? MARKS.circle }));
  const text = sign(landmark, kind);
  if (text) group.append(svg("text", { class: "sign", y: 5 }, text));
  return group;
}

/** A mark as a picture of its own. */
export function icon(drawn) {
  return svg("svg", { viewBox: "-14 -14 28 28", width: 22, height: 22, "aria-hidden": "true" }, drawn);
}
