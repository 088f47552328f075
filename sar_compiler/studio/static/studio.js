// The page. Operations edit the text, and all views are derived from the text.
import { backend } from "./backend.js";
import "./drawing.js";
import { TextEditor } from "./editor.js";
import { keyPlace, resultOf } from "./places.js";

const at = (id) => document.getElementById(id);
const drawing = document.querySelector("tree-drawing");
const analysis = { elements: [], findings: [], keys: {} };
const COMPARE_MS = 2000;
let editor;
let specs = new Map();
let version = "";
let saved = "";
let isSaving = false;
// The selected element of the last analysed text, the changes since that text, and the element to select in the next text.
let chosen = null;
let pending = null;
let next = null;
let shownTree = null;
let walk = { events: [], at: -1 };
let isPlayed = false;
// The chosen outcomes of leaves, by the leaf's name, which may be any string.
const script = Object.create(null);
// The name of the shown file; empty for the file that was opened first.
let file = "";
// The offsets of the elements that are drawn without their children.
let folded = [];

const make = (tag, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
};
const button = (text, onclick, properties = {}) => make("button", { type: "button", textContent: text, onclick, ...properties });
const say = (text, isError = false) => {
  at("state").textContent = text;
  at("state").classList.toggle("error", isError);
};
const ask = (request, values = {}, onProgress = undefined) => backend.ask(request, { file, ...values }, onProgress);
const nameOf = ({ tag, attributes }) => attributes.name ?? attributes.ID ?? tag;
// Returns the spec of an element, which may have the form `<Action ID="Say"/>` instead of `<Say/>`.
const specOf = ({ tag, attributes }) => (attributes.ID && specs.get(attributes.ID)?.kind === tag ? specs.get(attributes.ID) : specs.get(tag));
const canHold = (number) => specOf(analysis.elements[number])?.most !== 0;

// Asks a question in a dialog; returns the entered text or the choice, or an empty string if the user cancels.
function question(text, choices, written = null) {
  at("question").textContent = text;
  at("answer").hidden = written === null;
  at("answer").value = written ?? "";
  at("choices").replaceChildren(...choices.map((each) => make("button", { value: each, textContent: each })));
  at("dialog").returnValue = "";
  at("dialog").showModal();
  return new Promise((resolve) => {
    at("dialog").onclose = () => {
      const choice = at("dialog").returnValue;
      resolve(written === null ? choice : choice === choices[0] ? at("answer").value : "");
    };
  });
}

// Analysis of the current text.
let waiting;
let isLooking = false;
const isDirty = () => editor.text !== saved;

function changed(changes) {
  if (changes) {
    folded = folded.map((offset) => changes.mapPos(offset, 1));
    pending = pending?.compose(changes) ?? changes;
    next = null;
  }
  at("save").disabled = !isDirty();
  clearTimeout(waiting);
  waiting = setTimeout(look, 30);
}

// The numbers of elements belong to the last analysed text. Pressed keys wait until the current text is analysed.
let settling = [];
const settled = () => (analysis.text === editor.text ? Promise.resolve() : new Promise((resolve) => settling.push(resolve)));

