// The playground's Python as the page starts it, in node: node playground.mjs FOLDER TREE…; prints what is said of each tree, as JSON.
import fs from "node:fs/promises";
import path from "node:path";
import { pathToFileURL } from "node:url";

const [folder, ...trees] = process.argv.slice(2);
const { start } = await import(pathToFileURL(path.join(folder, "engine.mjs")).href);
const { loadPyodide } = await import(pathToFileURL(path.join(folder, "pyodide/pyodide.mjs")).href);
const ask = await start(loadPyodide, {}, (name) => fs.readFile(path.join(folder, name)));
const told = [];
for (const tree of trees) {
  const text = await fs.readFile(tree, "utf8");
  const looked = ask("look", text);
  told.push({ ...looked, ...(looked.svg && { proof: ask("prove", text), run: ask("play", text) }) });
}
console.log(JSON.stringify(told));
