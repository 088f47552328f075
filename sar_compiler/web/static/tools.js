// Queries for engineers about a run: its blackboard, breakpoints, and the effect of another outcome of a leaf.

import { html, say, set } from "./shapes.js";

const ASK_MS = 1000;
const NOT_KEPT = "A journal does not contain the blackboard. Open the page of the run itself while it is active.";

export class Tools {
  /**
   * @param {{bar: HTMLElement, board: HTMLDetailsElement, otherwise: HTMLElement}} places the elements of the tools.
   * @param {import("./stream.js").Stream} stream the stream whose run is queried.
   * @param {import("./tree_view.js").TreeView} tree the tree view with the selected node and the breakpoints.
   */
  constructor({ bar, board, otherwise }, stream, tree) {
    Object.assign(this, { board, otherwise, stream, tree, held: null });
    this.breaker = html("button", { type: "button", "aria-pressed": "false" }, "Breakpoint");
    this.on = html("button", { type: "button" }, "Continue");
    this.asker = html("button", { type: "button" }, "Try other outcomes");
    bar.append(this.breaker, this.on, this.asker);
    this.breaker.addEventListener("click", () => this.hold({ node: tree.chosen, is_set: !tree.breaks.has(tree.chosen) }));
    this.on.addEventListener("click", () => this.hold({ goes_on: true }));
    this.asker.addEventListener("click", () => this.wonder());
    board.addEventListener("toggle", () => this.look());
    setInterval(() => document.hidden || this.look(), ASK_MS);
  }

  /** Clear the data of another run. */
  again() {
    this.tree.breaks = new Set();
    this.held = null;
    this.show();
  }

  has(name) {
    return this.stream.tools.includes(name) && (this.stream.isReplay || this.stream.isConnected);
  }

  /** Show the available queries for the selected node. */
  show() {
    const { chosen, breaks } = this.tree;
    const { run } = this.stream;
    const node = run.nodes[chosen];
    const may = Boolean(node) && this.has("breakpoints") && location.hash.length > 1 && !run.run.ended;
    this.breaker.hidden = !may;
    set(this.breaker, { "aria-pressed": String(breaks.has(chosen)) });
    this.on.hidden = !may || this.held === null;
    this.asker.hidden = !node || node.children.length > 0 || !run.states[chosen].status || !this.has("otherwise");
    this.board.hidden = false;
    const key = `${chosen} ${run.states[chosen]?.tick}`;
    if (key !== this.key) this.otherwise.replaceChildren();
    this.key = key;
  }

  async look() {
    if (this.board.open && !this.stream.tools.includes("entries")) this.showBoard({ trouble: NOT_KEPT });
    else if (this.board.open && this.has("entries")) this.showBoard(await this.ask("entries"));
    if (this.tree.breaks.size) await this.hold({});
  }

  showBoard({ answer, trouble }) {
    const rows = (answer ?? []).flatMap(({ scope, entries }) => entries.map(({ key, value, type, writes }) => [scope ? `${scope}/${key}` : key, value ?? "not written", type, writes ? `${writes}×` : ""]));
    const place = this.board.lastElementChild;
    const told = JSON.stringify([rows, trouble]);
    if (told === this.told) return;
    this.told = told;
    const cells = (row) => row.map((each, column) => (column ? html("td", {}, each) : html("th", { scope: "row" }, each)));
    place.replaceChildren(...(rows.length ? rows.map((row) => html("tr", {}, ...cells(row))) : [html("tr", {}, html("td", {}, trouble ?? "The blackboard is empty."))]));
  }

  async hold(values) {
    const { answer, trouble } = await this.ask("breakpoints", values);
    if (trouble) say(this.otherwise, trouble);
    if (!answer) return;
    this.tree.breaks = new Set(answer.nodes);
    if (answer.held !== null && answer.held !== this.held) this.tree.select(answer.held);
    this.held = answer.held;
    this.stream.page.change();
  }

  async wonder() {
    const { chosen } = this.tree;
    const { run } = this.stream;
    say(this.otherwise, "…");
    const { answer, trouble } = await this.ask("otherwise", { node: chosen, tick: run.states[chosen].tick, run: run.run.number });
    if (!answer) return say(this.otherwise, `Unknown: ${trouble}`);
    const line = ({ instead, then, root }) => html("li", {}, html("b", {}, [instead.status, instead.label && `(${instead.label})`].filter(Boolean).join(" ")), `: ${[...then, `the root ${root}`].join(", ")}`);
    this.otherwise.replaceChildren(answer.length ? html("ul", {}, ...answer.map(line)) : "No other outcome was possible in that tick.");
  }

  async ask(tool, values = {}) {
    try {
      const response = await fetch(`tools/${tool}`, {
        method: "POST",
        headers: { "Content-Type": "application/json", Authorization: `Bearer ${location.hash.slice(1)}` },
        body: JSON.stringify({ ...values, robot: this.stream.chosen }),
      });
      return response.ok ? { answer: await response.json() } : { trouble: (await response.text()).trim() };
    } catch {
      return { trouble: "the run cannot be reached" };
    }
  }
}