async function look() {
  if (isLooking || drawing.isPressed) return changed();
  isLooking = true;
  const text = editor.text;
  const result = await ask("look", { text, tree: shownTree, folded });
  isLooking = false;
  if (text !== editor.text || drawing.isPressed) return changed();
  if (result.error) return say(result.error, true);
  const isSame = analysis.text === text && analysis.tree === result.tree;
  const isSound = Boolean(result.svg);
  const from = chosen && analysis.elements[chosen].from;
  Object.assign(analysis, result, { text, isSound });
  at("picture").classList.toggle("stale", !isSound);
  at("stale").hidden = isSound;
  editor.show(result.findings, (fix) => editor.apply([fix]));
  showFindings();
  for (const each of ["play", "verify", "predict"]) at(each).disabled = !isSound || result.findings.some(({ severity }) => severity === "error");
  if (isSound) {
    drawing.show(result, canHold, isFolded, severities());
    at("tree").replaceChildren(...result.trees.map((each) => make("option", { textContent: each, selected: each === result.tree })));
    const shownKey = at("key").value;
    at("key").replaceChildren(...["", ...Object.keys(result.keys)].map((each) => make("option", { value: each, textContent: each || "none", selected: each === shownKey })));
    drawing.flow(result.keys[at("key").value]);
    at("unfold").disabled = !folded.length;
    if (!file) {
      at("file").replaceChildren(...result.files.map((each, place) => make("option", { value: place ? each : "", textContent: each })));
      at("file").parentElement.hidden = result.files.length < 2;
    }
    if (next === null) choose(from && elementAt(pending?.mapPos(from, 1) ?? from));
    else pick(next, true);
    next = pending = null;
    if (isSame) drawing.walk(walk.events[walk.at]);
    else {
      isPlayed = false;
      begin([]);
    }
  }
  const count = result.findings.length;
  say(count ? `${count} ${count === 1 ? "finding" : "findings"}` : "No findings");
  document.body.classList.add("ready");
  settling.forEach((resolve) => resolve());
  settling = [];
  return undefined;
}

const isFolded = (number) => folded.includes(analysis.elements[number].from);
function fold(number) {
  const { from, children } = analysis.elements[number];
  if (!children.length) return;
  folded = isFolded(number) ? folded.filter((each) => each !== from) : [...folded, from];
  look();
}

const elementAt = (offset) => {
  const after = analysis.elements.findIndex((each) => each.from > offset);
  return (after < 0 ? analysis.elements.length : after) - 1;
};

function severities() {
  const found = new Map();
  for (const each of [...analysis.findings].reverse()) {
    const number = elementAt(each.from);
    if (!each.file && each.severity !== "info" && found.get(number) !== "error") found.set(number, each.severity);
  }
  return found;
}

function showFindings() {
  at("findings").replaceChildren(
    ...analysis.findings.map((each) => {
      const place = each.file ? `${each.file}:${each.line}` : `line ${each.line}`;
      const go = () => {
        if (each.file) return;
        editor.select(each.from, each.to);
        choose(elementAt(each.from));
      };
      const shown = button(`${each.severity}, ${place}: ${each.message}`, go, { className: `to ${each.severity}` });
      if (each.advice) shown.append(" ", make("small", { textContent: each.advice }));
      const item = make("li", {}, shown);
      if (each.fix) item.append(" ", button("Fix", () => editor.apply([each.fix])));
      return item;
    }),
  );
}

// Operations.
async function operate(operation, values, followed = true) {
  const text = editor.text;
  if (text !== analysis.text) return say("The drawing does not show the current text yet. Try again", true);
  if (!analysis.isSound) return say("Correct the text first", true);
  const result = await ask("edit", { text, operation, arguments: values });
  if (result.error) return say(result.error, true);
  if (text !== editor.text) return say("The text has changed during the operation. Try again", true);
  if (!result.edits.length) return undefined;
  editor.apply(result.edits);
  if (followed) next = resultOf(analysis.elements, operation, values);
  return undefined;
}

function insert(spec, place) {
  if (!analysis.isSound) return say("Correct the text first", true);
  const number = chosen ?? analysis.elements.findIndex((each) => each.tag === "BehaviorTree");
  const { parent, index, children, tag } = analysis.elements[number];
  if (at("around").checked && !place && tag !== "BehaviorTree") return operate("wrap", { element: number, tag: spec.tag });
  const inside = { parent: number, index: children?.length ?? 0 };
  return operate("insert", { ...(place ?? (canHold(number) ? inside : { parent, index: index + 1 })), tag: spec.tag });
}

async function newTree(element) {
  const name = await question("Name of the new tree", ["Extract", "Cancel"], nameOf(analysis.elements[element]).replace(/[^\w.-]/g, ""));
  if (name) operate("extract", { element, tree: name });
}

