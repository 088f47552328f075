// The map from above: what the robot knows, where it is, where it has been and goes, and the landmarks of its mission.

import { inWords } from "./places_view.js";
import { LEVELS, sign, svg } from "./shapes.js";

// What a landmark looks like, by the shape of its kind.
const SHAPES = {
  circle: () => svg("circle", { r: 11 }),
  triangle: () => svg("path", { d: "M0 -11 L11 9 H-11 Z" }),
  house: () => svg("path", { d: "M-9 9 V-2 L0 -10 L9 -2 V9 Z" }),
  square: () => svg("path", { d: "M-9 -9 H9 V9 H-9 Z" }),
};
const NAMES_ABOVE = ["triangle"];

export class MapView {
  constructor(place) {
    this.place = place;
    this.zoom = 1;
    this.shift = [0, 0];
    this.picking = null;
    this.canvas = svg("svg", { role: "presentation" });
    place.append(this.canvas);
    place.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    place.addEventListener("pointerdown", (event) => this.drag(event));
    place.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.again()).observe(place);
  }

  /** Show a run; where there are several, all of them with their names. */
  show(run, names = [], runs = [run]) {
    this.shown = [run, names, runs];
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !height) return;
    const box = extent(runs);
    const scale = this.zoom * Math.min(width / (box[2] - box[0]), height / (box[3] - box[1]));
    const [cx, cy] = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
    this.at = (x, y) => [width / 2 + (x - cx) * scale + this.shift[0], height / 2 - (y - cy) * scale + this.shift[1]];
    this.from = (px, py) => [cx + (px - width / 2 - this.shift[0]) / scale, cy - (py - height / 2 - this.shift[1]) / scale];
    this.canvas.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const of = (draw) => runs.flatMap((each, index) => draw(each, each === run ? "" : " other", names[index]));
    this.canvas.replaceChildren(
      ...this.ground(run.map ? run : (runs.find(({ map }) => map) ?? run), scale),
      ...of((each) => this.areas(each)),
      ...of((each, other) => this.ways(each, other)),
      ...of((each) => this.landmarks(each)),
      ...of((each, other, name) => this.robot(each, other, name)),
      this.ruler(scale, height),
    );
    this.place.setAttribute("aria-label", `Map. ${described(run)}`);
  }

  ground({ map }, scale) {
    if (!map) return [];
    const [x, y] = this.at(map.x, map.y);
    const size = map.resolution * scale;
    const image = svg("image", {
      href: `data:image/png;base64,${map.png}`, width: map.width * size, height: map.height * size, y: -map.height * size,
      transform: `translate(${x} ${y}) rotate(${(-map.yaw * 180) / Math.PI})`, preserveAspectRatio: "none",
    });
    return [image];
  }

  ways({ trail, plan, pose }, other) {
    const line = (points, name) => svg("polyline", { class: name, points: points.map(([x, y]) => this.at(x, y).map((each) => each.toFixed(1)).join(",")).join(" ") });
    return [line(trail, `trail${other}`), ...(plan.length ? [line(rest(plan, pose), `plan${other}`)] : [])];
  }

  areas(run) {
    return [...run.landmarks.values()].filter(({ corners }) => corners.length).map((each) => {
      const points = each.corners.map(([x, y]) => this.at(x, y).map((at) => at.toFixed(1)).join(",")).join(" ");
      return svg("polygon", { class: `area ${LEVELS[each.level]}`, points }, svg("title", {}, titled(each)));
    });
  }

  landmarks(run) {
    const points = [...run.landmarks.values()].filter(({ corners }) => !corners.length);
    // What was found lies on what was known before.
    return [...points.filter((each) => !run.kindOf(each).is_found), ...points.filter((each) => run.kindOf(each).is_found)].map((each) => this.mark(each, run.kindOf(each)));
  }

  mark(landmark, kind) {
    const { x, y, name, level, is_certain: isCertain } = landmark;
    const [px, py] = this.at(x, y);
    const known = [LEVELS[level], kind.is_found && "found", isCertain && "certain"].filter(Boolean).join(" ");
    const shape = (SHAPES[kind.shape] ?? SHAPES.circle)();
    const group = svg("g", { class: `mark ${known}`, "data-kind": kind.name, transform: `translate(${px.toFixed(1)} ${py.toFixed(1)})` }, svg("title", {}, titled(landmark)), shape);
    const mark = sign(landmark, kind);
    if (mark) group.append(svg("text", { class: "sign", y: 4.5, "text-anchor": "middle" }, mark));
    group.append(svg("text", { class: "label", y: NAMES_ABOVE.includes(kind.shape) ? -15 : 24, "text-anchor": "middle" }, name));
    return group;
  }

  robot({ pose }, other, name) {
    if (!pose) return [];
    const [x, y] = this.at(pose.x, pose.y);
    const turn = (-(pose.yaw ?? 0) * 180) / Math.PI;
    const arrow = svg("path", { d: "M12 0 L-8 8 L-4 0 L-8 -8 Z", transform: `rotate(${turn.toFixed(1)})` });
    const group = svg("g", { class: `robot${other}`, transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})` }, svg("title", {}, name ?? "the robot"), arrow);
    if (name) group.append(svg("text", { y: -14, "text-anchor": "middle" }, name));
    return [group];
  }

  ruler(scale, height) {
    const metres = [100, 50, 20, 10, 5, 2, 1, 0.5].find((each) => each * scale < 120) ?? 0.5;
    const text = svg("text", { x: 10, y: height - 18 }, `${metres} m`);
    return svg("g", { class: "ruler" }, svg("path", { d: `M10 ${height - 16} v6 h${metres * scale} v-6` }), text);
  }

  /** Come nearer by a factor, around a point of the screen. */
  nearer(factor, px = this.place.clientWidth / 2, py = this.place.clientHeight / 2) {
    const zoom = Math.max(0.5, Math.min(50, this.zoom * factor));
    const middle = [this.place.clientWidth / 2, this.place.clientHeight / 2];
    this.shift = this.shift.map((each, axis) => each + (1 - zoom / this.zoom) * ([px, py][axis] - middle[axis] - each));
    this.zoom = zoom;
    this.again();
  }

  fit() {
    this.zoom = 1;
    this.shift = [0, 0];
    this.again();
  }

  again() {
    if (this.shown) this.show(...this.shown);
  }

  wheel(event) {
    event.preventDefault();
    if (!event.deltaY) return;
    const { left, top } = this.place.getBoundingClientRect();
    this.nearer(event.deltaY < 0 ? 1.2 : 1 / 1.2, event.clientX - left, event.clientY - top);
  }

  drag(event) {
    if (!event.isPrimary || event.button !== 0) return;
    const { left, top } = this.place.getBoundingClientRect();
    if (this.picking) {
      this.picked(this.from(event.clientX - left, event.clientY - top));
      return;
    }
    const begin = [event.clientX - this.shift[0], event.clientY - this.shift[1]];
    const move = (to) => {
      this.shift = [to.clientX - begin[0], to.clientY - begin[1]];
      this.again();
    };
    this.place.setPointerCapture(event.pointerId);
    this.place.addEventListener("pointermove", move);
    // However it ends: a touch may be taken away for something else.
    this.place.addEventListener("lostpointercapture", () => this.place.removeEventListener("pointermove", move), { once: true });
  }

  /** Have the next click answer with a place, in metres; with null if none is picked. */
  pick(answer) {
    this.picking = answer;
    this.place.classList.add("picking");
    this.place.focus();
  }

  picked(place) {
    const pick = this.picking;
    this.picking = null;
    this.place.classList.remove("picking");
    pick?.(place);
  }

  key(event) {
    const step = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] }[event.key];
    if (step) this.shift = this.shift.map((each, axis) => each + step[axis]);
    else if (event.key === "+") this.nearer(1.3);
    else if (event.key === "-") this.nearer(1 / 1.3);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
    this.again();
  }
}

/** What is left of a plan, from where the robot is. */
function rest(plan, pose) {
  if (!pose || !plan.length) return plan;
  const away = plan.map(([x, y]) => Math.hypot(x - pose.x, y - pose.y));
  return plan.slice(away.indexOf(Math.min(...away)));
}

/** What has to be in sight: the map, or all places with something around them; x and y in metres. */
function extent(runs) {
  const points = [];
  let edge = 2;
  for (const { map, landmarks, trail, pose } of runs) {
    for (const { x, y, corners } of landmarks.values()) points.push(...(corners.length ? corners : [[x, y]]));
    if (pose) points.push([pose.x, pose.y]);
    if (map && !map.yaw) {
      points.push([map.x, map.y], [map.x + map.width * map.resolution, map.y + map.height * map.resolution]);
      edge = 0.3;
    } else points.push(...trail);
  }
  if (!points.length) return [-5, -5, 5, 5];
  const xs = points.map(([x]) => x);
  const ys = points.map(([, y]) => y);
  const least = (values) => values.reduce((a, b) => Math.min(a, b));
  const most = (values) => values.reduce((a, b) => Math.max(a, b));
  return [least(xs) - edge, least(ys) - edge, most(xs) + edge, most(ys) + edge];
}

/** The map in words. */
function described({ pose, landmarks }) {
  const robot = pose ? `The robot is at ${pose.x.toFixed(1)}, ${pose.y.toFixed(1)}.` : "";
  return [robot, [...landmarks.values()].map(({ name, state, reason }) => [`${name} ${state}`.trim(), reason].filter(Boolean).join(", ")).join("; ")].filter(Boolean).join(" ");
}

function titled(landmark) {
  const words = inWords(landmark);
  return words ? `${landmark.name}: ${words}` : landmark.name;
}
