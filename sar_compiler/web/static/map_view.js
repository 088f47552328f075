// The map: the robots' maps, poses, trails and plans, and the landmarks of their missions.

import { isMoving, isPlaced } from "./condition_view.js";
import { inWords } from "./places_view.js";
import { clock, hue, html, icon, mark, say, set, svg } from "./shapes.js";
import { LEVELS } from "./signs.js";
import { Walls } from "./walls.js";

const ARROW = "M15 0 L-10 10 L-5 0 L-10 -10 Z";
// Candidate positions of a label's centre: x and y in half widths and heights of the label, at two distances beyond the mark's radius.
const SIDES = [[0, 1], [1, 0], [0, -1], [-1, 0], [0.8, 1], [-0.8, 1], [0.8, -1], [-0.8, -1]];
const AWAY = [0, 26];
const [RADIUS, HEIGHT, FONT] = [13, 16, "600 13px system-ui, 'DejaVu Sans', sans-serif"];
// The cost, in square pixels of covered area, of a label that is nearer to another mark than to its own, and so needs a line to its own.
const MISTAKEN = 300;
// The cost of a square pixel of a wall that a label covers, compared with one of a mark or another label, because the label stays legible.
const ON_WALL = 0.25;
// Maximum distance in pixels at which a click on the first corner closes an outline.
const [CLOSING, LEAST_CORNERS] = [9, 3];
const STEPS = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