async function rename(element) {
  const { attributes, tag } = analysis.elements[element];
  const key = tag === "BehaviorTree" || tag === "SubTree" ? "ID" : "name";
  const name = await question(key === "ID" ? "New name of the tree" : "New name of the node", ["Rename", "Cancel"], attributes[key] ?? tag);
  if (!name) return;
  if (key === "name") return operate("set_attribute", { element, name: "name", value: name }, false);
  const text = editor.text;
  if (text !== analysis.text) return say("The drawing does not show the current text yet. Try again", true);
  const result = await ask("rename", { text, element, name });
  if (result.error) return say(result.error, true);
  if (text !== editor.text) return say("The text has changed during the operation. Try again", true);
  if (result.edits.length) editor.apply(result.edits);
  return undefined;
}

// The operations and attributes of the selected node.
function choose(number, focus = false) {
  chosen = number !== null && number > 0 ? number : null;
  drawing.choose(chosen, focus);
  const element = analysis.elements[chosen];
  at("chosen").textContent = element ? `<${element.tag}> ${nameOf(element)}` : "No node is selected";
  at("actions").replaceChildren(...(element ? actions(element) : []));
  showForm(element ? fields(element) : []);
  at("scripted").replaceChildren(...(element && specOf(element)?.most === 0 ? [outcomes(nameOf(element))] : []));
}

// Replaces the fields of the form, except the one in which the user is typing.
function showForm(labels) {
  const [shown, made] = [[...at("form").children], labels].map((each) => each.map((label) => label.querySelector("[name]")));
  if (shown.length !== made.length || shown.some((each, place) => each.name !== made[place].name)) at("form").replaceChildren(...labels);
  else shown.forEach((each, place) => (each === document.activeElement ? (each.onchange = made[place].onchange) : each.replaceWith(made[place])));
}

function pick(number, focus = false) {
  next = null;
  choose(number, focus);
  const element = analysis.elements[number];
  if (element && analysis.isSound) editor.select(element.from, element.to);
}

function actions(element) {
  const self = chosen;
  const siblings = analysis.elements[element.parent].children.length;
  const simple = (text, operation) => button(text, () => operate(operation, { element: self }));
  const moved = (text, index, isPossible) => button(text, () => operate("move", { element: self, parent: element.parent, index }), { disabled: !isPossible });
  const isTree = element.tag === "BehaviorTree";
  return [
    moved("Up", element.index - 1, element.index > 0),
    moved("Down", element.index + 2, element.index + 1 < siblings),
    simple("Duplicate", "duplicate"),
    ...(element.children.length && !isTree ? [simple("Unwrap", "unwrap")] : []),
    ...(isTree ? [] : [button("Extract…", () => newTree(self))]),
    ...(analysis.trees.includes(element.attributes.ID) && !isTree ? [button("Show the tree", () => showTree(element.attributes.ID)), simple("Inline", "inline")] : []),
    ...(element.children.length ? [button(isFolded(self) ? "Unfold" : "Fold", () => fold(self))] : []),
    button("Rename…", () => rename(self)),
    simple("Delete", "delete"),
  ];
}

function fields(element) {
  const self = chosen;
  const declared = specOf(element)?.attributes ?? [];
  const others = Object.keys(element.attributes).filter((name) => !declared.some((each) => each.name === name));
  return [...declared, ...others.map((name) => ({ name, doc: "", choices: [] }))].map((each) => {
    const value = element.attributes[each.name] ?? "";
    const field = each.choices?.length && !value.includes("{") ? choice(each, value) : make("input", { value });
    const list = make("datalist", { id: `values-of-${each.name}` }, ...suggested(each, element).map((value) => make("option", { value })));
    if (list.options.length) field.setAttribute("list", list.id);
    field.name = each.name;
    field.required = Boolean(each.required);
    field.onchange = () => operate("set_attribute", { element: self, name: each.name, value: field.value === "" ? null : field.value }, false);
    return make("label", { title: each.doc }, make("span", { textContent: each.required ? `${each.name} (required)` : each.name }), field, list, make("small", { textContent: each.doc }));
  });
}

