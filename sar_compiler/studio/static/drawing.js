// The drawing of the tree, which Python creates. This module adds the selection, drag and drop, and keys.
import { dropPlace, dropSide } from "./places.js";

const SVG = "http://www.w3.org/2000/svg";
const DRAWN = new Set(["svg", "g", "path", "rect", "text", "title"]);
const START_PX = 6;

// Copies the shapes and texts of a drawing, without styles, scripts and links.
function copied(from) {
  const made = document.createElementNS(SVG, from.localName);
  for (const { name, value } of from.attributes) if (/^(class|d|x|y|rx|width|height|viewBox|role|stroke-dasharray)$/.test(name)) made.setAttribute(name, value);
  for (const child of from.childNodes) {
    if (child.nodeType === Node.TEXT_NODE) made.append(child.data);
    else if (DRAWN.has(child.localName)) made.append(copied(child));
  }
  return made;
}

class TreeDrawing extends HTMLElement {
  #zoom = 1;
  #chosen = null;
  // Whether a pointer button is pressed. While it is pressed, the page does not move the nodes.
  isPressed = false;
  #drag = null;
  #pan = null;

  connectedCallback() {
    this.addEventListener("pointerdown", (event) => this.#begin(event));
    this.addEventListener("click", (event) => this.#click(event));
    this.addEventListener("keydown", (event) => this.#key(event));
    document.addEventListener("pointerdown", (event) => (this.isPressed = event.button === 0));
    document.addEventListener("pointermove", (event) => this.#move(event));
    document.addEventListener("pointerup", (event) => this.#drop(event));
    document.addEventListener("pointercancel", () => this.#end());
    this.parentElement.addEventListener("pointerdown", (event) => this.#grab(event));
    this.addEventListener("wheel", (event) => event.ctrlKey && (event.preventDefault(), this.zoom(event.deltaY < 0 ? 1.15 : 1 / 1.15)), { passive: false });
  }

  // Shows a drawing. `nodes` and `places` are the element and the number of each drawn node, `elements` all elements of the file,
  // and `severities` the severity of each element with findings.
  show({ svg, nodes, places, elements }, canHold, isFolded, severities) {
    this.elements = elements;
    this.numbers = nodes;
    this.places = places;
    this.canHold = canHold;
    const drawn = copied(new DOMParser().parseFromString(svg, "image/svg+xml").documentElement);
    drawn.setAttribute("role", "tree");
    this.size = [Number(drawn.getAttribute("width")), Number(drawn.getAttribute("height"))];
    this.nodes = [...drawn.querySelectorAll("g.node")];
    const depth = (number) => (elements[number]?.parent == null ? 0 : 1 + depth(elements[number].parent));
    this.nodes.forEach((node, place) => {
      const number = nodes[place];
      node.setAttribute("role", "treeitem");
      node.setAttribute("aria-label", [...node.querySelectorAll("text")].map((each) => each.textContent).join(", "));
      node.setAttribute("aria-level", Math.max(1, depth(number) - 1));
      node.tabIndex = place ? -1 : 0;
      if (elements[number]?.children.length) node.setAttribute("aria-expanded", !isFolded(number));
      if (severities.has(number)) node.classList.add(severities.get(number));
    });
    const hadFocus = this.contains(document.activeElement);
    this.replaceChildren(drawn);
    this.zoom(1);
    this.flow(this.users);
    this.choose(this.#chosen);
    if (hadFocus) this.nodes.find((node) => node.tabIndex === 0)?.focus({ preventScroll: true });
  }

  zoom(factor) {
    this.#zoom = Math.min(4, Math.max(0.2, this.#zoom * factor));
    const drawn = this.firstElementChild;
    drawn?.setAttribute("width", this.size[0] * this.#zoom);
    drawn?.setAttribute("height", this.size[1] * this.#zoom);
  }

  choose(number, focus = false) {
    this.#chosen = number;
    let first = null;
    this.nodes?.forEach((node, place) => {
      const isChosen = this.numbers[place] === number && number !== null;
      node.classList.toggle("chosen", isChosen);
      node.setAttribute("aria-selected", isChosen);
      if (isChosen) first ??= node;
    });
    if (!first) return;
    this.nodes.forEach((node) => (node.tabIndex = node === first ? 0 : -1));
    this.#reveal(first);
    if (focus) first.focus({ preventScroll: true });
  }

  // Scrolls only the drawing, until a node is visible below the toolbar.
  #reveal(node) {
    const view = this.parentElement;
    const [box, around] = [node, view].map((each) => each.getBoundingClientRect());
    const top = this.previousElementSibling.getBoundingClientRect().bottom;
    const shift = (start, end, first, last) => (start < first ? start - first : Math.max(0, Math.min(end - last, start - first)));
    view.scrollBy(shift(box.left, box.right, around.left, around.left + view.clientWidth), shift(box.top, box.bottom, top, around.top + view.clientHeight));
  }

  // Colours the nodes of an event, from the root to the leaf; returns the element of the leaf.
  walk(event) {
    this.nodes?.forEach((node) => node.classList.remove("way", "success", "failure", "running", "halted"));
    const way = event?.way.map((place) => this.places.indexOf(place)).filter((each) => each >= 0) ?? [];
    way.forEach((each) => this.nodes[each].classList.add("way"));
    const leaf = this.nodes?.[way.at(-1)];
    if (leaf && event.status) leaf.classList.add(event.status);
    return leaf ? this.numbers[way.at(-1)] : null;
  }

  // Marks the elements that write or read a key; `users` are pairs of an element and a kind of access.
  flow(users = []) {
    this.users = users;
    this.nodes?.forEach((node, place) => {
      const kinds = users.filter(([number]) => number === this.numbers[place]).map(([, kind]) => kind);
      node.classList.toggle("writes", kinds.some((kind) => /write|change|both/.test(kind)));
      node.classList.toggle("reads", kinds.length > 0);
    });
  }

  // Returns the next drawn element after the selected element whose texts contain the words; null if there is none.
  find(words) {
    const place = this.numbers.indexOf(this.#chosen) + 1;
    const after = [...this.nodes.slice(place), ...this.nodes.slice(0, place)];
    const found = after.find((node) => this.#number(node) !== null && node.textContent.toLowerCase().includes(words.toLowerCase()));
    return found ? this.#number(found) : null;
  }

  // Starts to drag an element of the drawing, or a node of the palette.
  drag(what, event) {
    this.#drag = { what, x: event.clientX, y: event.clientY, isOn: false };
  }

  #number(node) {
    return this.numbers[this.nodes.indexOf(node)] ?? null;
  }

  #say(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  // Nothing is selected before the button is released, because a selection scrolls the drawing under the pointer.
  #begin(event) {
    const node = event.target.closest("g.node");
    const element = node && this.#number(node);
    if (!event.button && element !== null && this.elements[element].tag !== "BehaviorTree" && event.pointerType !== "touch") this.drag({ element }, event);
  }

  #click(event) {
    const node = event.target.closest("g.node");
    if (node) this.#say("chosen", this.#number(node));
  }

  // Dragging the background with a mouse scrolls the drawing. The browser handles touch itself.
  #grab(event) {
    if (event.button || event.pointerType !== "mouse" || event.target.closest("g.node, button, input, select")) return;
    const { scrollLeft, scrollTop } = this.parentElement;
    this.#pan = { x: event.clientX + scrollLeft, y: event.clientY + scrollTop };
  }

  #move(event) {
    // No event has reported the release of the button, for example over a menu of the browser.
    if (!event.buttons && this.isPressed) this.#end();
    if (this.#pan) this.parentElement.scrollTo(this.#pan.x - event.clientX, this.#pan.y - event.clientY);
    const drag = this.#drag;
    if (!drag || (!drag.isOn && Math.hypot(event.clientX - drag.x, event.clientY - drag.y) < START_PX)) return;
    drag.isOn = true;
    this.classList.add("dragging");
    this.#unmark();
    const node = document.elementFromPoint(event.clientX, event.clientY)?.closest?.("tree-drawing g.node");
    const target = node ? this.#number(node) : null;
    drag.place = null;
    if (target === null || target === drag.what.element) return;
    const box = node.querySelector("path").getBoundingClientRect();
    const siblings = this.elements[this.elements[target].parent]?.children.map((each) => this.nodes[this.numbers.indexOf(each)]).filter(Boolean) ?? [];
    const tops = new Set(siblings.map((each) => Math.round(each.getBoundingClientRect().top)));
    const isBeside = siblings.length > 1 && tops.size === 1;
    const fraction = isBeside ? (event.clientX - box.left) / box.width : (event.clientY - box.top) / box.height;
    const side = dropSide(fraction, this.canHold(target));
    drag.place = dropPlace(this.elements, target, side);
    if (drag.place) this.#mark(node, side, isBeside);
  }

  #mark(node, side, isBeside) {
    if (side === "in") {
      node.classList.add("drop-in");
      return;
    }
    const box = node.querySelector("path").getBBox();
    const mark = document.createElementNS(SVG, "rect");
    const end = side === "after";
    const [x, y, width, height] = isBeside ? [box.x + (end ? box.width + 1 : -5), box.y - 3, 4, box.height + 6] : [box.x, box.y + (end ? box.height + 1 : -5), box.width, 4];
    Object.entries({ x, y, width, height, class: "mark" }).forEach((each) => mark.setAttribute(...each));
    this.firstElementChild.append(mark);
  }

  #unmark() {
    this.querySelectorAll(".mark").forEach((each) => each.remove());
    this.querySelectorAll(".drop-in").forEach((each) => each.classList.remove("drop-in"));
  }

  #drop() {
    const drag = this.#drag;
    this.#end();
    if (drag?.isOn && drag.place) this.#say("dropped", { ...drag.what, ...drag.place });
  }

  #end() {
    this.#drag = this.#pan = null;
    this.isPressed = false;
    this.classList.remove("dragging");
    this.#unmark();
  }

  #key(event) {
    const node = event.target.closest("g.node");
    if (!node) return;
    const place = this.nodes.indexOf(node);
    const element = this.numbers[place];
    if (event.key.startsWith("Arrow")) {
      event.preventDefault();
      if (event.altKey) this.#say("moved", event.key);
      else {
        const next = this.nodes[place + (event.key === "ArrowUp" || event.key === "ArrowLeft" ? -1 : 1)];
        if (next) this.#say("chosen", this.#number(next));
        next?.focus();
      }
    } else if (element !== null) {
      this.#say("key", { key: event.key, ctrl: event.ctrlKey || event.metaKey, prevent: () => event.preventDefault() });
    }
  }
}

customElements.define("tree-drawing", TreeDrawing);
