// The tree as a drawing with a row for each node; only visible rows are drawn.

import { badge, duration, set, svg } from "./shapes.js";

const ROW = 26;
// The assumed height of the view while the tree is hidden, in pixels.
const HIDDEN = 400;

export class TreeView {
  /**
   * @param {HTMLElement} place the element to draw in, which has the keyboard focus.
   * @param {(id: number) => void} choose called with the selected node.
   */
  constructor(place, choose) {
    this.place = place;
    this.choose = choose;
    this.folded = new Set();
    this.rows = [];
    this.rowOf = new Map();
    this.chosen = 0;
    // Whether the user has selected this node.
    this.isAsked = false;
    this.follows = true;
    this.wanted = "";
    // The nodes with breakpoints.
    this.breaks = new Set();
    this.drawn = new Map();
    this.canvas = svg("svg", { role: "presentation" });
    place.append(this.canvas);
    place.addEventListener("scroll", () => this.draw());
    place.addEventListener("keydown", (event) => this.key(event));
    place.addEventListener("click", (event) => this.click(event));
    place.addEventListener("dblclick", (event) => this.isTwist(event) || this.toggle(idOf(event)));
    new ResizeObserver(() => {
      // If there is less room, the selected row stays visible.
      const at = this.isAsked ? this.chosen : this.follows && this.run?.running()[0];
      if (this.rowOf.has(at)) this.reveal(at);
      this.draw();
    }).observe(place);
  }

  /** Show a run; its state may have changed since the last call. */
  show(run) {
    this.run = run;
    if (isSame(this.nodes, run.nodes)) this.nodes = run.nodes;
    if (this.nodes !== run.nodes) {
      this.nodes = run.nodes;
      this.canvas.replaceChildren();
      this.deepest = run.nodes.reduce((deepest, node) => Math.max(deepest, node.depth), 1);
      this.drawn = new Map();
      this.chosen = 0;
      this.isAsked = false;
      this.folded.clear();
      this.led = "";
      // A tree that does not fit is folded to its running branch.
      this.isLarge = run.nodes.length * ROW > (this.place.clientHeight || HIDDEN);
      if (this.isLarge) this.fold();
      this.search(this.wanted);
    }
    this.follow();
    this.draw();
  }

  follow() {
    const running = this.run.running();
    const now = running.join(" ");
    if (!this.follows || !running.length || now === this.led || this.wanted) return;
    this.led = now;
    if (this.isLarge) this.fold();
    running.forEach((id) => this.unfoldTo(id));
    this.arrange();
    this.reveal(running[0]);
  }

  /** Fold all branches except those with running nodes. */
  fold() {
    this.nodes.forEach((node) => node.children.length && this.folded.add(node.id));
    this.run.running().forEach((id) => this.unfoldTo(id));
    this.folded.delete(0);
    this.arrange();
  }

  unfold() {
    this.folded.clear();
    this.arrange();
  }

  unfoldTo(id) {
    for (let at = this.nodes[id].parent; at >= 0; at = this.nodes[at].parent) this.folded.delete(at);
  }

  /** Show only the nodes that contain a text, and their ancestors; return their number. */
  search(text) {
    this.wanted = text.trim().toLowerCase();
    this.matches = this.wanted ? this.nodes.filter((node) => matches(node, this.wanted)).map((node) => node.id) : [];
    this.arrange();
    this.place.scrollTop = 0;
    this.draw();
    return this.matches.length;
  }

  /** Select the next node that the search has found. */
  next() {
    if (!this.matches?.length) return;
    this.select(this.matches.find((id) => id > this.chosen) ?? this.matches[0]);
  }

  arrange() {
    const shown = this.wanted ? this.ways() : null;
    this.rows = [];
    for (let id = 0; id < this.nodes.length; ) {
      const node = this.nodes[id];
      if (shown && !shown.has(id)) {
        id += node.count;
        continue;
      }
      this.rows.push(id);
      id += !shown && this.folded.has(id) ? node.count : 1;
    }
    this.rowOf = new Map(this.rows.map((id, row) => [id, row]));
    this.canvas.setAttribute("height", this.rows.length * ROW);
    this.draw();
  }

