// A separate thread, so that the page stays responsive while Python computes.
import { start } from "./engine.mjs";
import { loadPyodide } from "./pyodide/pyodide.mjs";

// The number of bytes received so far, for the progress bar. Pyodide fetches its own files.
let loaded = 0;
const fetchFile = self.fetch;
self.fetch = async (...request) => {
  const answer = await fetchFile(...request);
  const counted = new TransformStream({
    transform(part, stream) {
      postMessage({ loaded: (loaded += part.byteLength) });
      stream.enqueue(part);
    },
  });
  return answer.body ? new Response(answer.body.pipeThrough(counted), answer) : answer;
};
const read = async (name) => {
  const answer = await self.fetch(new URL(name, import.meta.url));
  if (!answer.ok) throw new Error(`${name}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
};
const ready = start(loadPyodide, {}, read);
ready.catch((error) => postMessage({ failed: String(error) }));
onmessage = async ({ data: { number, question, values } }) => {
  const answer = await ready.then((ask) => ask(question, values, (states) => postMessage({ number, states }))).catch((error) => ({ error: String(error) }));
  postMessage({ number, answer });
};