export class MapView {
  /**
   * @param {HTMLElement} place the element to draw in.
   * @param {HTMLElement} [legend] the element of the legend, which also shows the age of the data.
   */
  constructor(place, legend) {
    this.place = place;
    this.legend = legend && new Legend(legend);
    this.zoom = 1;
    this.shift = [0, 0];
    this.layers = new Map();
    this.arrows = new Map();
    this.marks = [];
    this.onChosen = () => {};
    this.picking = null;
    this.drawn = null;
    this.canvas = svg("svg", { role: "presentation" });
    this.pen = html("canvas").getContext("2d");
    this.pen.font = FONT;
    place.append(this.canvas);
    place.after(html("div", { class: "zoom" }, this.button("+", "Closer", () => this.nearer(1.4)), this.button("−", "Farther", () => this.nearer(1 / 1.4)), this.button("⤢", "The whole map", () => this.fit())));
    place.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    place.addEventListener("pointerdown", (event) => this.drag(event));
    place.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.again()).observe(place);
  }

  button(sign, label, act) {
    const button = html("button", { type: "button", "aria-label": label }, sign);
    button.addEventListener("click", act);
    return button;
  }

  /** Show the robots of a stream, with their names if there are several. */
  show(stream) {
    this.stream = stream;
    const { run, runs } = stream;
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !height) return;
    const box = extent(runs);
    const scale = this.zoom * Math.min(width / (box[2] - box[0]), height / (box[3] - box[1]));
    // An open legend is placed beside the visible content if there is room.
    const spare = Math.max(0, width - (box[2] - box[0]) * scale);
    const [cx, cy] = [(box[0] + box[2]) / 2 + Math.min(spare, this.legend?.width ?? 0) / 2 / scale, (box[1] + box[3]) / 2];
    this.at = (x, y) => [width / 2 + (x - cx) * scale + this.shift[0], height / 2 - (y - cy) * scale + this.shift[1]];
    this.from = (px, py) => [cx + (px - width / 2 - this.shift[0]) / scale, cy - (py - height / 2 - this.shift[1]) / scale];
    // The selected robot is drawn above the other robots.
    const order = [...runs.filter((each) => each !== run), run];
    const of = (draw) => order.flatMap((each) => draw(each, each === run ? "" : " other"));
    const view = [width, height, scale, cx, cy, ...this.shift].join(" ");
    const told = `${view} ${order.map((each) => `${runs.indexOf(each)}.${each.version}`).join(" ")}`;
    const mapped = run.map ? run : (runs.find(({ map }) => map) ?? run);
    if (mapped.map !== this.mapped) {
      this.mapNumber = (this.mapNumber ?? 0) + 1;
      this.mapped = mapped.map;
      const walls = mapped.map && new Walls(mapped.map, () => walls === this.walls && this.again());
      this.walls = walls;
    }
    set(this.canvas, { viewBox: `0 0 ${width} ${height}` });
    // A layer is redrawn only if its content has changed.
    this.layer("ground", `${view} ${this.mapNumber}`, () => this.ground(mapped, scale, width, height));
    this.layer("grid", view, () => [this.grid(width, height, scale)]);
    this.layer("areas", told, () => [...of((each) => this.shades(each)), ...of((each) => this.rasters(each, scale)), ...of((each) => this.areas(each))]);
    this.layer("drawing", `${view} ${JSON.stringify(this.drawn)}`, () => this.drawing());
    const ways = order.map((each) => `${each.trail.length} ${each.trail.at(-1)} ${each.plan.length} ${each.plan[0]} ${each.pose?.x} ${each.pose?.y} ${isMoving(stream, each)}`);
    this.layer("ways", `${view} ${ways.join(" ")}`, () => of((each, other) => this.ways(each, other)));
    this.layer("marks", told, () => {
      this.marks = of((each) => this.landmarks(each));
      return this.marks.map(({ group }) => group);
    });
    const robots = this.robots(order, run, view);
    const places = robots.map(({ at: [x, y], text }) => `${Math.round(x / 8)} ${Math.round(y / 8)} ${text}`).join(" ");
    const known = `${this.mapNumber} ${Boolean(this.walls?.sums)}`;
    this.layer("labels", `${told} ${places} ${known}`, () => this.labels([...robots, ...this.marks], width, height, scale));
    this.layer("signs", `${view} ${run.north}`, () => [this.ruler(scale, height), this.north(run, width)]);
    set(this.place, { "aria-label": `Map. ${described(stream)}` });
    this.legend?.show(run);
  }

  /** Redraw a layer if its key has changed. */
  layer(name, key, draw) {
    let known = this.layers.get(name);
    if (!known) {
      known = { group: svg("g"), key: null };
      this.layers.set(name, known);
      this.canvas.append(known.group);
    }
    if (known.key === key) return;
    known.key = key;
    known.group.replaceChildren(...draw());
  }

  /** The robots, which glide to their new positions. */
  robots(order, run, view) {
    const drawn = order.flatMap((each) => this.robot(each, each === run ? "" : " other"));
    this.layer("robots", drawn.map(({ number }) => number).join(" "), () => drawn.map(({ group }) => group));
    const isMoved = view !== this.view;
    this.view = view;
    for (const { group, at: [x, y], name } of drawn) {
      group.classList.toggle("still", isMoved);
      group.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      set(group, { class: isMoved ? `${name} still` : name });
    }
    return drawn;
  }

  /** Centre the map on a landmark, and highlight the landmark for a moment. */
  look({ kind, name, robot = this.stream?.chosen }) {
    const landmark = this.stream?.runs[robot]?.landmarks.get(`${kind}/${name}`);
    if (!landmark || !this.at) return;
    const [px, py] = this.at(landmark.x, landmark.y);
    this.shift = [this.shift[0] + this.place.clientWidth / 2 - px, this.shift[1] + this.place.clientHeight / 2 - py];
    this.again();
    this.place.scrollIntoView({ block: "nearest" });
    for (const { group, landmark: each } of this.marks) group.classList.toggle("looked-at", each.kind === kind && each.name === name);
  }

  ground({ map }, scale, width, height) {
    if (!map) return [];
    const hatch = svg("pattern", { id: "unknown", width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, svg("path", { d: "M0 0 V8" }));
    const [x, y] = this.at(map.x, map.y);
    const size = map.resolution * scale;
    const image = svg("image", {
      href: `data:image/png;base64,${map.png}`, width: map.width * size, height: map.height * size, y: -map.height * size,
      transform: `translate(${x} ${y}) rotate(${(-map.yaw * 180) / Math.PI})`, preserveAspectRatio: "none",
    });
    const free = svg("rect", { class: "mapped", width: map.width * size, height: map.height * size, y: -map.height * size, transform: image.getAttribute("transform") });
    return [svg("defs", {}, hatch), svg("rect", { class: "unknown", width, height, fill: "url(#unknown)" }), free, image];
  }

  /** Draw grid lines at regular distances, labelled for use over the radio. */
  grid(width, height, scale) {
    const step = STEPS.find((each) => each * scale >= 56) ?? 1000;
    const [[left, top], [right, bottom]] = [this.from(0, 0), this.from(width, height)];
    const group = svg("g", { class: "grid" });
    const lines = (from, to) => Array.from({ length: Math.max(0, Math.floor(to / step) - Math.ceil(from / step) + 1) }, (_, at) => (Math.ceil(from / step) + at) * step);
    for (const x of lines(left, right)) {
      const [px] = this.at(x, 0);
      group.append(svg("path", { d: `M${px} 0 V${height}`, class: x === 0 ? "axis" : "" }));
      if (px > 130 && px < width - 20) group.append(svg("text", { x: px, y: height - 5, "text-anchor": "middle" }, String(x)));
    }
    for (const y of lines(bottom, top)) {
      const [, py] = this.at(0, y);
      group.append(svg("path", { d: `M0 ${py} H${width}`, class: y === 0 ? "axis" : "" }));
      if (py > 20 && py < height - 50) group.append(svg("text", { x: 5, y: py + 4 }, String(y)));
    }
    return group;
  }

  ways(run, other) {
    const { trail, pose } = run;
    const plan = isMoving(this.stream, run) ? run.plan : [];
    const line = (points, name) => {
      const drawn = svg("polyline", { class: name, points: points.map(([x, y]) => this.at(x, y).map((each) => each.toFixed(1)).join(",")).join(" ") });
      if (this.stream.isTeam) drawn.style.setProperty("--robot", hue(this.stream.runs.indexOf(run)));
      return drawn;
    };
    return [line(trail, `trail${other}`), ...(plan.length ? [line(rest(plan, pose), `plan under${other}`), line(rest(plan, pose), `plan${other}`)] : [])];
  }

  areas(run) {
    return [...run.landmarks.values()].filter(({ corners }) => corners.length).map((each) => svg("polygon", { class: `area ${LEVELS[each.level]?.word}`, points: this.outline(each) }, svg("title", {}, titled(each))));
  }

  outline({ corners }) {
    return corners.map(([x, y]) => this.at(x, y).map((at) => at.toFixed(1)).join(",")).join(" ");
  }

  shades(run) {
    const most = mostShaded(run);
    return [...run.landmarks.values()].filter(({ shade }) => shade > 0).map((each) => svg("polygon", { class: "shade", points: this.outline(each), "fill-opacity": shadeOpacity(each.shade / most[each.kind]) }, svg("title", {}, titled(each))));
  }

  /** Draw the outline in progress with its corners; a click on the first corner closes the outline. */
  drawing() {
    if (!this.drawn?.length) return [];
    const corners = this.drawn.map(([x, y]) => this.at(x, y));
    const line = svg(corners.length < LEAST_CORNERS ? "polyline" : "polygon", { points: this.outline({ corners: this.drawn }) });
    return [svg("g", { class: "drawn" }, line, ...corners.map(([cx, cy], at) => svg("circle", { cx, cy, r: at ? 4 : CLOSING })))];
  }

  rasters(run, scale) {
    return Object.values(run.rasters).map((layer) => {
      const [x, y] = this.at(layer.x, layer.y);
      const group = cells(layer);
      set(group, { transform: `translate(${x.toFixed(2)} ${y.toFixed(2)}) scale(${layer.cell_m * scale})` });
      return group;
    });
  }

  landmarks(run) {
    const points = [...run.landmarks.values()].filter(({ corners }) => !corners.length);
    // Detections are drawn above known landmarks.
    return [...points.filter((each) => !run.kindOf(each).is_found), ...points.filter((each) => run.kindOf(each).is_found)].map((each) => this.mark(run, each, run.kindOf(each)));
  }

  mark(run, landmark, kind) {
    const [px, py] = this.at(landmark.x, landmark.y);
    const group = mark(landmark, kind);
    group.prepend(svg("title", {}, titled(landmark)));
    set(group, { "data-kind": kind.name, transform: `translate(${px.toFixed(1)} ${py.toFixed(1)})` });
    group.addEventListener("click", () => this.picking || this.onChosen(landmark));
    return { group, landmark, at: [px, py], radius: RADIUS, text: this.stream.nameOf(run, landmark.name), style: "label" };
  }

  robot(run, other) {
    const { pose } = run;
    if (!pose) return [];
    const at = this.at(pose.x, pose.y);
    const number = this.stream.runs.indexOf(run);
    const text = this.stream.isTeam ? this.stream.names[number] : "";
    const group = this.arrows.get(number) ?? svg("g", {}, svg("title"), svg("g", {}, svg("path", { class: "halo", d: ARROW }), svg("path", { class: "arrow", d: ARROW })));
    this.arrows.set(number, group);
    const isOld = !isPlaced(this.stream, run);
    say(group.firstChild, `${text || "the robot"}${isOld ? ", last known position" : ""}`);
    set(group.lastChild, { transform: `rotate(${((-(pose.yaw ?? 0) * 180) / Math.PI).toFixed(1)})` });
    if (this.stream.isTeam) group.style.setProperty("--robot", hue(number));
    return [{ group, at, number, robot: this.stream.isTeam ? number : undefined, radius: 15, name: `robot${other}${isOld ? " stale" : ""}`, text, style: "label name" }];
  }

  /** Place each name beside its mark, at the position with the least overlap. */
  labels(marks, width, height, scale) {
    const taken = [...this.covers(width, height, scale), ...marks.map(({ at: [x, y], radius }) => [x - radius, y - radius, x + radius, y + radius])];
    const onWalls = ([left, top, right, bottom]) => ON_WALL * scale ** 2 * (this.walls?.within([this.from(left, top), this.from(right, top), this.from(left, bottom), this.from(right, bottom)]) ?? 0);
    return marks.filter(({ text }) => text).flatMap(({ at: [x, y], text, style, robot }) => {
      const half = this.pen.measureText(text).width / 2 + 2;
      const boxes = AWAY.flatMap((away) => SIDES.map(([right, down]) => {
        const [cx, cy] = [x + right * (half + RADIUS + 2 + away), y + down * (HEIGHT / 2 + RADIUS + 1 + away)];
        return [cx - half, cy - HEIGHT / 2, cx + half, cy + HEIGHT / 2];
      }));
      const near = marks.filter(({ at }) => Math.hypot(at[0] - x, at[1] - y) < 2 * (half + RADIUS + AWAY[1]) && (at[0] !== x || at[1] !== y));
      const cost = boxes.map((box, side) => side * 0.5 + outside(box, width, height) + taken.reduce((sum, other) => sum + overlap(box, other), 0) + onWalls(box) + mistaken(box, [x, y], near));
      const least = Math.min(...cost);
      const box = boxes[cost.indexOf(least)];
      taken.push(box);
      const label = svg("text", { class: style, x: ((box[0] + box[2]) / 2).toFixed(1), y: (box[3] - 4).toFixed(1), "text-anchor": "middle" }, text);
      if (robot !== undefined) label.style.setProperty("--robot", hue(robot));
      // A label that does not touch its mark, or is nearer to another mark, is connected to its mark by a line.
      const isApart = boxes.indexOf(box) >= SIDES.length || mistaken(box, [x, y], near) > 0;
      return isApart ? [svg("path", { class: "leader", d: `M${x} ${y} L${clamp(x, box[0], box[2])} ${clamp(y, box[1], box[3])}` }), label] : [label];
    });
  }

  /** Return the boxes of what is drawn or shown above the marks: title, buttons, legend, ruler and north arrow. */
  covers(width, height, scale) {
    const { left, top } = this.place.getBoundingClientRect();
    const beside = [...this.place.parentElement.querySelectorAll(":scope > :is(h2, .zoom, details)")].map((each) => each.getBoundingClientRect());
    return [
      ...beside.map((box) => [box.left - left, box.top - top, box.right - left, box.bottom - top]),
      [8, height - 36, 16 + ruled(scale) * scale, height],
      [width - 60, 64, width - 4, 116],
    ];
  }

  ruler(scale, height) {
    const metres = ruled(scale);
    const text = svg("text", { x: 12, y: height - 20 }, `${metres} m`);
    return svg("g", { class: "ruler" }, svg("path", { d: `M12 ${height - 15} v6 h${metres * scale} v-6` }), text);
  }

  /** Draw the direction of north, or the map's axes if north is unknown. */
  north({ north }, width) {
    const known = Number.isFinite(north);
    const arrow = known
      ? svg("g", { transform: `rotate(${((-north * 180) / Math.PI + 90).toFixed(1)})` }, svg("path", { d: "M0 -15 L6 10 L0 5 L-6 10 Z" }), svg("text", { y: -18, "text-anchor": "middle" }, "N"))
      : svg("g", {}, svg("path", { class: "axes", d: "M-8 -12 V9 H13 M-12 -7 L-8 -13 L-4 -7 M8 5 L14 9 L8 13" }), svg("text", { x: -8, y: -17, "text-anchor": "middle" }, "y"), svg("text", { x: 19, y: 13, "text-anchor": "middle" }, "x"));
    return svg("g", { class: "north", transform: `translate(${width - 34} 96)` }, svg("title", {}, known ? "north" : "the axes of the map (north is unknown)"), arrow);
  }

  /** Zoom by a factor around a point of the screen. */
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
    if (this.stream) this.show(this.stream);
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
      const at = [event.clientX - left, event.clientY - top];
      if (this.drawn) this.corner(at);
      else this.picked(this.from(...at));
      return;
    }
    const begin = [event.clientX - this.shift[0], event.clientY - this.shift[1]];
    const move = (to) => {
      this.shift = [to.clientX - begin[0], to.clientY - begin[1]];
      this.again();
    };
    this.place.setPointerCapture(event.pointerId);
    this.place.addEventListener("pointermove", move);
    // A touch may also end because the browser cancels it.
    this.place.addEventListener("lostpointercapture", () => this.place.removeEventListener("pointermove", move), { once: true });
  }

  /** Return the position of the next click in metres; null if the user cancels. */
  pick(answer) {
    this.picking = answer;
    this.place.classList.add("picking");
    this.place.scrollIntoView({ block: "nearest" });
    this.place.focus();
  }

  /** Return the corners of the outline that the user draws by clicks, in metres; null if the user cancels. */
  draw(answer) {
    this.pick(answer);
    this.drawn = [];
  }

  /** Add a corner to the outline, or close it at the first corner. */
  corner([px, py]) {
    const [first] = this.drawn;
    const isFirst = first && Math.hypot(...this.at(...first).map((each, axis) => each - [px, py][axis])) <= CLOSING;
    if (!isFirst) this.drawn.push(this.from(px, py).map((each) => Math.round(each * 100) / 100));
    else if (this.drawn.length >= LEAST_CORNERS) this.picked(this.drawn);
    this.again();
  }

  picked(place) {
    const pick = this.picking;
    this.picking = this.drawn = null;
    this.place.classList.remove("picking");
    this.again();
    pick?.(place);
  }

  key(event) {
    const step = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] }[event.key];
    if (step) this.shift = this.shift.map((each, axis) => each + step[axis]);
    else if (event.key === "+") this.nearer(1.3);
    else if (event.key === "-") this.nearer(1 / 1.3);
    else if (event.key === "0") this.fit();
    else if (event.key === "Backspace" && this.drawn) this.drawn.pop();
    else return;
    event.preventDefault();
    this.again();
  }
}