// Returns the values to suggest: trees for a subtree, nodes for a reference to a node, keys for a port.
function suggested({ name, takes_key, is_reference }, { tag }) {
  if (tag === "SubTree" && name === "ID") return analysis.trees;
  if (is_reference) return analysis.elements.filter(specOf).map(nameOf);
  return takes_key ? Object.keys(analysis.keys).map((each) => `{${each}}`) : [];
}

const choice = ({ choices }, value) =>
  make("select", {}, ...["", ...new Set([...choices, ...(value ? [value] : [])])].map((each) => make("option", { value: each, textContent: each, selected: each === value })));

// Palette.
function showPalette() {
  const sought = at("search").value.toLowerCase();
  const all = [...specs.values()];
  const named = all.filter((each) => each.tag.toLowerCase().includes(sought));
  const found = named.length ? named : all.filter((each) => each.doc.toLowerCase().includes(sought));
  const listed = ["Control", "Decorator", "Condition", "Action"].flatMap((kind) => {
    const nodes = found.filter((each) => each.kind === kind);
    return nodes.length ? [make("li", { className: "kind", textContent: `${kind}s` }), ...nodes.map(paletteItem)] : [];
  });
  at("specs").replaceChildren(...listed);
}

function paletteItem(spec) {
  const describe = () => (at("doc").textContent = `${spec.tag} (${spec.kind}): ${spec.doc}`);
  const made = button(spec.tag, () => insert(spec), { onfocus: describe, onpointerenter: describe });
  made.onpointerdown = (event) => drawing.drag({ spec }, event);
  return make("li", {}, made);
}

function showTree(tree) {
  shownTree = tree;
  look();
}

// Runs.
function begin(ticks, loop = 0) {
  const events = ticks.flatMap((tick, number) =>
    tick.events.map((event, place) => ({ ...event, ...tick, tick: number + 1, isLast: place === tick.events.length - 1, isLoop: number >= ticks.length - loop })),
  );
  walk = { events, at: events.length ? 0 : -1 };
  showStep();
}

function showStep() {
  const event = walk.events[walk.at];
  const number = drawing.walk(event);
  const last = event?.isLast && event.root ? ` (root: ${event.root})` : "";
  at("step").textContent = event ? `tick ${event.tick}${event.isLoop ? ", repeated forever" : ""}: ${event.leaf} ${event.does}${last}` : "";
  if (event && number !== null) pick(number);
  const values = Object.entries(event?.values ?? {});
  at("values").replaceChildren(
    ...values.map(([name, value]) => make("tr", { className: event.changed.includes(name) ? "changed" : "" }, make("td", { textContent: name }), make("td", { textContent: value }))),
  );
  at("record").disabled = !isPlayed;
  at("back").disabled = walk.at <= 0;
  at("next").disabled = walk.at >= walk.events.length - 1;
}

function outcomes(leaf) {
  const field = make("input", { value: script[leaf]?.join(", ") ?? "" });
  field.onchange = () => {
    const listed = field.value.split(",").map((each) => each.trim()).filter(Boolean);
    if (listed.length) script[leaf] = listed;
    else delete script[leaf];
  };
  return make("label", {}, `Outcomes of ${leaf} in the next run, in order, separated by commas `, field);
}

async function run(what, values) {
  const started = performance.now();
  let states = 0;
  const tell = () => say(`${what === "play" ? "Running" : "Exploring all runs"}: ${states ? `${states} states, ` : ""}${Math.round((performance.now() - started) / 1000)} s`);
  const clock = setInterval(tell, 500);
  tell();
  at("stop").hidden = what === "play";
  const result = await ask(what, { text: editor.text, tree: shownTree, ...values }, what === "play" ? undefined : (count) => (states = count));
  clearInterval(clock);
  at("stop").hidden = true;
  if (result.error) say(result.error, true);
  isPlayed = what === "play" && !result.error;
  at("verdicts").replaceChildren();
  at("prediction").hidden = true;
  return result.error ? null : result;
}

