// What the entries of a run come to: the tree with the status of each node, the map, the log. The same for live runs and for
// journals. Values are replaced and never changed, and lists only grow, so that a copy of a state is cheap (`snapshot`).

const NEVER = Object.freeze({ status: "", since: 0, time: 0, tick: 0, entered: 0, message: "", failure: null });
const LEVELS = { 30: "warning", 40: "error", 50: "error" };
const QUIET = new Set(["goal_sent", "goal_ended"]);
const ZONES = {
  zone_started: "under way", zone_visited: "visited", zone_postponed: "postponed", zone_abandoned: "abandoned",
};

export class Run {
  constructor() {
    this.nodes = [];
    this.log = [];
    this.trail = [];
    Object.assign(this, this.beginning());
  }

  /** What changes with entries, but for the lists that only grow. */
  beginning() {
    return {
      about: {}, number: 0, began: 0, wall: 0, time: 0, tick: 0, ended: null, why: null, states: [], map: null, pose: null, plan: null, drive: null,
      base: null, zones: new Map(), survivors: new Map(), orders: "", alarm: "", logged: 0, trailed: 0,
    };
  }

  apply(entry) {
    const { kind, data } = entry;
    this.wall = entry.wall;
    if (kind === "run_began") this.begin(entry);
    this.time = Math.max(entry.run === this.number ? this.time : 0, entry.time);
    if (kind === "status") this.node(entry);
    else if (kind === "pose") this.moved(data);
    else if (kind === "plan") this.plan = data.frame === "map" ? data.points : null;
    else if (kind === "map") this.map = data;
    else if (kind === "progress") this.drive = data;
    else if (kind === "why") this.why = data;
    else if (kind === "log") this.tell(entry, LEVELS[data.level] ?? "info", data.text, data.node);
    else this.fact(entry);
  }

  begin({ data, run, time }) {
    // Another mission has begun in the same journal.
    if (this.number && run <= this.number) Object.assign(this, this.beginning());
    const first = !this.number;
    Object.assign(this, { about: data, number: run, began: time, time, tick: 0, ended: null, why: null, plan: null, drive: null });
    this.nodes = data.tree ? flat(data.tree, data.run?.looks) : [];
    this.states = this.nodes.map(() => NEVER);
    const identity = data.identity ?? {};
    if (first || !this.zones.size) {
      for (const zone of listed(identity.zones)) {
        if (!this.zones.has(zone.id)) this.zones.set(zone.id, { ...zone, state: "open" });
      }
    }
    if (identity.base_station) this.base = identity.base_station;
  }

  node({ time, data }) {
    const was = this.states[data.node];
    // What a node came to before it was reset is shown as something former.
    if (!was || data.status === "IDLE") return;
    this.tick = data.tick;
    const since = was.status === data.status ? was.since : time;
    // An activation goes on while the node is running, and ends with what comes after that.
    const entered = was.status === "RUNNING" ? was.entered : data.tick;
    const failure = data.status === "FAILURE" ? { time, message: data.message } : was.failure;
    this.states[data.node] = { status: data.status, since, entered, time, tick: data.tick, message: data.message ?? "", failure };
  }

  moved(data) {
    if (data.x === null || data.y === null) return;
    this.pose = data;
    this.trail.length = this.trailed;
    this.trail.push([data.x, data.y]);
    this.trailed += 1;
  }

  fact(entry) {
    const { kind, data } = entry;
    if (kind === "run_ended") this.ended = data;
    if (kind === "goal_ended") Object.assign(this, { plan: null, drive: null });
    if (kind === "operator_ordered") this.orders = data.order;
    if (kind === "alarmed") this.alarm = data.reason;
    this.place(kind, data);
    this.find(kind, data);
    if (!QUIET.has(kind)) this.tell(entry, "fact", words(kind, data), "");
  }

  place(kind, data) {
    if (kind === "zone_added") this.zones = new Map(this.zones).set(data.id, { ...data, state: "open" });
    const zone = this.zones.get(data.zone);
    if (zone && kind === "survivor_unplaced") this.zones = new Map(this.zones).set(data.zone, { ...zone, unplaced: data.reason });
    if (!zone || !ZONES[kind]) return;
    this.zones = new Map(this.zones);
    if (kind === "zone_started") {
      for (const [id, each] of this.zones) if (each.state === "under way") this.zones.set(id, { ...each, state: "open" });
    }
    const unplaced = kind === "zone_searched" ? "" : zone.unplaced;
    this.zones.set(data.zone, { ...zone, state: ZONES[kind], reason: data.reason ?? "", unplaced });
  }

