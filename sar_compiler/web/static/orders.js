// The operator's commands: STOP, one button for pause and resume, and a button for each other command, with a sheet for values or a confirmation.
// Each command carries the objects that the operator saw when the sheet opened. The mission refuses the command if they have changed.

import { isCrashed, isLost } from "./condition_view.js";
import { html, say, set } from "./shapes.js";

// The server responds within ten seconds.
const ANSWER_MS = 12000;
// How long the response to a successful command is shown.
const READ_MS = 6000;
const NAME = "sar-operator";
// Conversion of typed text to the value of a field, by its kind. The mission rejects an invalid outline.
const READ = { number: (text) => (text === "" ? null : Number(text)), polygon: (text) => (text === "" ? [] : parsed(text)) };

export class Orders {
  /**
   * @param {HTMLElement} place the element of the buttons.
   * @param {import("./stream.js").Stream} stream the robots, and which of them is selected.
   * @param {{pick: Function, draw: Function}} map the map (MapView) for picking a position or drawing an outline.
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
    this.expired = html("p", { class: "expired", role: "alert" });
    // The dialog is not modal: the map stays in sight, and STOP can be pressed.
    this.ask = html("dialog", { id: "ask", tabindex: -1, "aria-labelledby": "ask-title" }, html("form", { method: "dialog" }, html("h2", { id: "ask-title" }), html("div"), this.expired, html("menu", {}, html("button", { type: "button", class: "no" }), html("button", { value: "yes", class: "yes" }))));
    place.append(this.to, html("div", { class: "first" }, this.stopAll, this.stop, this.toggle), this.answer, this.ask, this.more, this.who, this.why);
    // Cancel is not a submit button, because Enter in a field would press the first submit button.
    this.ask.querySelector(".no").addEventListener("click", () => this.ask.close("no"));
    this.ask.addEventListener("keydown", (event) => event.key === "Escape" && this.ask.close("no"));
    this.ask.addEventListener("close", () => this.ask.open || this.answered?.(this.ask.returnValue === "yes"));
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

  /** Remove the commands of the previous run. */
  again() {
    this.offered = new Map();
    this.key = "";
    this.token = location.hash.slice(1);
    say(this.answer, "");
  }

  /** Show the commands that the selected robot accepts now. */
  show() {
    const { chosen, run, runs, verbs, available, names, isTeam, isReplay } = this.stream;
    const offered = this.offered.get(chosen) ?? new Set();
    for (const name of available[chosen] ?? []) offered.add(name);
    this.offered.set(chosen, offered);
    this.now = this.heeded(chosen);
    this.verbs = (verbs[chosen] ?? []).filter(({ name }) => offered.has(name));
    this.isHeld = isHeld(run);
    // Ended runs accept no commands; the response to the last command stays.
    const isOver = runs.every((each) => each.run.ended || isCrashed(each));
    this.place.hidden = isReplay || !verbs.some((each) => each.length) || (isOver && !this.answer.dataset.kind);
    say(this.to, isTeam ? `Commands to ${names[chosen]}` : "Commands");
    say(this.stop, isTeam ? `STOP ${names[chosen]}` : "STOP");
    this.stopAll.hidden = !isTeam;
    this.stopAll.disabled = !isTeam || (!this.able("hold").length && !this.able("stop").length);
    // The accepted commands arrive shortly after the list of commands.
    this.isKnown = Boolean(available[chosen]) && run.condition.word !== "not begun";
    const key = `${chosen} ${this.isKnown} ${this.verbs.map(({ name }) => name).join(" ")}`;
    if (key !== this.key) this.draw(key);
    const may = (verb) => Boolean(verb && this.now.has(verb.name));
    this.stop.disabled = !may(this.of("stop")) && !may(this.of("hold"));
    for (const [name, [button, verb]] of this.buttons) {
      const object = run.objects[name];
      button.disabled = !this.now.has(name) || (Boolean(verb.named) && !object);
      say(button, labelOf(verb, object));
    }
    this.expire();
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
    this.buttons = new Map(this.verbs.filter(({ role }) => !role).map((verb) => [verb.name, [this.button(verb), verb]]));
    this.more.replaceChildren(...[...this.buttons.values()].map(([button]) => button));
    this.who.hidden = this.why.hidden = !this.verbs.length || !this.token;
    if (!this.token) say(this.answer, "To send commands, open the complete address that the run has printed.");
    else if (this.isKnown && !this.verbs.length) say(this.answer, "This tree accepts no commands.");
    else if (!this.answer.dataset.kind) say(this.answer, "");
  }