  ways() {
    const shown = new Set();
    for (const id of this.matches) {
      for (let at = id; at >= 0 && !shown.has(at); at = this.nodes[at].parent) shown.add(at);
    }
    return shown;
  }

  draw() {
    if (!this.nodes) return;
    const { scrollTop, clientHeight, clientWidth } = this.place;
    const first = Math.max(0, Math.floor(scrollTop / ROW) - 3);
    const last = Math.min(this.rows.length, Math.ceil((scrollTop + clientHeight) / ROW) + 3);
    this.indent = Math.min(16, (0.4 * clientWidth) / this.deepest);
    const drawn = new Map();
    for (let row = first; row < last; row += 1) drawn.set(this.rows[row], this.row(this.rows[row], row, clientWidth));
    this.canvas.setAttribute("width", clientWidth);
    // Rows are in the order of the tree. A row that stays visible is not moved, because it may be pressed.
    for (const [id, { element }] of this.drawn) if (!drawn.has(id)) element.remove();
    let at = this.canvas.firstChild;
    for (const { element } of drawn.values()) {
      if (element === at) at = at.nextSibling;
      else this.canvas.insertBefore(element, at);
    }
    this.drawn = drawn;
    set(this.place, { "aria-activedescendant": drawn.has(this.chosen) && `node${this.chosen}` });
  }

  row(id, row, width) {
    const node = this.nodes[id];
    const state = this.run.states[id];
    const former = !this.run.isCurrent(id);
    const x = 4 + node.depth * this.indent;
    const isFolded = this.folded.has(id) && !this.wanted;
    const message = former ? "" : state.message;
    const age = state.status && !former ? duration(this.run.time - state.since) : "";
    const key = [row, width, this.indent, isFolded, former, state.status, message, age, id === this.chosen, this.breaks.has(id), node.name].join("\n");
    const known = this.drawn.get(id);
    if (known?.key === key) return known;
    const group = known?.element ?? svg("g", { id: `node${id}`, role: "treeitem", "data-id": id }, svg("rect", { class: "ground hit", height: ROW }));
    // The pressed element is kept, so that a row that changes between press and release still receives the click.
    const hit = group.firstChild;
    while (hit.nextSibling) hit.nextSibling.remove();
    hit.setAttribute("width", width);
    set(group, {
      transform: `translate(0 ${row * ROW})`,
      class: `row ${former ? "former" : state.status || "none"}${id === this.chosen ? " chosen" : ""}`,
      "aria-level": node.depth + 1, "aria-posinset": node.place + 1,
      "aria-setsize": this.nodes[node.parent]?.children.length ?? 1, "aria-selected": String(id === this.chosen),
      "aria-expanded": node.children.length ? String(!isFolded) : undefined,
      "aria-label": `${node.name}, ${node.cls}, ${former && state.status ? `earlier ${state.status}` : state.status || "not ticked"}${this.breaks.has(id) ? ", breakpoint" : ""}${message ? `, ${message}` : ""}`,
    });
    group.append(this.lines(node, x));
    if (node.children.length) group.append(svg("path", { class: "twist", d: isFolded ? "M0 -4 L5 0 L0 4 Z" : "M-1 -2.5 H7 L3 3 Z", transform: `translate(${x} ${ROW / 2})` }));
    const sign = badge(state.status, former);
    sign.setAttribute("transform", `translate(${x + 12} 5)`);
    const name = svg("text", { class: "name", x: x + 34, y: 17.5 }, `${node.sign} ${node.name}`.trimStart());
    if (message) name.append(svg("tspan", { class: "message", dx: 10 }, message));
    if (isFolded) name.append(svg("tspan", { class: "message", dx: 8 }, `+${node.count - 1}`));
    group.append(sign, name);
    if (this.breaks.has(id)) group.append(svg("circle", { class: "break", cx: 6, cy: ROW / 2, r: 5 }));
    if (age) {
      const wide = 8 + 6.6 * age.length;
      group.append(svg("rect", { class: "ground age", x: width - wide, width: wide, height: ROW }));
      group.append(svg("text", { class: "age", x: width - 6, y: 17.5, "text-anchor": "end" }, age));
    }
    return { key, element: group };
  }

