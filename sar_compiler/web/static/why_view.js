// The cause of a mission's failure: the likeliest cause, the chain from the root to the results, and a change that would have led to success.

import { clock, html } from "./shapes.js";

// The maximum numbers of later outcomes, and of failed leaves without a failed root, to list.
const SHOWN = 12;

export class WhyView {
  /**
   * @param {HTMLDetailsElement} place the element to show it in.
   * @param {(id: number) => void} [choose] called with the node that the user selects; without this function, nodes are not buttons.
   */
  constructor(place, choose) {
    this.place = place;
    this.choose = choose;
    this.shown = null;
  }

  show({ why, condition }) {
    if (this.shown === why) return;
    this.shown = why;
    this.place.hidden = !why;
    if (!why) return;
    const [summary, rest] = this.place.children;
    const [first] = why.causes;
    summary.replaceChildren("Why: ", html("b", {}, first.name), ` ${said(first)}`);
    const others = why.chain.length ? why.chain : why.causes.slice(0, SHOWN);
    const heading = why.chain.length ? (why.went_on ? "The root failed, and then continued" : "The root has failed") : "Failures, the likeliest cause first";
    rest.replaceChildren(
      ...(condition.reason ? [html("p", {}, condition.reason)] : []),
      html("h2", {}, heading),
      html("ol", {}, ...others.map((each) => this.line(each, `${each.name} ${said(each)}`, each.since?.time, each.place))),
      ...this.otherwise(why.counterfactual),
    );
  }

  otherwise(change) {
    if (!change) return [];
    const { was, instead, then, time, place } = change;
    const words = `${instead.name} ${meant(instead)} instead of ${meant(was)}`;
    const unusual = change.unusual ? `, ${change.unusual} of them unusual` : "";
    const more = then.length > SHOWN ? `, and ${then.length - SHOWN} more` : "";
    const after = then.slice(0, SHOWN).map((each) => `${each.name} ${each.label || each.status}`).join(", ");
    return [
      html("h2", {}, "The mission would have succeeded with another outcome"),
      html("ol", {}, this.line({ ...instead, depth: 0 }, words, time, place), ...(after ? [html("li", {}, `followed by these outcomes${unusual}: ${after}${more}`)] : [])),
    ];
  }

  line({ node, name, depth }, words, time, place) {
    const line = html("li", {}, time === undefined ? "" : html("time", {}, clock(time)), " ", this.name(node, name), words.slice(name.length), place ? html("span", { class: "place", title: place }, `  ${place.split("/").pop()}`) : "");
    line.style.marginLeft = `${1.2 * depth}em`;
    return line;
  }

  name(node, name) {
    if (!this.choose || node === null) return html("b", {}, name);
    const button = html("button", { type: "button" }, name);
    button.addEventListener("click", () => this.choose(node));
    return button;
  }
}

function said({ message, ...answer }) {
  return message ? `${meant(answer)}, ${message}` : meant(answer);
}

/** Return an outcome in words. An empty label means that the leaf has not reported which of its outcomes it returned. */
function meant({ status, label }) {
  return typeof label === "string" ? `${status} (${label || "outcome not reported"})` : status;
}