  /** Return the names of the commands that a robot currently accepts: none after a crash, and only commands that stop the robot if contact is lost. */
  heeded(robot) {
    const { runs, verbs, available, isConnected } = this.stream;
    const run = runs[robot];
    if (!isConnected || !this.token || run.run.ended || isCrashed(run)) return new Set();
    const stops = (verbs[robot] ?? []).filter(({ role }) => role === "hold" || role === "stop").map(({ name }) => name);
    return new Set((available[robot] ?? []).filter((name) => !isLost(run) || stops.includes(name)));
  }

  /** Return the robots that currently accept their command of a role, each with this command. */
  able(wanted) {
    return this.stream.runs.flatMap((_, robot) => {
      const verb = (this.stream.verbs[robot] ?? []).find(({ role }) => role === wanted);
      return verb && this.heeded(robot).has(verb.name) ? [[robot, verb]] : [];
    });
  }

  /** Return the command of a role. */
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

  /** Stop the robot at once, and offer to abort the mission. */
  async halt() {
    const robot = this.stream.chosen;
    await this.stopEach([robot], this.of("hold"), this.of("stop"));
  }

  /** Stop every robot at once, and offer to abort their missions. */
  async haltAll() {
    const all = this.stream.runs.map((_, robot) => robot).filter((robot) => !this.stream.runs[robot].run.ended);
    await this.stopEach(all, true, this.able("stop")[0]?.[1]);
  }

  /** Stop robots, show for each whether it has confirmed the stop, and ask whether to resume their missions. */
  async stopEach(robots, hold, stop) {
    const reason = this.reason.value;
    const holds = new Map(hold ? this.able("hold") : []);
    const lines = robots.map((robot) => {
      const who = this.stream.isTeam ? this.stream.names[robot] : "The robot";
      const line = html("p");
      if (isHeld(this.stream.runs[robot])) say(line, `${who} is paused.`);
      else if (!holds.has(robot)) say(line, `${who} cannot be told to stop. Press the emergency stop on the robot.`);
      else {
        say(line, `${who}: stopping …`);
        this.tell(`${this.addressed(holds.get(robot), robot)} …`, "asked");
        const sent = this.send(holds.get(robot), {}, robot, {});
        sent.then(([text, kind]) => {
          if (kind !== "done") return say(line, `${who} has not confirmed the stop: ${text}. Press the emergency stop on the robot.`);
          say(line, `${who} has been told to stop.`);
          const watch = setInterval(() => {
            if (!line.isConnected) clearInterval(watch);
            else if (isHeld(this.stream.runs[robot])) {
              clearInterval(watch);
              say(line, `${who} has been told to stop. The mission is paused.`);
            }
          }, 200);
        });
        return [line, robot, sent];
      }
      return [line];
    });
    this.reason.value = "";
    const sent = lines.filter(([, , each]) => each);
    if (sent.length) Promise.all(sent.map(([, , each]) => each)).then((answers) => this.tellAll(answers, sent.map(([, robot]) => [robot, holds.get(robot)])));
    if (!stop) return;
    const seen = new Map(this.able("stop").filter(([robot]) => robots.includes(robot)).map(([robot, verb]) => [robot, this.seen(verb, robot)]));
    if (!seen.size) return;
    if (sent.length || lines.length > 1 || isHeld(this.stream.runs[robots[0]])) {
      const isMore = await this.sheet({ title: "Stop", body: lines.map(([line]) => line), no: "Stay paused", yes: `${stop.label}…` });
      if (!isMore) return;
    }
    this.reason.value = reason;
    const all = [...seen.keys()];
    const values = await this.question(stop, all[0], {}, this.stream.isTeam ? all.map((robot) => this.stream.names[robot]).join(", ") : "");
    if (values) this.giveEach(this.able("stop").filter(([robot]) => seen.has(robot)).map(([robot, verb]) => [robot, verb, seen.get(robot)]));
  }

  /** Return the command with a name or a role if the chosen robot currently accepts it. */
  find(wanted) {
    return wanted && this.verbs?.find(({ name, role }) => (name === wanted || role === wanted) && this.now.has(name));
  }

  /** Send a command, after a confirmation if the command requires one; *found* is the detection to which the command refers, *chosen* has further values. */
  async begin(verb, found = "", chosen = {}) {
    if (!verb) return;
    const robot = this.stream.chosen;
    const given = Object.fromEntries(verb.fields.filter(({ kind, optional }) => found && kind === "found" && !optional).map(({ name }) => [name, found]));
    Object.assign(given, chosen);
    const seen = this.seen(verb, robot);
    const known = new Map(this.stream.runs[robot].landmarks);
    const values = verb.fields.length || verb.confirm ? await this.question(verb, robot, given) : {};
    if (values) this.give(verb, values, robot, { ...seen, ...seenLandmarks(verb, values, known, this.stream.runs[robot]) });
  }

