// Loaded before the theme's script. Over HTTP, the index of the search (1.2 MB) is fetched when the search is first used. If the site is opened from a
// folder, a browser does not start workers or fetch files. In this case, the worker's code runs in a frame, and the index is a script (`search.js`).
(() => {
  const used = new Promise((resolve) => {
    const isSearch = (event) => event.target.closest?.(".md-search, [for=__search], [data-md-toggle=search]");
    for (const kind of ["pointerover", "pointerdown", "focusin", "change"])
      addEventListener(kind, (event) => isSearch(event) && resolve(), true);
    addEventListener("keydown", (event) => "fs/k".includes(event.key.toLowerCase()) && resolve(), true);
    if (new URLSearchParams(location.search).has("h")) resolve(); // the page is a search result with highlighted words
  });
  const { open, send } = XMLHttpRequest.prototype;
  XMLHttpRequest.prototype.open = function (method, url, ...rest) {
    this.waits = /\/search\.json$/.test(url);
    return open.call(this, method, url, ...rest);
  };
  XMLHttpRequest.prototype.send = function (body) {
    if (this.waits) used.then(() => send.call(this, body));
    else send.call(this, body);
  };
  if (location.protocol !== "file:") return;
  const append = document.head.appendChild;
  document.head.appendChild = function (node) {
    if (/\/search\.js$/.test(node.src)) used.then(() => append.call(this, node));
    else append.call(this, node);
    return node;
  };
  window.Worker = class {
    constructor(url) {
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.append(this.frame);
      const inside = this.frame.contentWindow;
      inside.document.open();
      inside.document.write("<!doctype html><title>search</title>");
      inside.document.close();
      inside.postMessage = (data) => this.onmessage?.({ data });
      const script = inside.document.createElement("script");
      script.src = new URL(url, location.href);
      this.started = new Promise((resolve, reject) => Object.assign(script, { onload: resolve, onerror: reject }));
      this.started.catch((error) => this.onerror?.(error));
      inside.document.head.append(script);
    }
    postMessage(data) {
      this.started.then(() => this.frame.contentWindow.onmessage({ data: structuredClone(data) }));
    }
    terminate() {
      this.frame.remove();
    }
  };
})();
