// The back end of the editor on the site: Python in a worker. It replaces the module of the same name, which queries the server of `sar-compile edit`.
import { sizes } from "./sizes.js";

const EXAMPLES = ["patrol.xml", "doors.xml", "navigate.xml", "delivery.yaml", "search_and_rescue.xml"];
const NEW = { "new.xml": '<root BTCPP_format="4">\n  <BehaviorTree ID="Main"/>\n</root>\n' };
const FORMS = { xml: "tree.xml", yaml: "tree.yaml" };
const total = Object.values(sizes).reduce((sum, each) => sum + each, 0);
const LONG = new Set(["verify", "predict"]);
const pending = new Map();
let worker;
let number = 0;
let opened;
let tellLoading;
let tellState;

function send(question, values, onProgress) {
  return new Promise((resolve) => {
    const message = { number: ++number, question, values };
    pending.set(number, { message, resolve, onProgress });
    worker.postMessage(message);
  });
}

function launch() {
  worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
  worker.onmessage = ({ data: { number: asked, answer, states, loaded, failed } }) => {
    if (failed) tellState(`Python could not be loaded: ${failed}`, true);
    else if (loaded !== undefined) tellLoading(Math.min(1, loaded / total));
    else if (states !== undefined) pending.get(asked)?.onProgress?.(states);
    else {
      pending.get(asked)?.resolve(answer);
      pending.delete(asked);
    }
  };
}

// A worker receives no messages while it computes. To stop a computation, the page ends the worker and sends the file and the open queries to a new worker.
async function stop() {
  worker.terminate();
  const before = [...pending.values()];
  pending.clear();
  launch();
  send("put", opened);
  for (const { message, resolve, onProgress } of before) {
    if (LONG.has(message.question)) resolve({ error: "Stopped" });
    else send(message.question, message.values, onProgress).then(resolve);
  }
}

async function put(name, text) {
  opened = { name, text: text ?? NEW[name] ?? (await (await fetch(`examples/${name}`)).text()) };
  return send("put", opened);
}

// A tree in an address: compressed, and encoded as URL-safe base64.
const through = async (stream, bytes) => new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());

export async function encode(text) {
  const bytes = await through(new CompressionStream("deflate-raw"), new TextEncoder().encode(text));
  return btoa(Array.from(bytes, (each) => String.fromCharCode(each)).join("")).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

export async function decode(text) {
  const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (each) => each.charCodeAt(0));
  return new TextDecoder().decode(await through(new DecompressionStream("deflate-raw"), bytes));
}

const link = async (name, text) => `#${/\.ya?ml$/.test(name) ? "yaml" : "xml"}=${await encode(text)}`;

async function start(onLoading, onState) {
  [tellLoading, tellState] = [onLoading, onState];
  onLoading(0);
  launch();
  const [form, data] = location.hash.slice(1).split("=");
  const text = FORMS[form] && (await decode(data).catch(() => null));
  if (text === null) tellState("The tree in the address cannot be read", true);
  await put(text ? FORMS[form] : EXAMPLES.includes(form) ? form : EXAMPLES[0], text ?? undefined);
  onLoading(1);
}

// A new worker starts with the saved text.
async function ask(question, values, onProgress) {
  if (question === "save") opened = { ...opened, text: values.text };
  return send(question, values, onProgress);
}

export const backend = { ask, start, stop, site: { examples: [...EXAMPLES, ...Object.keys(NEW)], put, link } };
