// The operator's commands: STOP, one button for pause and resume, and the others, with a dialog for values or a confirmation.

import { html, say, set } from "./shapes.js";

// The server answers within ten seconds.
const ANSWER_MS = 12000;
// How long the answer of a successful command stays.
const READ_MS = 6000;
const NAME = "sar-operator";
// Conversion of typed text to the value of a field, by its kind. The mission rejects an invalid outline.
const READ = { number: (text) => (text === "" ? null : Number(text)), polygon: (text) => (text === "" ? [] : parsed(text)) };

export class Orders {
  /**
   * @param {HTMLElement} place where the buttons are.
   * @param {import("./stream.js").Stream} stream what the robots are, and which of them is chosen.
   * @param {{pick: Function, draw: Function}} map is asked for a place, or for an outline (MapView).
   */
  constructor(place, stream, map) {
    Object.assign(this, { place, stream, map });
    this.stop = html("button", { type: "button", class: "stop", disabled: true }, "STOP");
    this.stopAll = html("button", { type: "button", class: "stop-all", disabled: true, hidden: true }, "STOP ALL");
    this.toggle = html("button", { type: "button", class: "toggle", disabled: true });
    this.more = html("div", { id: "verbs", role: "group", "aria-label": "Other commands" });
    this.answer = html("p", { id: "answer", role: "status" });
    this.to = html("h2", { class: "to" });
    this.by = html("input", { id: "by", autocomplete: "off", maxlength: 60, value: remembered() });
    this.who = html("label", { class: "by" }, "Your name, for the log ", this.by);
    this.reason = html("input", { id: "reason", autocomplete: "off", maxlength: 200 });
    this.why = html("label", { class: "by" }, "Reason, for the log ", this.reason);
    place.append(this.to, html("div", { class: "first" }, this.stopAll, this.stop, this.toggle), this.answer, this.more, this.who, this.why);
    this.ask = html("dialog", { id: "ask" }, html("form", { method: "dialog" }, html("h2"), html("div"), html("menu", {}, html("button", { type: "button", class: "no" }), html("button", { value: "yes", class: "yes" }))));
    document.body.append(this.ask);
    // Not a button that submits: Enter in a field would press the first of these.
    this.ask.querySelector(".no").addEventListener("click", () => this.ask.close("no"));
    this.stop.addEventListener("click", () => this.halt());
    this.stopAll.addEventListener("click", () => this.haltAll());
    this.toggle.addEventListener("click", () => this.begin(this.toggled()));
    this.by.addEventListener("change", () => remember(this.by.value));
    this.buttons = new Map();
    this.offered = new Map();
  }

  get isOpen() {
    return this.ask.open;
  }

  /** Forget the verbs of another run. */
  again() {
    this.offered = new Map();
    this.key = "";
    this.token = location.hash.slice(1);
    say(this.answer, "");
  }

  /** Show the orders to the robot that is chosen: those that its tree has heeded, and can be given just now. */
  show() {
    const { chosen, run, runs, verbs, available, names, isTeam, isReplay } = this.stream;
    const offered = this.offered.get(chosen) ?? new Set();
    for (const name of available[chosen] ?? []) offered.add(name);
    this.offered.set(chosen, offered);
    this.now = this.heeded(chosen);
    this.verbs = (verbs[chosen] ?? []).filter(({ name }) => offered.has(name));
    this.isHeld = isHeld(run);
    // To runs that have ended there is nothing more to order; the answer to what has ended them stays.
    const isOver = runs.every((each) => each.run.ended);
    this.place.hidden = isReplay || !verbs.some((each) => each.length) || (isOver && !this.answer.dataset.kind);
    say(this.to, isTeam ? `Commands to ${names[chosen]}` : "Commands");
    say(this.stop, isTeam ? `STOP ${names[chosen]}` : "STOP");
    this.stopAll.hidden = !isTeam;
    this.stopAll.disabled = !isTeam || (!this.able("hold").length && !this.able("stop").length);
    // What a robot heeds is told a moment after what can be ordered.
    this.isKnown = Boolean(available[chosen]);
    const key = `${chosen} ${this.isKnown} ${this.verbs.map(({ name }) => name).join(" ")}`;
    if (key !== this.key) this.draw(key);
    const may = (verb) => Boolean(verb && this.now.has(verb.name));
    this.stop.disabled = !may(this.of("stop")) && !may(this.of("hold"));
    for (const [name, button] of this.buttons) button.disabled = !this.now.has(name);
    const toggled = this.toggled();
    this.toggle.hidden = !toggled;
    if (toggled) {
      say(this.toggle, toggled.label);
      set(this.toggle, { title: toggled.help, "data-verb": toggled.name, "data-role": toggled.role });
      this.toggle.disabled = !may(toggled);
    }
  }

