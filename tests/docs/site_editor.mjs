// Python as the site's editor starts it, in node: node site_editor.mjs FOLDER QUESTIONS; prints the answers to a JSON list of questions with values.
import fs from "node:fs/promises";
import path from "node:path";
import { pathToFileURL } from "node:url";

const [folder, questions] = process.argv.slice(2);
const { start } = await import(pathToFileURL(path.join(folder, "engine.mjs")).href);
const { loadPyodide } = await import(pathToFileURL(path.join(folder, "pyodide/pyodide.mjs")).href);
const ask = await start(loadPyodide, {}, (name) => fs.readFile(path.join(folder, name)));
const states = [];
const answers = JSON.parse(questions).map(([question, values]) => ask(question, values, (found) => states.push(found)));
console.log(JSON.stringify({ answers, states }));
