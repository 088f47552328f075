// The operator's orders: a button each, a question where there is something to say or to think over.

import { html, say } from "./shapes.js";

// The server answers within ten seconds.
const ANSWER_MS = 12000;

export class Orders {
  /**
   * @param {{bar: HTMLElement, ask: HTMLDialogElement, answer: HTMLElement}} places
   * @param {(answer: (place: number[] | null) => void) => void} pick has the map asked for a place.
   */
  constructor(places, pick) {
    Object.assign(this, places);
    this.pick = pick;
    this.buttons = new Map();
    // Not a button that submits: Enter in a field would press the first of these.
    this.ask.querySelector(".no").addEventListener("click", () => this.ask.close("no"));
  }

  /** Take the verbs of a run, as the server has them. */
  offer(verbs) {
    this.verbs = verbs;
    this.buttons = new Map(verbs.map((verb) => [verb.name, this.button(verb)]));
    this.bar.replaceChildren(...this.buttons.values());
    this.bar.hidden = !verbs.length;
    this.token = location.hash.slice(1);
    if (verbs.length && !this.token) say(this.answer, "To give orders, open the address that the run has printed.");
  }

  /** Enable those that the tree heeds just now. */
  allow(names, run) {
    this.run = run;
    for (const [name, button] of this.buttons) button.disabled = !this.token || !names.includes(name);
  }

  button(verb) {
    const button = html("button", { type: "button", title: verb.help, class: verb.confirm ? "grave" : "", disabled: true, "data-verb": verb.name }, verb.label);
    button.addEventListener("click", () => this.begin(verb));
    return button;
  }

  async begin(verb) {
    const values = verb.fields.length || verb.confirm ? await this.question(verb, {}) : {};
    if (values) this.give(verb, values);
  }

  question(verb, given) {
    const fields = new Map(verb.fields.map((field) => [field.name, this.field(field, given[field.name])]));
    const [heading, body, yes] = [this.ask.querySelector("h2"), this.ask.querySelector("div"), this.ask.querySelector(".yes")];
    say(heading, verb.label);
    say(yes, verb.label);
    body.replaceChildren(...(verb.confirm ? [html("p", {}, verb.confirm)] : []), ...verb.fields.map((field) => html("label", {}, `${field.label} `, fields.get(field.name))));
    const number = (text) => (text === "" ? null : Number(text));
    const read = () => Object.fromEntries(verb.fields.map(({ name, kind }) => [name, (kind === "number" ? number : String)(fields.get(name).value)]));
    if (fields.has("x") && fields.has("y")) body.append(this.picker(verb, read));
    this.ask.returnValue = "no";
    this.ask.showModal();
    return new Promise((answer) => {
      this.ask.onclose = () => answer(this.ask.returnValue === "yes" ? read() : null);
    });
  }

  picker(verb, read) {
    const button = html("button", { type: "button" }, "Show it on the map");
    button.addEventListener("click", () => {
      const values = read();
      this.ask.close("no");
      document.querySelector('nav [data-view="map"]').click();
      say(this.answer, "Click where it is to be; Escape leaves it.");
      this.pick(async (place) => {
        say(this.answer, "");
        if (!place) return;
        const [x, y] = place;
        const all = await this.question(verb, { ...values, x: x.toFixed(2), y: y.toFixed(2) });
        if (all) this.give(verb, all);
      });
    });
    return button;
  }

  field({ name, kind, choices, optional, longest }, value = "") {
    if (kind === "choice" || kind === "found") {
      const known = kind === "found" ? [...this.run.landmarks.values()].filter((each) => this.run.kindOf(each).is_found).map(({ name: each }) => [each, each]) : choices;
      const offered = optional ? [["", "–"], ...known] : known;
      return html("select", { name, required: !optional }, ...offered.map(([key, label]) => html("option", { value: key, selected: key === value }, label)));
    }
    const numeric = kind === "number" ? { type: "number", step: "any" } : { type: "text", maxlength: longest };
    return html("input", { name, required: !optional, value: kind === "number" && value === "" && !optional ? 0 : value, autocomplete: "off", ...numeric });
  }

  async give(verb, values) {
    say(this.answer, `${verb.label} …`);
    let said;
    try {
      const response = await fetch(`orders/${encodeURIComponent(verb.name)}`, {
        method: "POST",
        headers: { "Content-Type": "application/json", Authorization: `Bearer ${this.token}` },
        body: JSON.stringify(values),
        signal: AbortSignal.timeout(ANSWER_MS),
      });
      const { accepted, message } = await response.json();
      const unanswered = response.status >= 500;
      said = accepted ? message || "done" : unanswered ? message : `refused: ${message}`;
    } catch (error) {
      said = error.name === "TimeoutError" ? "no answer: look at the log whether it was given" : "the run cannot be reached";
    }
    say(this.answer, `${verb.label}: ${said}`);
  }
}