  /** Return the objects of a command as the operator sees them; only the run for commands that stop a robot. */
  seen({ name, role }, robot) {
    const { run, objects } = this.stream.runs[robot];
    if (role === "hold") return {};
    return role === "stop" ? { run: run.id ?? "" } : { run: run.id ?? "", object: objects[name] ?? "" };
  }

  /** Disable the confirmation of a dialog if the object of its command has changed since the dialog was opened. */
  expire() {
    if (!this.ask.open || !this.about) return;
    const { verb, robot, seen } = this.about;
    const isOver = JSON.stringify(this.seen(verb, robot)) !== JSON.stringify(seen) || !this.heeded(robot).has(verb.name);
    if (isOver) say(this.expired, "The state has changed since this question was opened. Cancel, and check the state.");
    this.ask.querySelector(".yes").disabled = isOver;
  }

  /** Ask for the values of a command, or for a confirmation; return the values, or null if the user cancels. */
  async question(verb, robot, given, to = this.stream.names[robot]) {
    const run = this.stream.runs[robot];
    const fields = new Map(verb.fields.map((field) => [field.name, this.field(field, run, given[field.name])]));
    offerOnce(verb.fields.filter(({ kind }) => kind === "found").map(({ name }) => fields.get(name)));
    const label = labelOf(verb, run.objects[verb.name]);
    const body = [...(verb.confirm ? [html("p", {}, verb.confirm)] : []), ...verb.fields.map((field) => html("label", {}, `${field.label} `, fields.get(field.name))), this.reasonField()];
    const outline = verb.fields.find(({ kind }) => kind === "polygon")?.name;
    const read = () => Object.fromEntries(verb.fields.map(({ name, kind }) => [name, (READ[kind] ?? String)(fields.get(name).value)]));
    if (fields.has("x") && fields.has("y")) body.push(this.picker(verb, robot, read, "Pick on the map", "Click the position. Escape cancels.", (answer) => this.map.pick(answer), ([x, y]) => ({ x: x.toFixed(2), y: y.toFixed(2) })));
    if (outline) body.push(this.picker(verb, robot, read, "Draw on the map", "Click the corners in order, and the first one again to close the outline. Backspace removes the last corner, Escape cancels.", (answer) => this.map.draw(answer), (corners) => ({ [outline]: corners })));
    const isConfirmed = await this.sheet({ title: this.stream.isTeam && to ? `${label}: ${to}` : label, body, no: "Cancel", yes: label, about: { verb, robot, seen: this.seen(verb, robot) }, first: fields.values().next().value });
    return isConfirmed ? read() : null;
  }

  /** Show a sheet beside the map, without a default button; return whether the user has confirmed it. */
  sheet({ title, body, no, yes, about = null, first = null }) {
    if (this.ask.open) this.ask.close("no");
    this.answered?.(false);
    this.about = about;
    say(this.ask.querySelector("h2"), title);
    say(this.ask.querySelector(".no"), no);
    say(this.ask.querySelector(".yes"), yes);
    say(this.expired, "");
    this.ask.querySelector(".yes").disabled = false;
    this.ask.querySelector("div").replaceChildren(...body);
    this.ask.returnValue = "no";
    this.ask.show();
    (first ?? this.ask).focus({ preventScroll: true });
    this.ask.scrollIntoView({ block: "nearest" });
    return new Promise((answer) => {
      this.answered = (isConfirmed) => {
        this.answered = null;
        answer(isConfirmed);
      };
    });
  }

  /** Return the dialog's field for the reason, which shares its value with the field beside the buttons. */
  reasonField() {
    const field = html("input", { name: "reason", autocomplete: "off", maxlength: 200, value: this.reason.value });
    field.addEventListener("input", () => (this.reason.value = field.value));
    return html("label", {}, "Reason, for the log ", field);
  }

  /** Return a button that hides the dialog while the user picks on the map, and then fills in the result. */
  picker(verb, robot, read, label, request, ask, values) {
    const button = html("button", { type: "button" }, label);
    button.addEventListener("click", () => {
      const said = read();
      const seen = this.about?.seen ?? {};
      const known = new Map(this.stream.runs[robot].landmarks);
      this.ask.close("no");
      this.tell(request, "asked");
      ask(async (picked) => {
        this.tell("");
        if (!picked) return;
        const all = await this.question(verb, robot, { ...said, ...values(picked) });
        if (all) this.give(verb, all, robot, { ...seen, ...seenLandmarks(verb, all, known, this.stream.runs[robot]) });
      });
    });
    return button;
  }