/** The legend: the map's signs, and the age of the data. */
class Legend {
  constructor(place) {
    this.place = place;
    this.ages = {};
  }

  /** Return the width in pixels, including the margin. */
  get width() {
    return this.place.parentElement.open ? this.place.parentElement.offsetWidth + 16 : 0;
  }

  show(run) {
    const kinds = Object.values(run.kinds);
    const meanings = new Set(Object.values(run.rasters).map(({ meaning }) => meaning));
    const most = mostShaded(run);
    const key = JSON.stringify([kinds, Boolean(run.map), run.plan.length > 0, [...meanings], most]);
    if (key !== this.key) this.draw(key, kinds, meanings, most, run);
    for (const [name, element] of Object.entries(this.ages)) {
      const since = run.times[name];
      say(element, since === undefined ? "" : `${clock(run.time - since)} ago`);
    }
  }

  draw(key, kinds, meanings, most, run) {
    this.key = key;
    const row = (drawn, text, age) => {
      const old = html("td");
      if (age) this.ages[age] = old;
      return html("tr", {}, html("td", {}, icon(drawn)), html("th", { scope: "row" }, text), old);
    };
    this.ages = {};
    const line = (name) => svg("path", { class: name, d: "M-13 0 H13" });
    const drawn = kinds.filter((kind) => [...run.landmarks.values()].some((each) => each.kind === kind.name && !each.corners.length) || kind.is_found);
    this.place.replaceChildren(
      row(svg("g", { class: "robot" }, svg("path", { class: "arrow", d: ARROW, transform: "scale(.8)" })), "robot", "pose"),
      row(line("trail"), "path driven"),
      row(line("plan"), "plan", "plan"),
      ...(run.map ? [row(svg("path", { class: "wall", d: "M-12 -9 H12 V-3 H-12 Z" }), "wall", "map")] : []),
      ...drawn.map((kind) => row(mark({ level: 0 }, kind), kind.plural)),
      ...["in progress", "done", "abandoned"].map((name, level) => row(mark({ level: level + 1 }, {}), name)),
      ...[...meanings].flatMap((meaning) => [2, 5, 10].map((tenths) => row(swatch("cells", opacity(tenths)), `${meaning} to ${10 * tenths} %`))),
      ...kinds.filter(({ name }) => most[name]).flatMap(({ name, shaded_by: by }) => [1 / 3, 1].map((share) => row(swatch("shade", shadeOpacity(share)), `${by} ${(100 * share * most[name]).toFixed(1)} %`))),
    );
  }
}

