// The state of a run, as sent by the server. Times are seconds since the run's start.

const NEVER = Object.freeze({ status: "", since: 0, entered: 0, time: 0, tick: 0, message: "", failed: null, failure: "", label: "", ends: [0, 0, 0], ran: 0, longest: 0 });

export class Run {
  constructor() {
    this.begin();
  }

  /** Reset the state. */
  begin() {
    Object.assign(this, {
      run: { number: 0 }, condition: { word: "", level: "quiet", since: 0, reason: "" }, place: "", estimate: {}, time: 0, nodes: [], states: [],
      pose: null, plan: [], drive: null, map: null, times: {}, kinds: {}, landmarks: new Map(), rasters: {},
      tasks: [], awaited: [], resume: "", objects: {}, figures: [], gauges: [], alarms: [], properties: { watched: [], assumption_failed_at: null }, why: null, log: [], trail: [], lanes: [],
    });
  }

  /** Apply a change: new values of most parts, and differences of nodes, landmarks, rasters and lists. */
  take({ begin, nodes, states = {}, landmarks = {}, rasters, log, trail, lanes, ...parts }) {
    if (begin) this.begin();
    if (begin || parts.kinds || rasters || Object.keys(landmarks).length) this.version = (this.version ?? 0) + 1;
    Object.assign(this, parts);
    if (nodes) {
      this.nodes = linked(nodes);
      this.states = this.nodes.map(() => NEVER);
      this.lanes = [];
    }
    for (const [id, [status, since, entered, time, tick, message, failed, failure, label, ends, ran, longest]] of Object.entries(states)) {
      this.states[id] = { status, since, entered, time, tick, message, failed, failure, label, ends, ran, longest };
    }
    for (const [key, landmark] of Object.entries(landmarks)) {
      if (landmark) this.landmarks.set(key, landmark);
      else this.landmarks.delete(key);
    }
    this.rasters = { ...this.rasters, ...rasters };
    if (log) this.log = [...this.log.slice(0, log.at), ...log.values.map(([run, when, level, text]) => ({ run, time: when, level, text }))];
    if (lanes) this.lanes.splice(lanes.at, Infinity, ...lanes.values);
    if (trail) this.trail.splice(trail.at, Infinity, ...trail.values);
  }

  /** Return whether a status belongs to the parent's current activation, and not to an earlier one. */
  isCurrent(id) {
    for (let at = id; this.nodes[at].parent >= 0 && this.states[at].status !== "RUNNING"; at = this.nodes[at].parent) {
      const { parent, place } = this.nodes[at];
      const { entered } = this.states[parent];
      // A sibling without a change was ticked if a later sibling was ticked; it then returned the same status as before.
      const ticked = (child) => this.states[child].tick >= entered;
      if (!this.states[at].status || !this.nodes[parent].children.slice(place).some(ticked)) return false;
    }
    return true;
  }

  /** Return the running leaves in the order of the tree. */
  running() {
    const found = [];
    this.states.forEach((state, id) => {
      if (state.status === "RUNNING" && !this.nodes[id].children.length) found.push(id);
    });
    return found;
  }

  /** Return the kind of a landmark, or a default for an unknown kind. */
  kindOf({ kind }) {
    return this.kinds[kind] ?? { name: kind, plural: `${kind}s`, shape: "circle", is_found: false };
  }
}

/** Return the nodes in pre-order, each with its position in the tree. */
function linked(nodes) {
  const found = [];
  nodes.forEach((node, id) => {
    const above = found[node.parent];
    found.push({ ...node, id, cls: node.path.split(".").pop(), depth: above ? above.depth + 1 : 0, place: above ? above.children.length : 0, children: [], count: 1 });
    above?.children.push(id);
  });
  for (let id = found.length - 1; id > 0; id -= 1) found[found[id].parent].count += found[id].count;
  return found;
}