  find(kind, data) {
    const set = (id, changes) => {
      const known = this.survivors.get(id) ?? { id, standing: "candidate", report: "" };
      this.survivors = new Map(this.survivors).set(id, { ...known, ...changes });
    };
    const at = (x, y) => `at ${x} ${y}`;
    if (kind === "zone_searched" && data.survivor) {
      const [x, y] = data.survivor;
      if (![...this.survivors.values()].some((each) => each.x === x && each.y === y)) set(at(x, y), { x, y, zone: data.zone });
    } else if (kind === "survivor_named") {
      const { zone } = this.survivors.get(at(data.x, data.y)) ?? {};
      this.survivors = new Map(this.survivors);
      this.survivors.delete(at(data.x, data.y));
      set(data.survivor, { x: data.x, y: data.y, zone, name: data.survivor });
    } else if (kind === "survivor_judged") set(data.survivor, { standing: data.standing, sameAs: data.same_as });
    else if (kind === "report_sent") set(data.survivor, { report: "sent" });
    else if (kind === "report_kept") set(data.survivor, { report: "kept" });
    else if (kind === "report_acknowledged") set(data.survivor, { report: "acknowledged" });
  }

  tell({ time, run }, level, text, node) {
    this.log.length = this.logged;
    this.log.push({ time: time - this.began, run, level, text, node });
    this.logged += 1;
  }

  /** Whether a status belongs to what the tree is doing now, and not to an earlier activation of the parent. */
  isCurrent(id) {
    for (let at = id; this.nodes[at].parent >= 0 && this.states[at].status !== "RUNNING"; at = this.nodes[at].parent) {
      const { parent, place } = this.nodes[at];
      const { entered } = this.states[parent];
      // One without news was ticked all the same if a later one was: it has answered as it did before.
      const ticked = (child) => this.states[child].tick >= entered;
      if (!this.states[at].status || !this.nodes[parent].children.slice(place).some(ticked)) return false;
    }
    return true;
  }

  /** The leaves that are running, in the order of the tree. */
  running() {
    const found = [];
    this.states.forEach((state, id) => {
      if (state.status === "RUNNING" && !this.nodes[id].children.length) found.push(id);
    });
    return found;
  }
}

function listed(zones) {
  return Array.isArray(zones) ? zones.filter((zone) => zone && typeof zone.id === "string") : [];
}

/** The nodes of an outline in pre-order, as the journal numbers them. */
function flat(outline, looks) {
  const nodes = [];
  const waiting = [[outline, -1, 0, 0]];
  while (waiting.length) {
    const [node, parent, depth, place] = waiting.pop();
    const id = nodes.length;
    const cls = String(node.class ?? "").split(".").pop();
    nodes.push({ id, name: node.name, cls, sign: looks?.[id]?.[1] ?? "", parent, depth, place, children: [], ...pick(node), count: 1 });
    if (parent >= 0) nodes[parent].children.push(id);
    const children = node.children ?? [];
    for (let index = children.length - 1; index >= 0; index -= 1) waiting.push([children[index], id, depth + 1, index]);
  }
  for (let id = nodes.length - 1; id > 0; id -= 1) nodes[nodes[id].parent].count += nodes[id].count;
  return nodes;
}

function pick({ class: path, attributes, memory, policy, file, line }) {
  return { path, attributes: { ...(memory === undefined ? {} : { memory }), ...(policy ? { policy } : {}), ...attributes }, file, line };
}

/** A fact in words: `zone_visited` with its values. */
function words(kind, data) {
  if (kind === "run_began") return `The run began${data.run?.node ? ` on ${data.run.node}` : ""}.`;
  if (kind === "run_ended") return `The run ended with status ${data.status}${data.reason ? `: ${data.reason}` : "."}`;
  const values = Object.entries(data).filter(([, value]) => value !== null && value !== "");
  const told = values.map(([key, value]) => (kind.startsWith(key) ? shown(value) : `${key} ${shown(value)}`));
  return `${kind.replaceAll("_", " ")}${told.length ? `: ${told.join(", ")}` : ""}`;
}

function shown(value) {
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : value.toFixed(2);
  return Array.isArray(value) ? `(${value.map(shown).join(", ")})` : typeof value === "object" ? JSON.stringify(value) : String(value);
}

/** Whatever a state is made of, for `Run` to be put back to it: earlier than where it is. */
export function snapshot(run) {
  const copy = { nodes: run.nodes };
  for (const key of Object.keys(run.beginning())) copy[key] = run[key];
  copy.states = run.states.slice();
  copy.zones = new Map(run.zones);
  return copy;
}

export function putBack(run, copy) {
  Object.assign(run, { ...copy, states: copy.states.slice(), zones: new Map(copy.zones) });
  run.log.length = run.logged;
  run.trail.length = run.trailed;
}