  field({ name, kind, choices, optional, longest }, run, value = "") {
    if (kind === "choice" || kind === "found") {
      const known = kind === "found" ? [...run.landmarks.values()].filter((each) => run.kindOf(each).is_found).map(({ name: each }) => [each, each]) : choices;
      const offered = [["", optional ? "–" : "Choose …"], ...known];
      return html("select", { name, required: !optional }, ...offered.map(([key, label]) => html("option", { value: key, selected: key === value }, label)));
    }
    if (kind === "polygon") return html("input", { name, required: !optional, value: value.length ? JSON.stringify(value) : "", autocomplete: "off", placeholder: "[[x1, y1], [x2, y2], [x3, y3], …]" });
    const numeric = kind === "number" ? { type: "number", step: "any" } : { type: "text", maxlength: longest };
    return html("input", { name, required: !optional, value: value ?? "", autocomplete: "off", ...numeric });
  }

  async give(verb, values, robot, seen) {
    const to = this.addressed(verb, robot);
    this.tell(`${to} …`, "asked");
    const sent = this.send(verb, values, robot, seen);
    this.reason.value = "";
    const [text, kind] = await sent;
    this.tell(`${to}: ${text}`, kind);
  }

  /** Send commands to several robots at once; the responses are shown together. */
  async giveEach(orders) {
    this.tell(`${orders.map(([robot, verb]) => this.addressed(verb, robot)).join("; ")} …`, "asked");
    const sent = orders.map(([robot, verb, seen]) => this.send(verb, {}, robot, seen));
    this.reason.value = "";
    this.tellAll(await Promise.all(sent), orders);
  }

  tellAll(answers, orders) {
    const told = answers.map(([text], index) => `${this.addressed(orders[index][1], orders[index][0])}: ${text}`);
    this.tell(told.join("; "), answers.some(([, kind]) => kind === "trouble") ? "trouble" : "done");
  }

  addressed(verb, robot) {
    return this.stream.isTeam ? `${this.stream.names[robot]}: ${verb.label}` : verb.label;
  }

  /** Send a command; return the response, and whether the command succeeded. */
  async send(verb, values, robot, seen) {
    try {
      const response = await fetch(`orders/${encodeURIComponent(verb.name)}?robot=${robot}`, {
        method: "POST",
        headers: { "Content-Type": "application/json", Authorization: `Bearer ${this.token}`, "X-Operator": encodeURIComponent(this.by.value.trim()), "X-Reason": encodeURIComponent(this.reason.value.trim()), "X-Seen": encodeURIComponent(JSON.stringify(seen)) },
        body: JSON.stringify(values),
        signal: AbortSignal.timeout(ANSWER_MS),
      });
      const { accepted, message } = await response.json();
      if (accepted) return [message || "done", "done"];
      return [response.status >= 500 ? message : `refused: ${message}`, "trouble"];
    } catch (error) {
      return [error.name === "TimeoutError" ? "no response. Check the log for the command" : "the run cannot be reached", "trouble"];
    }
  }

  /** Show the response to a command; the response to a successful command disappears after some time. */
  tell(text, kind = "") {
    clearTimeout(this.fading);
    say(this.answer, text);
    this.answer.dataset.kind = kind;
    if (kind === "done") this.fading = setTimeout(() => this.tell(""), READ_MS);
  }
}

/** Disable in each of the fields what another field has chosen: a detection is no duplicate of itself. */
function offerOnce(fields) {
  const update = () => {
    for (const field of fields) for (const option of field.options) option.disabled = Boolean(option.value) && fields.some((other) => other !== field && other.value === option.value);
  };
  for (const field of fields) field.addEventListener("change", update);
  update();
}

/** Return the shown identity of each landmark that a command's values name, by kind and name; empty if the landmark does not exist. */
function seenLandmarks(verb, values, known, run) {
  const named = verb.fields.filter(({ name, kind, landmark }) => values[name] && (landmark || kind === "found"));
  return Object.fromEntries(named.map(({ name, landmark }) => {
    const found = [...known.entries()].find(([, each]) => each.name === values[name] && (landmark ? each.kind === landmark : run.kindOf(each).is_found));
    return found ? [found[0], found[1].identity] : [`${landmark || "detection"}/${values[name]}`, ""];
  }));
}

/** The label of a command with its object. */
function labelOf({ label, named }, object) {
  return named && object ? named.replace("{}", object) : label;
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

/** Return the stored name of the operator. */
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
    // If the name cannot be stored, the operator enters it again.
  }
}