const TENTHS = "-abcdefghij";
// The drawn elements of each layer, created once.
const drawnOf = new WeakMap();

function opacity(tenths) {
  return (0.15 + 0.06 * tenths).toFixed(2);
}

/** Return the fill of an outline, given its share of the darkest outline's shade. */
function shadeOpacity(share) {
  return (0.55 * share).toFixed(2);
}

function swatch(name, filled) {
  return svg("path", { class: name, "fill-opacity": filled, d: "M-12 -9 H12 V9 H-12 Z" });
}

/** Return the shade of each kind's darkest outline. */
function mostShaded(run) {
  const most = {};
  for (const { kind, shade } of run.landmarks.values()) if (shade > (most[kind] ?? 0)) most[kind] = shade;
  return most;
}

/** Return the cells of a layer as one path for each tenth of their value; cells have width 1. */
function cells(layer) {
  if (drawnOf.has(layer)) return drawnOf.get(layer);
  const paths = new Map();
  let place = 0;
  for (const [, count, letter] of layer.cells.matchAll(/(\d*)([-a-j])/g)) {
    const long = Number(count || 1);
    const path = `M${place % layer.columns} ${-Math.floor(place / layer.columns)}h${long}v-1h-${long}z`;
    if (letter !== "-") paths.set(letter, (paths.get(letter) ?? "") + path);
    place += long;
  }
  const group = svg("g", { class: "cells" }, ...[...paths].map(([letter, d]) => svg("path", { "fill-opacity": opacity(TENTHS.indexOf(letter)), d })));
  drawnOf.set(layer, group);
  return group;
}

