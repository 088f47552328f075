"""Tests of the editor on the site: its Python in node, and its page in a browser."""

import functools
import http.server
import json
import runpy
import shutil
import subprocess
import threading
from pathlib import Path
from typing import Any

import pytest

from tests.packaging.conftest import made_once
from tests.web.browsers import open_browser

BACKEND = Path("docs/studio")
ENGINE = runpy.run_path(str(BACKEND / "site_engine.py"))
SHIPPED = Path("trees/search_and_rescue.xml")
TEXT = SHIPPED.read_text(encoding="utf-8")
EXAMPLES = sorted(BACKEND.glob("examples/*.*"))
# The page loads Python while other tests use the processor.
_LOADED_SEC = 180


def answers(*questions):
    """Send requests to the site's Python code in this process; return the answers, and the reported numbers of states."""
    engine = ENGINE["SiteStudio"]()
    states: list[int] = []
    asked = [json.loads(engine.answer(name, json.dumps(values), states.append)) for name, values in questions]
    return asked, states


def put_question(path):
    return "put", {"name": path.name, "text": path.read_text(encoding="utf-8")}


def test_each_example_has_no_findings_and_a_complete_proof():
    assert len(EXAMPLES) == 4  # and the shipped tree
    assert f'"{SHIPPED.name}"' in (BACKEND / "backend.js").read_text(encoding="utf-8")
    for path in EXAMPLES:
        assert f'"{path.name}"' in (BACKEND / "backend.js").read_text(encoding="utf-8")
        opened, values = put_question(path), {"text": path.read_text(encoding="utf-8")}
        (_, looked, proof), _ = answers(opened, ("look", values), ("verify", values))
        assert (looked["findings"], proof["complete"]) == ([], True), path


def test_first_example_has_a_counterexample():
    path = BACKEND / "examples/patrol.xml"
    (_, proof), _ = answers(put_question(path), ("verify", {"text": path.read_text(encoding="utf-8")}))
    assert any(each["run"] and each["loop"] for each in proof["verdicts"])


def test_text_with_any_characters_and_line_ends_is_opened_unchanged():
    text = TEXT.replace("Search and rescue:", "\U0001f600 ä:").replace("\n", "\r\n", 3)
    (_, opened), _ = answers(("put", {"name": "../mine.xml", "text": text}), ("open", {}))
    assert (opened["text"], opened["name"]) == (text, "mine.xml")


_LINK = """
globalThis.Worker = class {};
const { decode, encode } = await import(`data:text/javascript,${encodeURIComponent(process.argv[1])}`);
console.log(JSON.stringify([await encode(process.argv[2]), await decode(await encode(process.argv[2]))]));
"""


def test_tree_in_link_is_decoded_unchanged():
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node here (apt install nodejs)")
    module = (
        (BACKEND / "backend.js")
        .read_text(encoding="utf-8")
        .replace('import { sizes } from "./sizes.js";', "const sizes = {};")
    )
    text = TEXT.replace("Search and rescue:", "\U0001f600 ä:")
    command = (node, "--input-type=module", "-e", _LINK, module, text)
    encoded, decoded = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert decoded == text
    assert len(encoded) < 0.7 * len(text)
    assert not set(encoded) & set("+/=&#%")


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Return the folder of the site's editor, assembled from packages of npm and PyPI."""
    if not (shutil.which("npm") and shutil.which("node")):
        pytest.skip("there is no node and npm here (apt install nodejs npm)")
    if not Path("sar_compiler/studio/static/codemirror.js").exists():
        pytest.skip("the page's text editor is not built here (make editor)")
    assemble = runpy.run_path("docs/site/studio.py")["assemble"]
    return made_once(tmp_path_factory, "site-editor", lambda made: assemble(made, Path("build/studio")))


@pytest.mark.slow
def test_python_in_node_returns_the_same_answers(folder):
    wrong, values = TEXT.replace("<DetectSurvivor/>", "<DetectSurvivr/>"), {"text": TEXT}
    questions: tuple[Any, ...] = (
        put_question(SHIPPED), ("open", {}), ("look", values), ("look", {"text": wrong}), ("palette", values), ("verify", values),
        ("play", {**values, "ticks": 9}), ("edit", {**values, "operation": "delete", "arguments": {"element": 5}}),
    )  # fmt: skip
    command = ("node", "tests/docs/site_editor.mjs", folder, json.dumps(questions))
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    there, (here, _) = json.loads(run.stdout.splitlines()[-1]), answers(*questions)
    for (question, _), said, expected in zip(questions, there["answers"], here, strict=True):
        # A drawing contains the path of the file, which differs.
        assert said.pop("svg", "").count("<g ") == expected.pop("svg", "").count("<g ")
        assert said == expected, question
    assert there["states"] == sorted(there["states"]) != []


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    """Serves a folder without a log."""

    def log_message(self, *arguments):
        """Log nothing."""


@pytest.fixture
def address(folder):
    """Serve the editor; return the address."""
    handler = functools.partial(QuietHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/index.html"
        server.shutdown()


@pytest.mark.slow
def test_site_editor_fixes_verifies_stops_and_shares_a_tree(address):
    with open_browser("--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1") as browser:
        browser.driver.get(address)
        browser.wait_for("#state", "Python is being loaded", _LOADED_SEC)
        browser.wait_for("#state", "No findings", _LOADED_SEC)
        browser.js("window.studio.replace('<DetectSurvivor/>', '<DetectSurvivr/>')")
        browser.wait_for("#findings", "there is no node 'DetectSurvivr'", _LOADED_SEC)
        browser.js("document.querySelector('#findings li button:last-child').click()")
        browser.wait_for("#state", "No findings", _LOADED_SEC)
        browser.click("#verify")
        browser.wait_for("#verdicts", "every run ends: does not hold", _LOADED_SEC)
        # The first button belongs to the question whether an end can be reached.
        browser.js("[...document.querySelectorAll('#verdicts button')].at(-1).click()")
        browser.wait_for("#step", "tick 1: NavigateToZone")
        browser.click("#next")
        browser.wait_for("#step", "repeated forever: NavigateToZone aborted")
        browser.js("window.studio.replace('name=\"Patrol\"', 'name=\"Carried\"')")
        browser.wait_for("#state", "No findings", _LOADED_SEC)
        browser.click("#link")
        browser.wait_for("#state", "The address of this page now contains the tree")
        carried = browser.js("return location.href")
        browser.js("window.studio.saved()")
        browser.open(carried, _LOADED_SEC)
        assert 'name="Carried"' in browser.js("return window.studio.text()")
        browser.js(
            "window.studio.replace('<AdvanceZone/>', `<AdvanceZone/>${arguments[0]}`)",
            "<NavigateToZone/><DetectSurvivor/>" * 40,
        )
        browser.wait_for("#state", "No findings", _LOADED_SEC)
        browser.click("#verify")
        browser.wait_for("#state", "states,", _LOADED_SEC)
        browser.click("#stop")
        browser.wait_for("#state", "Stopped", _LOADED_SEC)
        browser.click("#play")
        browser.wait_for("#state", "6 ticks", _LOADED_SEC)
        browser.js("window.studio.saved()")
        browser.require_no_complaint()