async function verify() {
  const result = await run("verify", {});
  if (!result) return;
  say(`${result.states} states${result.complete ? "" : ", not all explored"}${result.stopped && " (stopped)"}`);
  at("verdicts").replaceChildren(
    ...result.verdicts.map((each) => {
      const made = make("li", { className: each.verdict === "proved" ? "yes" : "no" }, `${each.question}: ${each.verdict} `);
      if (each.run) made.append(button("Step through", () => begin(each.run.ticks, each.loop)));
      return made;
    }),
  );
  begin([]);
}

async function predict() {
  const result = await run("predict", {});
  if (!result) return;
  say(result.stopped ? "The prediction uses only a part of the runs (stopped)" : "The prediction is complete");
  at("prediction").textContent = result.text;
  at("prediction").hidden = false;
  begin([]);
}

async function play() {
  const names = new Set(analysis.elements.map(nameOf));
  const leaves = Object.fromEntries(Object.entries(script).filter(([name]) => names.has(name)));
  const result = await run("play", { ticks: Number(at("ticks").value), leaves });
  if (!result) return;
  say(`${result.ticks.length} ticks`);
  begin(result.ticks);
}

async function record() {
  const name = await question("Name of the scenario file", ["Save", "Cancel"], `${at("name").textContent.replace(/\.\w+$/, "")}.scenario.yaml`);
  if (!name) return;
  const result = await ask("record", { name });
  if (result.error) return say(result.error, true);
  if (backend.site) download(result);
  say(`Saved as ${result.name}`);
}

// The file.
function download({ name, text }) {
  const href = URL.createObjectURL(new Blob([text]));
  make("a", { href, download: name }).click();
  URL.revokeObjectURL(href);
}

async function load() {
  const result = await ask("open");
  if (result.error) return say(result.error, true);
  ({ version } = result);
  document.title = at("name").textContent = result.name;
  editor ??= new TextEditor(at("text").appendChild(make("div")), {
    onChange: changed,
    onSelect: (offset) => choose(elementAt(offset)),
  });
  editor.open(result.text, result.form);
  saved = editor.text;
  next = chosen = pending = shownTree = null;
  folded = [];
  const listed = await ask("palette", { text: result.text });
  specs = new Map((listed.nodes ?? []).map((each) => [each.tag, each]));
  showPalette();
  return look();
}

// Saves or discards the current text as the user decides, and loads another file unless the user cancels.
async function leave(prepare) {
  const answer = isDirty() ? await question("Save the text before you leave this file?", ["Save", "Discard", "Cancel"]) : "Discard";
  if (answer === "Save") await save();
  const isLeft = answer === "Discard" || (answer === "Save" && !isDirty());
  if (isLeft) {
    await prepare();
    await load();
  }
  return isLeft;
}

async function save(overwrite = false) {
  const text = editor.text;
  isSaving = true;
  const result = await ask("save", { text, version, overwrite });
  isSaving = false;
  if (result.error) return say(result.error, true);
  if (result.has_changed) {
    const answer = await question("Another program has changed the file since you opened it. Overwrite it?", ["Overwrite", "Reload the file", "Cancel"]);
    if (answer === "Overwrite") await save(true);
    if (answer === "Reload the file") await load();
    return;
  }
  version = result.version;
  saved = text;
  at("save").disabled = !isDirty();
  if (backend.site) download({ name: at("name").textContent, text });
  say("Saved");
}

async function compare() {
  if (!editor || document.hidden || isLooking || isSaving) return;
  const compared = version;
  const result = await ask("compare", { version });
  if (result.others_have_changed) await look();
  // If the page itself has saved the file since, the difference is not a change by another program.
  if (!result.has_changed || isSaving || version !== compared) return;
  if (!isDirty()) await load();
  else say("Another program has changed the file. You can overwrite or reload it when you save", true);
}