  draw(key) {
    this.key = key;
    this.stop.hidden = !this.of("stop") && !this.of("hold");
    this.buttons = new Map(this.verbs.filter(({ role }) => !role).map((verb) => [verb.name, this.button(verb)]));
    this.more.replaceChildren(...this.buttons.values());
    this.who.hidden = this.why.hidden = !this.verbs.length || !this.token;
    if (!this.token) say(this.answer, "To send commands, open the complete address that the run has printed.");
    else if (this.isKnown && !this.verbs.length) say(this.answer, "This tree accepts no commands.");
    else if (!this.answer.dataset.kind) say(this.answer, "");
  }

  /** The names of the verbs that a robot heeds just now. */
  heeded(robot) {
    const { runs, available, isConnected } = this.stream;
    return new Set(isConnected && this.token && !runs[robot].run.ended ? (available[robot] ?? []) : []);
  }

  /** The robots that heed their verb of a role just now, each with that verb. */
  able(wanted) {
    return this.stream.runs.flatMap((_, robot) => {
      const verb = (this.stream.verbs[robot] ?? []).find(({ role }) => role === wanted);
      return verb && this.heeded(robot).has(verb.name) ? [[robot, verb]] : [];
    });
  }

  /** The verb of a role. */
  of(wanted) {
    return this.verbs?.find(({ role }) => role === wanted);
  }

  toggled() {
    return (this.isHeld ? this.of("release") : null) ?? this.of("hold");
  }

  button(verb) {
    const button = html("button", { type: "button", title: verb.help, class: verb.confirm ? "grave" : "", disabled: true, "data-verb": verb.name }, verb.label);
    button.addEventListener("click", () => this.begin(verb));
    return button;
  }

  /** Have the robot stand at once, and ask whether that is the end. */
  halt() {
    const [hold, stop] = [this.of("hold"), this.of("stop")];
    const stays = this.isHeld || this.now.has(hold?.name);
    const reason = this.reason.value;
    if (stays && !this.isHeld) this.give(hold, {});
    this.reason.value = reason;
    if (stop && this.now.has(stop.name)) this.begin(stop, stays ? "The robot has been told to stop. The mission stays paused unless you abort it." : "");
  }

  /** Have every robot stand at once, and ask whether that is the end of their missions. */
  async haltAll() {
    const standing = this.able("hold").filter(([robot]) => !isHeld(this.stream.runs[robot]));
    if (standing.length) this.giveEach(standing);
    const [first] = this.able("stop");
    if (!first) return;
    const before = "All robots have been told to stop. Their missions stay paused unless you abort them.";
    if (await this.question(first[1], {}, before, "all robots")) this.giveEach(this.able("stop"));
  }

  /** The verb of a name or a role that the chosen robot heeds just now. */
  find(wanted) {
    return wanted && this.verbs?.find(({ name, role }) => (name === wanted || role === wanted) && this.now.has(name));
  }

  /**
   * Give an order, after the question that it needs; *before* stands ahead of that, and says that the robot stays paused. *found* is the
   * detection that it is about.
   */
  async begin(verb, before = "", found = "") {
    const robot = this.stream.chosen;
    const given = Object.fromEntries(verb.fields.filter(({ kind }) => found && kind === "found").map(({ name }) => [name, found]));
    const values = verb.fields.length || verb.confirm ? await this.question(verb, given, before) : {};
    if (values) this.give(verb, values, robot);
  }

  question(verb, given, before = "", to = this.stream.names[this.stream.chosen]) {
    const fields = new Map(verb.fields.map((field) => [field.name, this.field(field, given[field.name])]));
    const [heading, body, yes] = [this.ask.querySelector("h2"), this.ask.querySelector("div"), this.ask.querySelector(".yes")];
    say(heading, this.stream.isTeam ? `${verb.label}: ${to}` : verb.label);
    say(yes, verb.label);
    say(this.ask.querySelector(".no"), before ? "Stay paused" : "Cancel");
    body.replaceChildren(...[before, verb.confirm].filter(Boolean).map((text) => html("p", {}, text)), ...verb.fields.map((field) => html("label", {}, `${field.label} `, fields.get(field.name))), this.reasonField());
    const outline = verb.fields.find(({ kind }) => kind === "polygon")?.name;
    const read = () => Object.fromEntries(verb.fields.map(({ name, kind }) => [name, (READ[kind] ?? String)(fields.get(name).value)]));
    if (fields.has("x") && fields.has("y")) body.append(this.picker(verb, read, "Pick on the map", "Click the position. Escape cancels.", (answer) => this.map.pick(answer), ([x, y]) => ({ x: x.toFixed(2), y: y.toFixed(2) })));
    if (outline) body.append(this.picker(verb, read, "Draw on the map", "Click the corners in order, and the first one again to close the outline. Backspace removes the last corner, Escape cancels.", (answer) => this.map.draw(answer), (corners) => ({ [outline]: corners })));
    this.ask.returnValue = "no";
    this.ask.showModal();
    if (!verb.fields.length) this.ask.querySelector(".no").focus();
    return new Promise((answer) => {
      this.ask.onclose = () => answer(this.ask.returnValue === "yes" ? read() : null);
    });
  }

