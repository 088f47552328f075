"""Tests of the built site in a browser: size of the first page, search over HTTP and from a folder, links and pictures."""

import functools
import http.server
import re
import subprocess
import threading
from pathlib import Path

import pytest

from tests.docs.test_site_search import FOUND, QUESTIONS
from tests.packaging.conftest import made_once
from tests.processes import BIN
from tests.web.browsers import open_browser

pytestmark = pytest.mark.costly

FIRST_PAGE_KB = 700
# Long enough while other tests use the processor.
_BUILT_SEC = 300
_PAGES_SEC = 300
OPEN_SEARCH = "document.querySelector('label[for=__search], .md-search button, .md-search').click()"
COLLECT = """
const [pages, done] = arguments;
const found = {links: {}, broken: [], ids: {}};
async function visit(page) {
  const frame = document.createElement("iframe");
  frame.sandbox = "allow-same-origin";
  frame.style.width = "800px";
  frame.src = page;
  await new Promise((loaded) => { frame.onload = loaded; document.body.append(frame); });
  const inside = frame.contentDocument;
  found.links[page] = [...inside.querySelectorAll("a[href], link[href], script[src], iframe[src]")].map((each) => each.href || each.src);
  found.ids[page] = [...inside.querySelectorAll("[id], a[name]")].map((each) => each.id || each.name);
  for (const image of inside.images) {
    image.loading = "eager";
    if (!image.complete) await new Promise((ended) => { image.onload = image.onerror = ended; });
    if (!image.naturalWidth) found.broken.push([page, image.src]);
  }
  frame.remove();
}
const left = [...pages];
Promise.all([1, 2, 3, 4].map(async () => { while (left.length) await visit(left.pop()); })).then(() => done(found), (error) => done(`${error}`));
"""
"""A script that opens each page in a frame without scripts, and collects its links, anchors and broken pictures."""


def build(folder):
    """Build the site in a folder, without the editor."""
    folder.mkdir()
    settings = Path("mkdocs.yml").read_text(encoding="utf-8")
    for name in ("pages", "site"):
        settings = settings.replace(f"build/{name}", name)
    settings = settings.replace("paths: [.]", f"paths: [{Path.cwd()}]")
    (folder / "mkdocs.yml").write_text(settings, encoding="utf-8")
    for command in (
        [BIN / "python", "docs/site/pages.py", folder / "pages"],
        [BIN / "zensical", "build", "--strict", "--clean", "-f", folder / "mkdocs.yml"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_BUILT_SEC)
        assert done.returncode == 0, done.stdout + done.stderr
    index = (folder / "site/search.json").read_text(encoding="utf-8")
    (folder / "site/search.js").write_text(f"__index = {index}", encoding="utf-8")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    return made_once(tmp_path_factory, "built-site", build) / "site"


@pytest.fixture(scope="module")
def site_server(site):
    """Serve the site; return its address and the requested paths with the bytes that were sent."""
    sent = []

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

        def copyfile(self, source, outputfile):
            data = source.read()
            sent.append((self.path, len(data)))
            outputfile.write(data)

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/", sent
    server.shutdown()


@pytest.fixture(scope="module")
def browser():
    with open_browser(
        "--allow-file-access-from-files", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
    ) as opened:
        opened.driver.set_script_timeout(_PAGES_SEC)
        yield opened


def results(browser, question):
    """Type a question into the open search; return the pages of its results, the first one first."""
    script = """
        const root = [...document.body.children].map((each) => each.shadowRoot).find(Boolean) ?? document;
        const input = root.querySelector("input");
        if (!input) return null;
        if (arguments[0] !== null && input.value !== arguments[0]) {
          input.value = arguments[0];
          input.dispatchEvent(new Event("input", {bubbles: true}));
        }
        return [...root.querySelectorAll("a[href]")].map((each) => each.href);
    """
    seen: list[list[str]] = [[]]

    def is_there():
        found = browser.js(script, question)
        settled, seen[0] = found == seen[0] and bool(found), found or []
        return settled

    browser.wait(is_there, f"results for '{question}'")
    return list(
        dict.fromkeys(re.sub(r"[?#].*", "", each).replace("/index.html", "/README.html") for each in seen[0])
    )


@pytest.mark.parametrize("way", ["served", "folder"])
def test_search_loads_on_first_use_and_finds_pages(way, site, site_server, browser):
    address, sent = site_server
    base = address if way == "served" else f"{site.as_uri()}/"
    browser.forget()
    sent.clear()
    browser.driver.get(f"{base}index.html")
    browser.wait(
        lambda: browser.js("return document.documentElement.classList.contains('js')"), "the theme's script"
    )
    if way == "served":
        assert "/search.json" not in {path for path, _ in sent}
        assert sum(size for _, size in sent) <= FIRST_PAGE_KB * 1000, sent
    browser.js(OPEN_SEARCH)
    right = []
    for question, pages in QUESTIONS.items():
        found = [each.removeprefix(base).removesuffix(".html") for each in results(browser, question)]
        assert [each for each in found if each.endswith((".py", ".xml", ".yaml"))] == []
        right.append(bool({*pages} & {*found[:3]}))
    assert sum(right) >= FOUND


def test_every_link_and_picture_works_without_a_server(site, browser):
    base = f"{site.as_uri()}/"
    # A server shows 404.html below any address, so its links are absolute.
    pages = sorted({path.as_uri() for path in site.rglob("*.html")} - {f"{base}404.html"})
    browser.driver.get(f"{base}index.html")
    found = browser.driver.execute_async_script(COLLECT, pages)
    assert found["broken"] == []
    links = {(page, link) for page, links in found["links"].items() for link in links}
    elsewhere = ("https:", "http:", "mailto:")
    dead = [
        each
        for each in links
        if not each[1].startswith(elsewhere) and not is_there(each[1], base, site, found["ids"])
    ]
    assert dead == []


def is_there(link, base, site, ids):
    """Return whether the file of a link is in the site, and its anchor in the file. The editor is built separately."""
    path, _, anchor = link.partition("#")
    name = path.partition("?")[0].removeprefix(base)
    return name.startswith("studio/") or (
        (site / name).is_file() and anchor in ("", *ids.get(path, [anchor]))
    )


def test_no_page_loads_external_resources(site):
    asked = re.compile(
        r'<(?:script|img|iframe|source)[^>]+src="(https?:)?//|<link[^>]+rel="(?:stylesheet|preload|preconnect|icon)"[^>]+href="(https?:)?//'
    )
    assert [path for path in site.rglob("*.html") if asked.search(path.read_text(encoding="utf-8"))] == []