const onChosen = async (work) => {
  await settled();
  if (chosen !== null) work(chosen);
};
const keys = {
  Delete: (element) => operate("delete", { element }),
  F2: rename,
  Enter: () => at("form").querySelector("input, select")?.focus(),
  i: () => at("search").focus(),
  o: (element) => analysis.trees.includes(analysis.elements[element].attributes.ID) && showTree(analysis.elements[element].attributes.ID),
  " ": fold,
  "/": () => at("find").focus(),
};
drawing.addEventListener("chosen", ({ detail }) => pick(detail));
drawing.addEventListener("dropped", ({ detail: { element, spec, parent, index } }) =>
  spec ? insert(spec, { parent, index }) : operate("move", { element, parent, index }),
);
drawing.addEventListener("moved", ({ detail: key }) =>
  onChosen((element) => {
    const place = keyPlace(analysis.elements, element, key);
    if (place) operate("move", { element, ...place });
  }),
);
drawing.addEventListener("key", ({ detail: { key, ctrl, prevent } }) => {
  if (ctrl && key === "d") {
    prevent();
    onChosen((element) => operate("duplicate", { element }));
  } else if (ctrl && /^[zy]$/i.test(key)) {
    prevent();
    if (key === "z") editor.undo();
    else editor.redo();
  } else if (!ctrl && keys[key]) {
    prevent();
    onChosen(keys[key]);
  }
});
document.addEventListener("keydown", (event) => {
  if ((event.ctrlKey || event.metaKey) && event.key === "s") {
    event.preventDefault();
    save();
  }
});
at("tree").onchange = () => showTree(at("tree").value);
at("file").onchange = async () => {
  const next = at("file").value;
  if (!(await leave(() => (file = next)))) at("file").value = file;
};
at("find").onkeydown = (event) => {
  if (event.key !== "Enter" || !at("find").value) return;
  const found = drawing.find(at("find").value);
  if (found === null) say(`No drawn node contains '${at("find").value}'`, true);
  else pick(found);
};
at("key").onchange = () => drawing.flow(analysis.keys[at("key").value]);
at("export").onclick = async () => {
  const result = await ask("export", { text: editor.text, tree: shownTree });
  if (result.error) say(result.error, true);
  else download(result);
};
at("form").onsubmit = (event) => event.preventDefault();
at("search").oninput = showPalette;
const clicks = {
  undo: () => editor.undo(), redo: () => editor.redo(), save: () => save(), play, verify, predict, record, stop: () => backend.stop(file),
  back: () => (walk.at--, showStep()), next: () => (walk.at++, showStep()), smaller: () => drawing.zoom(1 / 1.25), larger: () => drawing.zoom(1.25),
  unfold: () => ((folded = []), look()),
};
Object.entries(clicks).forEach(([id, work]) => (at(id).onclick = work));
window.addEventListener("focus", compare);
if (!backend.site) setInterval(compare, COMPARE_MS);
window.addEventListener("beforeunload", (event) => editor && isDirty() && event.preventDefault());
// The interface for tests and browser extensions: the text, the selected node, and the replacement of a part of the text.
window.studio = {
  text: () => editor.text,
  chosen: () => chosen,
  isSettled: () => analysis.text === editor.text,
  replace: (part, insert) => {
    const from = editor.text.indexOf(part);
    editor.apply([{ from, to: from + part.length, insert }]);
  },
  saved: () => (saved = editor.text),
};

async function openSite({ examples, put, link }) {
  at("site").hidden = false;
  at("example").replaceChildren(...["", ...examples].map((each) => make("option", { value: each, textContent: each || "choose" })));
  at("example").onchange = () => at("example").value && leave(() => put(at("example").value));
  at("pick").onclick = () => at("picked").click();
  at("picked").onchange = async () => {
    const [picked] = at("picked").files;
    const text = await picked?.text();
    if (picked) await leave(() => put(picked.name, text));
  };
  window.addEventListener("hashchange", () => location.reload());
  at("link").onclick = async () => {
    history.replaceState(null, "", await link(at("name").textContent, editor.text));
    await navigator.clipboard.writeText(location.href).catch(() => {});
    say("The address of this page now contains the tree, and was copied");
  };
}

if (backend.site) openSite(backend.site);
await backend.start((share) => {
  at("loading").hidden = share >= 1;
  at("loading").value = share;
  say("Python is being loaded");
}, say);
load();