/** Return the length of the ruler in metres. */
function ruled(scale) {
  return STEPS.findLast((each) => each * scale < 110) ?? STEPS[0];
}

function clamp(value, least, most) {
  return Math.max(least, Math.min(most, value)).toFixed(1);
}

/** Return the overlap of two boxes in square pixels. */
function overlap([left, top, right, bottom], [a, b, c, d]) {
  return Math.max(0, Math.min(right, c) - Math.max(left, a)) * Math.max(0, Math.min(bottom, d) - Math.max(top, b));
}

/** Return the additional cost of a label that is nearer to another mark than to its own; 0 for other labels. */
function mistaken([left, top, right, bottom], own, others) {
  const away = ([x, y]) => Math.hypot(Math.max(left - x, 0, x - right), Math.max(top - y, 0, y - bottom));
  return others.some(({ at }) => away(at) < away(own)) ? MISTAKEN : 0;
}

function outside([left, top, right, bottom], width, height) {
  return left < 0 || top < 0 || right > width || bottom > height ? 500 : 0;
}

/** Return the remaining part of a plan from the robot's position. */
function rest(plan, pose) {
  if (!pose || !plan.length) return plan;
  const away = plan.map(([x, y]) => Math.hypot(x - pose.x, y - pose.y));
  return plan.slice(away.indexOf(Math.min(...away)));
}

/** Return the bounds to show, in metres: the map, or all landmarks with a margin. */
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

/** Return a description of the map in words. */
function described(stream) {
  return stream.runs.map((run) => {
    const who = stream.isTeam ? stream.names[stream.runs.indexOf(run)] : "The robot";
    const robot = run.pose ? `${who} is at ${run.pose.x.toFixed(1)}, ${run.pose.y.toFixed(1)}.` : "";
    const places = [...run.landmarks.values()].map(({ name, state, reason }) => [`${stream.nameOf(run, name)} ${state}`.trim(), reason].filter(Boolean).join(", "));
    return [robot, places.join("; ")].filter(Boolean).join(" ");
  }).join(" ");
}

function titled(landmark) {
  const words = inWords(landmark);
  return words ? `${landmark.name}: ${words}` : landmark.name;
}
