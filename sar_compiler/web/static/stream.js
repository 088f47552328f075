// The server's events about the robots, live or replayed, and the loss of the connection to it.

import { Run } from "./run.js";

// A server sends an event every second.
const SILENCE_MS = 4000;
// A browser has six connections to one server, also for commands. If there are more pages, hidden ones close theirs.
const MANY = 4;

export class Stream {
  /**
   * @param {{begin: () => void, change: () => void}} page is told that everything begins anew, and that something is otherwise.
   */
  constructor(page) {
    this.page = page;
    // A run for each robot, and the place of the one that is chosen.
    this.runs = [new Run()];
    this.names = [];
    this.chosen = 0;
    // The verbs of each robot, and those of them that are heeded just now.
    this.verbs = [];
    this.available = [];
    // The names of the tools of an engineer.
    this.tools = [];
    // How long a replay is, in seconds; null for live runs.
    this.end = null;
    // Whether there is something to show.
    this.isTold = false;
    this.source = null;
    this.last = performance.now();
    this.isHeard = false;
    this.isOver = false;
    // Of a replay: the time that is wanted, the one that is shown, and the number of the moment that was told last.
    this.place = 0;
    this.shown = 0;
    this.moment = 0;
    this.isAsking = false;
    this.asking = new AbortController();
    this.trouble = "";
  }

  get run() {
    return this.runs[this.chosen];
  }

  get isReplay() {
    return this.end !== null;
  }

  get isTeam() {
    return this.runs.length > 1;
  }

  /** For how many seconds nothing was heard; 0 as long as the server tells, and where no more is to come. */
  get silent() {
    const passed = performance.now() - this.last;
    return this.isOver || (this.isHeard && passed <= SILENCE_MS) ? 0 : passed / 1000;
  }

  /** Whether orders can reach the robots. */
  get isConnected() {
    return this.isHeard && !this.silent && !this.isOver;
  }

  listen() {
    if (this.source && this.source.readyState !== EventSource.CLOSED) return;
    this.source = new EventSource("events");
    const on = (name, heed) => this.source.addEventListener(name, ({ data }) => {
      this.last = performance.now();
      this.isHeard = true;
      this.isOver = false;
      heed(JSON.parse(data));
    });
    on("hello", (data) => this.hello(data));
    on("changes", (data) => this.take(data));
    on("verbs", (data) => {
      this.verbs = data;
      this.page.change();
    });
    on("beat", (data) => this.beat(data));
    on("bye", () => this.leave());
    this.source.addEventListener("error", () => {
      this.isHeard = false;
      // A browser gives up where a proxy answers in the server's place.
      setTimeout(() => document.hidden || this.listen(), 2000);
      this.page.change();
    });
  }

  hello({ mode, robots, verbs, tools, end }) {
    // Whatever was known is told again: by the same run, or by another one that has taken its place.
    const name = this.names[this.chosen];
    this.names = robots ?? ["run"];
    this.runs = this.names.map(() => new Run());
    this.chosen = Math.max(0, this.names.indexOf(name));
    this.verbs = verbs ?? [];
    this.tools = tools ?? [];
    this.available = [];
    this.moment = 0;
    // One that a server that is gone has left open.
    this.asking.abort();
    this.asking = new AbortController();
    this.end = end ?? null;
    this.isTold = false;
    this.page.begin();
    document.body.dataset.mode = mode;
    document.body.classList.remove("ready");
    // Where it was before the connection came again.
    if (this.isReplay) this.go(this.place);
  }

  take(changes) {
    for (const { robot, ...change } of changes) this.runs[robot].take(change);
    this.isTold = true;
    this.page.change();
  }

  beat({ time, verbs, pages }) {
    if (document.hidden && pages > MANY) {
      this.source.close();
      this.isHeard = false;
    }
    const { run } = this.runs[0];
    if (time !== undefined && run.number && !run.ended) this.runs[0].time = Math.max(this.runs[0].time, time - run.began);
    this.available = verbs ?? [];
    this.page.change();
  }

  /** No more is to come; of a run that has not said its end, that is a silence. */
  leave() {
    this.isOver = this.runs.every(({ run }) => run.ended);
    this.isHeard = this.isOver;
    this.page.change();
  }

  choose(index) {
    this.chosen = index;
    this.page.change();
  }

  /** The name of a landmark of a robot, which is the only one among all robots. */
  nameOf(run, name) {
    return this.isTeam ? `${this.names[this.runs.indexOf(run)]}/${name}` : name;
  }

  // --- replay --------------------------------------------------------------------------------------

  go(time) {
    this.place = Math.max(0, Math.min(this.end, time));
    if (!this.isAsking) this.ask();
    this.page.change();
  }

  /** Have the server tell what was so at the time that is wanted, one time after the other, until nobody wants another one. */
  async ask() {
    this.isAsking = true;
    for (let [time, told] = [NaN, null]; time !== this.place || told !== this.runs; ) {
      [time, told] = [this.place, this.runs];
      const answer = await this.answered(`moment?time=${time}&since=${this.moment}`);
      // Meanwhile the connection may have come again, maybe to another server.
      if (told !== this.runs) continue;
      this.trouble = answer.trouble ?? "";
      if (!answer.changes) break;
      [this.moment, this.shown] = [answer.number, time];
      this.take(answer.changes);
    }
    this.isAsking = false;
    this.page.change();
  }

  /** Return what the server answers; nothing where it cannot be reached: of that the events tell, and of its return. */
  async answered(address) {
    try {
      const answer = await fetch(address, { signal: this.asking.signal });
      return answer.ok ? await answer.json() : { trouble: await answer.text() };
    } catch {
      return {};
    }
  }
}

/** Return a function that has something drawn with the next frame, however often it is called until then. */
export function drawer(draw) {
  let isDue = false;
  return () => {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      draw();
    });
  };
}
