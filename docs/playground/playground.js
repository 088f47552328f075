// The page: what is typed goes to Python, and what Python says comes back; a run is walked through event by event.
const element = (id) => document.getElementById(id);
const tree = element("tree");
const worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
let asked = 0;
let walk = { events: [], at: -1 };

const ask = (what) => {
  worker.postMessage({ what, text: tree.value, number: ++asked });
  element("state").textContent = "…";
};

const item = (text, kind = "") => {
  const made = document.createElement("li");
  made.textContent = text;
  made.className = kind;
  return made;
};

const enable = (isReady) => ["prove", "play"].forEach((id) => (element(id).disabled = !isReady));

function show() {
  const event = walk.events[walk.at];
  const nodes = [...document.querySelectorAll("#picture g.node")];
  nodes.forEach((node) => node.classList.remove("way", "success", "failure", "running", "halted"));
  if (event) {
    event.way.forEach((number) => nodes[number]?.classList.add("way"));
    const leaf = nodes[event.way.at(-1)];
    if (leaf && event.status) leaf.classList.add(event.status);
    const last = event.isLast && event.root ? `; root ${event.root}` : "";
    element("step").textContent = `tick ${event.tick}${event.isLoop ? ", again and again" : ""}: ${event.leaf} ${event.does}${last}`;
  } else {
    element("step").textContent = "";
  }
  element("back").disabled = walk.at <= 0;
  element("next").disabled = walk.at >= walk.events.length - 1;
}

function begin(ticks, loop = 0) {
  const events = ticks.flatMap((tick, number) =>
    tick.events.map((event, place) => ({
      ...event,
      tick: number + 1,
      root: tick.root,
      isLast: place === tick.events.length - 1,
      isLoop: number >= ticks.length - loop,
    })),
  );
  walk = { events, at: events.length ? 0 : -1 };
  show();
}

const told = {
  look({ findings, svg }) {
    element("findings").replaceChildren(
      ...findings.map((each) => {
        const meant = each.suggestion ? ` Did you mean ${each.suggestion}?` : "";
        return item(`${each.line}:${each.column} ${each.severity}: ${each.message}${meant} [${each.code}]`, each.severity);
      }),
    );
    element("state").textContent = findings.length ? `${findings.length} to look at` : "no findings";
    // Made by the package from the tree, with all names escaped.
    element("picture").innerHTML = svg;
    element("verdicts").replaceChildren();
    begin([]);
    enable(svg !== "" && findings.every((each) => each.severity !== "error"));
  },
  prove({ error, states, complete, verdicts = [] }) {
    element("state").textContent = error ?? `${states} states${complete ? "" : ", and there are more"}`;
    element("verdicts").replaceChildren(
      ...verdicts.map((each) => {
        const made = item(`${each.question}: ${each.verdict} `, each.verdict === "proved" ? "yes" : "no");
        if (each.ticks.length) {
          const button = document.createElement("button");
          button.textContent = "Walk";
          button.onclick = () => begin(each.ticks, each.loop);
          made.append(button);
        }
        return made;
      }),
    );
    begin([]);
  },
  play({ error, ticks = [] }) {
    element("state").textContent = error ?? `${ticks.length} ticks, with the usual answers`;
    begin(ticks);
  },
};

worker.onmessage = ({ data }) => {
  if (data.what === "ready") ask("look");
  else if (data.what === "failed") element("state").textContent = data.told;
  else if (data.number === asked) told[data.what](data.told);
};
let waiting;
tree.oninput = () => {
  clearTimeout(waiting);
  waiting = setTimeout(() => ask("look"), 300);
};
element("prove").onclick = () => ask("prove");
element("play").onclick = () => ask("play");
element("back").onclick = () => (walk.at--, show());
element("next").onclick = () => (walk.at++, show());
