// A timeline of the leaves. Each leaf has a lane with a bar for each period in which it was running, and a stroke for each result.

import { clock, set } from "./shapes.js";

const [LANE, AXIS, NAMES, MOST_LANES] = [16, 18, 150, 400];
// The shortest period that can be shown, in seconds, and the shortest drag, in pixels.
const [SHORTEST, DRAG] = [0.5, 5];
const STEPS = [0.1, 0.5, 1, 5, 10, 30, 60, 300, 600, 1800, 3600, 14400];
const COLOURS = ["RUNNING", "SUCCESS", "FAILURE", "HALTED"];
// The shortest time between two drawings, in milliseconds.
const PAUSE_MS = 250;

export class LanesView {
  /**
   * @param {HTMLElement} place the element to draw in.
   * @param {import("./stream.js").Stream} stream the stream, which a click moves in a replay.
   * @param {(id: number) => void} choose called with the leaf of a clicked lane.
   */
  constructor(place, stream, choose) {
    Object.assign(this, { place, stream, choose, range: null, dragged: null, drawnAt: 0 });
    this.canvas = document.createElement("canvas");
    this.pen = this.canvas.getContext("2d");
    place.append(this.canvas);
    place.addEventListener("pointerdown", (event) => this.drag(event));
    place.addEventListener("dblclick", () => this.zoom(null));
    place.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(place);
  }

  show(run) {
    const isNew = this.run !== run || this.count !== run.lanes.length || this.time !== run.time || this.chosen !== this.stream.chosen;
    if (!isNew || performance.now() - this.drawnAt < PAUSE_MS) return;
    Object.assign(this, { run, count: run.lanes.length, time: run.time, chosen: this.stream.chosen });
    this.draw();
  }

  /** The shown period, in seconds since the run's start: the selected period, or the whole period for which the lanes are known. */
  get shown() {
    return this.range ?? [this.run.lanes[0]?.[0] ?? 0, Math.max(this.run.time, (this.run.lanes[0]?.[0] ?? 0) + SHORTEST)];
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!this.run || !width || !height) return;
    this.drawnAt = performance.now();
    const { lanes, nodes } = this.run;
    const [from, to] = this.shown;
    // First the leaves that were running, then the leaves that ended in their first tick, both in the order of the tree.
    const lasting = new Set(lanes.filter(([, , status]) => status === "RUNNING").map(([, id]) => id));
    this.leaves = [...new Set(lanes.map(([, id]) => id))].filter((id) => nodes[id]).sort((one, other) => lasting.has(other) - lasting.has(one) || one - other).slice(0, MOST_LANES);
    const size = [width, Math.max(height - 4, this.leaves.length * LANE + AXIS)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) [this.canvas.width, this.canvas.height] = size;
    const colour = (name) => getComputedStyle(this.place).getPropertyValue(`--${name}`).trim();
    const [text, quiet, line, ...colours] = ["text", "quiet", "line", ...COLOURS.map((each) => each.toLowerCase())].map(colour);
    const { pen } = this;
    pen.clearRect(0, 0, ...size);
    pen.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    const x = (time) => NAMES + ((time - from) / (to - from)) * (width - NAMES - 8);
    this.at = (px) => from + ((px - NAMES) / (width - NAMES - 8)) * (to - from);
    this.axis(from, to, x, size[1], line, quiet);
    const rows = new Map(this.leaves.map((id, row) => [id, row * LANE + AXIS]));
    const open = new Map();
    const bar = (id, since, until) => {
      const left = Math.max(NAMES, x(since));
      if (x(until) < NAMES) return;
      pen.fillStyle = colours[0];
      pen.fillRect(left, rows.get(id) + 3, Math.max(1, Math.min(width, x(until)) - left), LANE - 6);
    };
    for (const [time, id, status] of lanes) {
      if (!rows.has(id)) continue;
      if (open.has(id)) bar(id, open.get(id), time);
      open.delete(id);
      if (status === "RUNNING") open.set(id, time);
      else if (COLOURS.includes(status) && time >= from && time <= to) {
        pen.fillStyle = colours[COLOURS.indexOf(status)];
        pen.fillRect(x(time) - 1, rows.get(id) + (status === "FAILURE" ? 0 : 3), 3, status === "FAILURE" ? LANE : LANE - 6);
      }
    }
    for (const [id, since] of open) bar(id, since, this.run.time);
    pen.fillStyle = text;
    for (const [id, top] of rows) pen.fillText(nodes[id].name, 4, top + LANE - 4, NAMES - 10);
    if (this.dragged) {
      pen.globalAlpha = 0.25;
      pen.fillRect(Math.min(...this.dragged), 0, Math.abs(this.dragged[1] - this.dragged[0]), size[1]);
      pen.globalAlpha = 1;
    }
    set(this.place, { "aria-label": `Timeline from ${clock(from)} to ${clock(to)}: ${this.leaves.length} leaves` });
  }

  axis(from, to, x, height, line, quiet) {
    const step = STEPS.find((each) => x(from + each) - x(from) > 60) ?? (to - from);
    for (let time = Math.ceil(from / step) * step; time <= to; time += step) {
      this.pen.fillStyle = line;
      this.pen.fillRect(x(time), 0, 1, height);
      this.pen.fillStyle = quiet;
      this.pen.fillText(step < 1 ? time.toFixed(1) : clock(time), x(time) + 3, 12);
    }
  }

  /** Show a period; null shows the whole time. */
  zoom(range) {
    this.range = range;
    this.draw();
  }

  /** Zoom to the period that the user drags over; a click selects the leaf, and in a replay the time. */
  drag(event) {
    if (!this.at || event.button !== 0) return;
    const { left, top } = this.canvas.getBoundingClientRect();
    const begin = event.clientX - left;
    const [move, end] = [(to) => {
      this.dragged = [begin, to.clientX - left];
      this.draw();
    }, (to) => {
      this.place.removeEventListener("pointermove", move);
      this.dragged = null;
      const [first, last] = [begin, to.clientX - left].sort((one, other) => one - other).map(this.at);
      if (Math.abs(to.clientX - left - begin) > DRAG) this.zoom([first, Math.max(last, first + SHORTEST)]);
      else this.click(this.at(begin), Math.floor((event.clientY - top - AXIS) / LANE));
    }];
    this.place.addEventListener("pointermove", move);
    this.place.addEventListener("pointerup", end, { once: true });
    this.place.setPointerCapture(event.pointerId);
  }

  click(time, row) {
    // In a replay of several runs, the time of a run differs from the time of the replay.
    if (this.stream.isReplay && this.stream.run.run.number === 1) this.stream.go(time);
    if (this.leaves[row] !== undefined) this.choose(this.leaves[row]);
    this.draw();
  }

  key(event) {
    const [from, to] = this.run ? this.shown : [0, 1];
    const quarter = (to - from) / 4;
    const ranges = { "+": [from + quarter, to - quarter], "-": [from - quarter, to + quarter], ArrowLeft: [from - quarter, to - quarter], ArrowRight: [from + quarter, to + quarter], 0: null };
    if (!(event.key in ranges)) return;
    event.preventDefault();
    const range = ranges[event.key];
    this.zoom(range && range[1] - range[0] >= SHORTEST ? range : null);
  }
}
