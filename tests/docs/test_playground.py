"""The playground: what it asks of the package, in node as the page starts it, and the page in a browser."""

import functools
import http.server
import json
import runpy
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.packaging.conftest import made_once
from tests.web.browsers import open_browser

PLAY = runpy.run_path("docs/playground/play.py")
SHIPPED = Path("trees/search_and_rescue.xml")
# Python is loaded into the page, beside other tests.
_LOADED_SEC = 180
_COLOURED = "return document.querySelector(`#picture g.node.${arguments[0]} title`).textContent"
SLIP = ("<DetectSurvivor/>", "<DetectSurvivr/>")


def ask(what, text):
    return json.loads(PLAY[what](text))


def nodes_of(picture):
    """The names in the picture, in the order of its nodes; a title is the place, the tag, the name and the attributes."""
    titles = [part.partition("</title>")[0] for part in picture.split('<g class="node ')[1:]]
    return [title.partition("&gt; ")[2].split(" ")[0] for title in titles]


def test_a_typo_is_found_where_it_is_with_what_was_meant_and_is_in_the_picture():
    seen = ask("look", SHIPPED.read_text().replace(*SLIP))
    [finding] = seen["findings"]
    assert (finding["line"], finding["column"], finding["code"]) == (16, 9, "unknown-node")
    assert finding["suggestion"] == "DetectSurvivor"
    assert f">? {SLIP[1].strip('</>')}</text>" in seen["svg"]
    assert ask("look", "<root>")["svg"] == ""


def test_in_a_browser_for_which_there_is_no_lxml_the_rules_speak_without_the_schema(monkeypatch):
    monkeypatch.setitem(sys.modules, "sar_compiler.checks.schema_validation", None)
    monkeypatch.setattr(sys, "platform", "emscripten")
    assert ask("look", SHIPPED.read_text())["findings"] == []


def test_elsewhere_a_schema_that_cannot_be_asked_is_no_clean_file(monkeypatch):
    monkeypatch.setitem(sys.modules, "sar_compiler.checks.schema_validation", None)
    with pytest.raises(ImportError):
        ask("look", SHIPPED.read_text().replace("<root ", '<root _note="a&#10;b" '))


def test_a_file_that_is_no_tree_is_a_finding_for_each_question():
    assert ask("look", "<root")["findings"][0]["code"] == "malformed-xml"
    assert "not well-formed" in ask("prove", "<root")["error"]
    assert "not well-formed" in ask("play", "<root")["error"]


def test_each_event_of_a_run_leads_to_its_leaf_in_the_picture_whatever_is_put_around_it():
    text = SHIPPED.read_text()
    names = nodes_of(ask("look", text)["svg"])
    runs = [each["ticks"] for each in ask("prove", text)["verdicts"] if each["ticks"]]
    events = [
        event for ticks in (*runs, ask("play", text)["ticks"]) for tick in ticks for event in tick["events"]
    ]
    assert {event["leaf"] for event in events} >= {"NavigateToZone", "NavigateToBase"}
    assert [event for event in events if names[event["way"][-1]] != event["leaf"]] == []
    assert all(event["way"][0] == 0 for event in events)
    assert {"success", "failure", "running", "halted"} == {event["status"] for event in events}


def test_a_run_that_goes_on_for_ever_says_which_ticks_come_again():
    [endless] = [
        each for each in ask("prove", SHIPPED.read_text())["verdicts"] if each["question"] == "every run ends"
    ]
    assert (endless["verdict"], endless["loop"], len(endless["ticks"])) == ("does not hold", 2, 3)


@pytest.fixture(scope="session")
def playground(tmp_path_factory):
    """The folder of the site's playground, made of what npm and PyPI have."""
    if not (shutil.which("npm") and shutil.which("node")):
        pytest.skip("there is no node and npm here (apt install nodejs npm)")
    assemble = runpy.run_path("docs/site/playground.py")["assemble"]
    return made_once(
        tmp_path_factory, "playground", lambda folder: assemble(folder, Path("build/playground"))
    )


@pytest.mark.slow
def test_in_node_the_same_is_said_as_here(playground, tmp_path):
    wrong = tmp_path / "wrong.xml"
    wrong.write_text(SHIPPED.read_text().replace(*SLIP), encoding="utf-8")
    command = ("node", "tests/docs/playground.mjs", playground, SHIPPED, wrong)
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    right, refused = json.loads(run.stdout.splitlines()[-1])
    text = SHIPPED.read_text()
    assert right["proof"] == ask("prove", text)
    assert right["run"] == ask("play", text)
    assert nodes_of(right["svg"]) == nodes_of(ask("look", text)["svg"])
    expected = ask("look", wrong.read_text())
    assert refused["findings"] == expected["findings"]
    assert nodes_of(refused["svg"]) == nodes_of(expected["svg"])


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves a folder, and says nothing."""

    def log_message(self, *arguments):
        """Say nothing."""


@pytest.fixture
def address(playground):
    """Where the playground is served."""
    handler = functools.partial(Quiet, directory=str(playground))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/index.html"
        server.shutdown()


@pytest.mark.slow
def test_on_the_page_a_tree_is_broken_mended_proved_and_its_counterexample_walks(address):
    with open_browser() as browser:
        browser.driver.get(address)
        proved = ask("prove", browser.js("return document.getElementById('tree').value"))
        browser.allow("favicon")
        write = functools.partial(
            browser.js,
            "const box = document.getElementById('tree'); box.value = box.value.replace(...arguments);"
            "box.dispatchEvent(new Event('input'))",
        )
        browser.wait_for("#state", "no findings", _LOADED_SEC)
        assert len(nodes_of(browser.js("return document.getElementById('picture').innerHTML"))) == 7
        write(*SLIP)
        browser.wait_for("#findings", "8:9 error: there is no node 'DetectSurvivr'", _LOADED_SEC)
        assert browser.js("return document.getElementById('prove').disabled")
        write(*reversed(SLIP))
        browser.wait_for("#state", "no findings", _LOADED_SEC)
        browser.click("#prove")
        browser.wait_for("#state", f"{proved['states']} states", _LOADED_SEC)
        browser.wait_for("#verdicts", "every run ends: does not hold")
        browser.click("#verdicts li:last-child button")
        assert browser.text("#step") == "tick 1: NavigateToZone driving; root RUNNING"
        assert browser.js(_COLOURED, "running").endswith("NavigateToZone")
        assert browser.js("return document.querySelectorAll('#picture g.node.way').length") == 3
        browser.click("#next")
        assert browser.text("#step") == "tick 2, again and again: NavigateToZone aborted"
        assert browser.js(_COLOURED, "failure").endswith("NavigateToZone")
        browser.click("#play")
        browser.wait_for("#state", "6 ticks", _LOADED_SEC)
        browser.require_no_complaint()
