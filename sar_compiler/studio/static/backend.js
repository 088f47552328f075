// The back end of the page: the server of `sar-compile edit`, whose access token is in the address. The site replaces this module by
// a module that sends the requests to Python in the browser.
const PROGRESS_MS = 500;
const token = location.hash.slice(1);

async function ask(request, values, onProgress) {
  const clock = onProgress && setInterval(async () => onProgress((await ask("progress", { file: values.file })).states), PROGRESS_MS);
  const headers = { "Content-Type": "application/json", Authorization: `Bearer ${token}` };
  const response = await fetch(`ask/${request}`, { method: "POST", headers, body: JSON.stringify(values) }).catch(() => null);
  clearInterval(clock);
  if (!response) return { error: "The server of this page has stopped. Copy your text, then start sar-compile edit again" };
  if (response.status === 403) return { error: "Open the complete address that sar-compile edit has printed" };
  return response.ok ? response.json() : { error: `The server refused the request (${response.status})` };
}

export const backend = { ask, start: async () => {}, stop: (file) => ask("stop", { file }), site: null };