  /** Draw the lines from the parents: the node's own elbow, and a vertical line for each ancestor with later children. */
  lines(node, x) {
    if (node.parent < 0) return "";
    const middle = ROW / 2;
    const up = x - this.indent + 3;
    let path = `M${up} 0 V${this.hasNext(node.id) ? ROW : middle} M${up} ${middle} H${x - (node.children.length ? 2 : -8)}`;
    for (let at = node.parent, left = up - this.indent; this.nodes[at].parent >= 0; at = this.nodes[at].parent, left -= this.indent) {
      if (this.hasNext(at)) path += ` M${left} 0 V${ROW}`;
    }
    return svg("path", { class: "line", d: path });
  }

  hasNext(id) {
    const node = this.nodes[id];
    return node.place < this.nodes[node.parent].children.length - 1;
  }

  /** Select a node, and scroll it into view. */
  select(id) {
    if (!(id in this.nodes)) return;
    this.chosen = id;
    this.isAsked = true;
    if (!this.rowOf.has(id)) {
      this.unfoldTo(id);
      this.arrange();
    }
    this.reveal(id);
    this.draw();
    this.choose(id);
  }

  reveal(id) {
    const top = (this.rowOf.get(id) ?? 0) * ROW;
    const { scrollTop, clientHeight } = this.place;
    if (top < scrollTop || top + ROW > scrollTop + clientHeight) this.place.scrollTop = Math.max(0, top - clientHeight / 3);
  }

  toggle(id) {
    // During a search, the ancestors of matches are shown even if they are folded.
    if (id === null || this.wanted || !this.nodes[id]?.children.length) return;
    if (!this.folded.delete(id)) this.folded.add(id);
    this.arrange();
  }

  click(event) {
    const id = idOf(event);
    if (id === null) return;
    if (this.isTwist(event)) this.toggle(id);
    this.select(id);
    this.place.focus({ preventScroll: true });
  }

  /** Return whether an event is on the fold sign of its row. */
  isTwist(event) {
    const node = this.nodes[idOf(event)];
    const x = event.clientX - this.canvas.getBoundingClientRect().left - 4 - (node?.depth ?? 0) * this.indent;
    return Boolean(node?.children.length) && x > -6 && x < 11;
  }

  key(event) {
    const row = this.rowOf.get(this.chosen) ?? 0;
    const node = this.nodes?.[this.chosen];
    if (!node || event.ctrlKey || event.altKey || event.metaKey) return;
    const page = Math.max(1, Math.floor(this.place.clientHeight / ROW) - 1);
    const to = (at) => this.select(this.rows[Math.max(0, Math.min(this.rows.length - 1, at))]);
    const isFolded = this.folded.has(this.chosen) && !this.wanted;
    const moves = {
      ArrowDown: () => to(row + 1),
      ArrowUp: () => to(row - 1),
      PageDown: () => to(row + page),
      PageUp: () => to(row - page),
      Home: () => to(0),
      End: () => to(this.rows.length - 1),
      ArrowRight: () => (isFolded ? this.toggle(node.id) : node.children.length && to(row + 1)),
      ArrowLeft: () => (node.children.length && !isFolded ? this.toggle(node.id) : node.parent >= 0 && this.select(node.parent)),
      Enter: () => this.toggle(node.id),
    };
    if (!moves[event.key]) return;
    event.preventDefault();
    moves[event.key]();
  }
}

/** Return whether nodes belong to the same tree, for example after a replay has moved back. */
function isSame(nodes, others) {
  return nodes?.length === others.length && nodes.every(({ name, path, parent }, id) => name === others[id].name && path === others[id].path && parent === others[id].parent);
}

function idOf(event) {
  const row = event.target.closest?.("[data-id]");
  return row ? Number(row.dataset.id) : null;
}

function matches(node, text) {
  return `${node.name}\n${node.cls}\n${node.file}:${node.line}`.toLowerCase().includes(text);
}