  /** A field in the question for the reason, which is the same as beside the buttons. */
  reasonField() {
    const field = html("input", { name: "reason", autocomplete: "off", maxlength: 200, value: this.reason.value });
    field.addEventListener("input", () => (this.reason.value = field.value));
    return html("label", {}, "Reason, for the log ", field);
  }

  /** A button that leaves the question for the map, and comes back to it with what was picked there. */
  picker(verb, read, label, request, ask, values) {
    const button = html("button", { type: "button" }, label);
    button.addEventListener("click", () => {
      const said = read();
      const robot = this.stream.chosen;
      this.ask.close("no");
      this.tell(request, "asked");
      ask(async (picked) => {
        this.tell("");
        if (!picked) return;
        const all = await this.question(verb, { ...said, ...values(picked) });
        if (all) this.give(verb, all, robot);
      });
    });
    return button;
  }

  field({ name, kind, choices, optional, longest }, value = "") {
    const { run } = this.stream;
    if (kind === "choice" || kind === "found") {
      const known = kind === "found" ? [...run.landmarks.values()].filter((each) => run.kindOf(each).is_found).map(({ name: each }) => [each, each]) : choices;
      const offered = optional ? [["", "–"], ...known] : known;
      return html("select", { name, required: !optional }, ...offered.map(([key, label]) => html("option", { value: key, selected: key === value }, label)));
    }
    if (kind === "polygon") return html("input", { name, required: !optional, value: value.length ? JSON.stringify(value) : "", autocomplete: "off", placeholder: "[[x1, y1], [x2, y2], [x3, y3], …]" });
    const numeric = kind === "number" ? { type: "number", step: "any" } : { type: "text", maxlength: longest };
    return html("input", { name, required: !optional, value: kind === "number" && value === "" && !optional ? 0 : value, autocomplete: "off", ...numeric });
  }

  async give(verb, values, robot = this.stream.chosen) {
    const to = this.addressed(verb, robot);
    this.tell(`${to} …`, "asked");
    const sent = this.send(verb, values, robot);
    this.reason.value = "";
    const [text, kind] = await sent;
    this.tell(`${to}: ${text}`, kind);
  }

  /** Give several robots an order each, at once; what they answer is told together. */
  async giveEach(orders) {
    this.tell(`${orders.map(([robot, verb]) => this.addressed(verb, robot)).join("; ")} …`, "asked");
    const sent = orders.map(([robot, verb]) => this.send(verb, {}, robot));
    this.reason.value = "";
    const answers = await Promise.all(sent);
    const told = answers.map(([text], index) => `${this.addressed(orders[index][1], orders[index][0])}: ${text}`);
    this.tell(told.join("; "), answers.some(([, kind]) => kind === "trouble") ? "trouble" : "done");
  }

  addressed(verb, robot) {
    return this.stream.isTeam ? `${this.stream.names[robot]}: ${verb.label}` : verb.label;
  }

  /** Send an order; return what is said to it, and whether it is done or there is trouble. */
  async send(verb, values, robot) {
    try {
      const response = await fetch(`orders/${encodeURIComponent(verb.name)}?robot=${robot}`, {
        method: "POST",
        headers: { "Content-Type": "application/json", Authorization: `Bearer ${this.token}`, "X-Operator": encodeURIComponent(this.by.value.trim()), "X-Reason": encodeURIComponent(this.reason.value.trim()) },
        body: JSON.stringify(values),
        signal: AbortSignal.timeout(ANSWER_MS),
      });
      const { accepted, message } = await response.json();
      if (accepted) return [message || "done", "done"];
      return [response.status >= 500 ? message : `refused: ${message}`, "trouble"];
    } catch (error) {
      return [error.name === "TimeoutError" ? "no answer. Check the log for the command" : "the run cannot be reached", "trouble"];
    }
  }

  /** Say something to an order; what is done need not stay. */
  tell(text, kind = "") {
    clearTimeout(this.fading);
    say(this.answer, text);
    this.answer.dataset.kind = kind;
    if (kind === "done") this.fading = setTimeout(() => this.tell(""), READ_MS);
  }
}

function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return text;
  }
}

function isHeld(run) {
  return run.condition.word === "paused";
}

/** What the operator is called, as said before. */
function remembered() {
  try {
    return localStorage.getItem(NAME) ?? "";
  } catch {
    return "";
  }
}

function remember(name) {
  try {
    localStorage.setItem(NAME, name);
  } catch {
    // Then it is asked for again.
  }
}
