// The back end of the page: the server of `sar-compile edit`, whose access token is in the address. The site replaces this module by
// one that queries Python in the browser.
const PROGRESS_MS = 500;
const token = location.hash.slice(1);

async function ask(question, values, onProgress) {
  const clock = onProgress && setInterval(async () => onProgress((await ask("progress", { file: values.file })).states), PROGRESS_MS);
  const headers = { "Content-Type": "application/json", Authorization: `Bearer ${token}` };
  const answer = await fetch(`ask/${question}`, { method: "POST", headers, body: JSON.stringify(values) }).catch(() => null);
  clearInterval(clock);
  if (!answer) return { error: "The program that serves this page has ended. Copy your text, and start it again" };
  if (answer.status === 403) return { error: "Open the complete address that sar-compile edit has printed" };
  return answer.ok ? answer.json() : { error: `The server refused the question (${answer.status})` };
}

export const backend = { ask, start: async () => {}, stop: (file) => ask("stop", { file }), site: null };
