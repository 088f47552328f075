// The server's events about the robots, live or replayed, and the loss of the connection to it.

import { Run } from "./run.js";

// A server sends an event every second.
const SILENCE_MS = 4000;
// A browser opens at most six connections to a server, including those for commands. If there are more pages, hidden pages close their connections.
const MANY = 4;

export class Stream {
  /**
   * @param {{begin: () => void, change: () => void}} page the callbacks for a new state and for changes.
   */
  constructor(page) {
    this.page = page;
    // A run for each robot, and the index of the selected run.
    this.runs = [new Run()];
    this.names = [];
    this.chosen = 0;
    // The commands of each robot, and the names of the commands that it currently accepts.
    this.verbs = [];
    this.available = [];
    // The names of the engineer's tools.
    this.tools = [];
    // The duration of a replay in seconds; null for live runs.
    this.end = null;
    // Whether a state was received.
    this.isTold = false;
    this.source = null;
    this.last = performance.now();
    this.isHeard = false;
    this.isOver = false;
    // For a replay: the requested time, the shown time, and the number of the last received moment.
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

  /** The seconds since the last event; 0 while events arrive, and when no more are expected. */
  get silent() {
    const passed = performance.now() - this.last;
    return this.isOver || (this.isHeard && passed <= SILENCE_MS) ? 0 : passed / 1000;
  }

  /** Whether commands can reach the robots. */
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
      // A browser stops reconnecting if a proxy responds instead of the server.
      setTimeout(() => document.hidden || this.listen(), 2000);
      this.page.change();
    });
  }

  hello({ mode, robots, verbs, tools, end }) {
    // After a reconnection, the server sends the whole state again, possibly of another run.
    const name = this.names[this.chosen];
    this.names = robots ?? ["run"];
    this.runs = this.names.map(() => new Run());
    this.chosen = Math.max(0, this.names.indexOf(name));
    this.verbs = verbs ?? [];
    this.tools = tools ?? [];
    this.available = [];
    this.moment = 0;
    // The connection may have been left open by a server that has ended.
    this.asking.abort();
    this.asking = new AbortController();
    this.end = end ?? null;
    this.isTold = false;
    this.page.begin();
    document.body.dataset.mode = mode;
    document.body.classList.remove("ready");
    // Continue at the time before the reconnection.
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

  /** Handle the end of the events, which means that the connection is lost unless the run has ended. */
  leave() {
    this.isOver = this.runs.every(({ run }) => run.ended);
    this.isHeard = this.isOver;
    this.page.change();
  }

  choose(index) {
    this.chosen = index;
    this.page.change();
  }

  /** Return a landmark's name that is unique among all robots. */
  nameOf(run, name) {
    return this.isTeam ? `${this.names[this.runs.indexOf(run)]}/${name}` : name;
  }

  // --- replay --------------------------------------------------------------------------------------

  go(time) {
    this.place = Math.max(0, Math.min(this.end, time));
    if (!this.isAsking) this.ask();
    this.page.change();
  }

  /** Request the state at the wanted time, and repeat until that time no longer changes. */
  async ask() {
    this.isAsking = true;
    for (let [time, told] = [NaN, null]; time !== this.place || told !== this.runs; ) {
      [time, told] = [this.place, this.runs];
      const answer = await this.answered(`moment?time=${time}&since=${this.moment}`);
      // The page may have reconnected meanwhile, possibly to another server.
      if (told !== this.runs) continue;
      this.trouble = answer.trouble ?? "";
      if (!answer.changes) break;
      [this.moment, this.shown] = [answer.number, time];
      this.take(answer.changes);
    }
    this.isAsking = false;
    this.page.change();
  }

  /** Return the server's response, or nothing if it cannot be reached; the events report lost connections. */
  async answered(address) {
    try {
      const answer = await fetch(address, { signal: this.asking.signal });
      return answer.ok ? await answer.json() : { trouble: await answer.text() };
    } catch {
      return {};
    }
  }
}

/** Return a function that draws once in the next frame, however often it is called before. */
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
