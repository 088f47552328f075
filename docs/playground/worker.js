// A thread of its own, so that the page goes on while Python computes.
import { start } from "./engine.mjs";
import { loadPyodide } from "./pyodide/pyodide.mjs";

const read = async (name) => {
  const answer = await fetch(new URL(name, import.meta.url));
  if (!answer.ok) throw new Error(`${name}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
};
const ready = start(loadPyodide, {}, read);
ready.then(() => postMessage({ what: "ready" }), (error) => postMessage({ what: "failed", told: String(error) }));
onmessage = async ({ data: { what, text, number } }) => {
  try {
    postMessage({ what, number, told: (await ready)(what, text) });
  } catch (error) {
    postMessage({ what: "failed", number, told: String(error) });
  }
};
