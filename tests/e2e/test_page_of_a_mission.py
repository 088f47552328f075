"""The page of a whole mission, from its start over orders and a stop to its replay."""

import re
import signal
from contextlib import ExitStack
from typing import Any

import pytest

from tests.processes import Command, free_port
from tests.web.browsers import Browser, open_browser

# One mission serves all of them. What the page shows and orders: tests/web; a run that is resumed: tests/faults/test_resume.py.
pytestmark = [pytest.mark.ros, pytest.mark.costly]


def address(command):
    """Return the address of the engineer's page that a command serves, and its port."""
    found = re.search(r"http://127\.0\.0\.1:(\d+)/\S*", command.wait_for("http://").output)
    assert found
    whole, _, token = found[0].partition("#")
    return f"{whole}tree#{token}" if token else f"{whole}tree", found[1]


class Told(Browser):
    """The page of a run, and what an operator does there."""

    def order(self, verb, said):
        """Press a button, and confirm it if it asks; wait for the answer."""
        button = f"[data-verb={verb}]:enabled"
        self.wait(
            lambda: self.js("return !!document.querySelector(arguments[0])", button), f"the button of {verb}"
        )
        self.click(button)
        if self.js("return document.getElementById('ask').open"):
            self.click("#ask .yes")
        self.wait_for("#answer", said)

    def wait_for_rest(self):
        """Wait until the robot stands, and the tree holds it."""
        stands = "AwaitStandstillAndHold, AwaitStandstill, SUCCESS"
        self.wait(lambda: any(row.startswith(stands) for row in self.rows()), f"'{stands}'")

    def zone(self, name):
        """Return what the map says of a zone."""
        titles = "return [...document.querySelectorAll('#map [data-kind=zone] title')].map((title) => title.textContent)"
        return next((title for title in self.js(titles) if title.startswith(f"{name}: ")), "")


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    """Fly with a page; return what was seen.

    The operator holds the robot as soon as there is a button for it, looks around, reloads, skips the zone, lets it go on, holds
    it again. The run is stopped, resumed on the same port, and released; in the end its journal is replayed.
    """
    journal = tmp_path_factory.mktemp("page") / "mission.journal"
    seen: dict[str, Any] = {}
    with ExitStack() as stack:
        page = Told(stack.enter_context(open_browser()).driver)
        page.size(1400, 900)

        def start(name, *arguments):
            command = Command(name, *arguments)
            stack.callback(command.kill)
            return command

        def fly(*options):
            tree = "search_and_rescue_guarded"
            return start(
                "sar-run", tree, "--sim", "--speed", 2, "--view", "web", "--journal", journal, *options
            )

        run = fly("--web-port", free_port())
        url, port = address(run)
        page.open(url).order("pause", "Pause: done")
        page.wait_for("#condition strong", "paused").wait_for(
            "#condition", "by an operator (page, 127.0.0.1)"
        )
        page.wait_for_rest()
        page.wait(
            lambda: page.js("return document.querySelectorAll('#map image, #map .robot').length") == 2,
            "the map",
        )
        seen["live"] = page.rows()
        page.driver.refresh()
        page.wait_for_rest()
        seen["reloaded"] = page.rows()
        page.order("skip_zone", "Skip zone: done")
        page.wait(lambda: "abandoned" in page.zone("zone_a"), "the end of zone_a")
        seen["skipped"] = page.zone("zone_a")
        page.order("resume", "Resume: done")
        page.wait_for("#now", "navigating to zone_b")
        page.order("pause", "Pause: done")
        page.wait_for("#condition strong", "paused").wait_for(
            "#condition", "by an operator (page, 127.0.0.1)"
        )
        run.send(signal.SIGINT)
        seen["stopped"] = run.end()
        page.wait_for("#condition strong", "stopped")

        again = fly("--resume", "--web-port", port)
        page.wait_for("#clock", "run 2").wait_for("#condition strong", "paused")
        seen["resumed"] = page.zone("zone_a")
        page.order("resume", "this page is read-only")
        page.open(address(again)[0])
        page.order("resume", "Resume: done")
        page.wait_for("#now", "navigating to zone_b")
        seen["ended"] = again.end()
        page.wait_for("#condition strong", "failed")
        seen["last"] = page.text("#progress")

        replay = start("sar-journal", "replay", journal, "--web-port", 0)
        page.open(address(replay)[0])
        page.js(
            "const time = document.getElementById('time'); time.value = time.max; time.dispatchEvent(new Event('input'))"
        )
        page.wait_for("#condition strong", "failed")
        seen["replayed"] = page.text("#progress"), [page.zone(name) for name in ("zone_a", "zone_b")]
        seen["why"] = page.text("#why")
        seen["of replay"] = replay.stop()
    return seen


def test_a_mission_under_way_is_seen_in_a_browser(story):
    assert "NotHeld?, NotHeld, FAILURE, paused by an operator (page, 127.0.0.1)" in story["live"]


def test_a_reload_in_flight_loses_nothing(story):
    assert story["reloaded"][:10] == story["live"][:10]


def test_the_operator_skips_a_zone_on_the_page(story):
    assert re.match(r"zone_a: abandoned, .*skipped by an operator \(page, 127\.0\.0\.1\);", story["skipped"])


def test_the_page_of_a_run_that_was_stopped_goes_on_with_the_one_that_resumes(story):
    assert story["stopped"] == 130
    assert story["resumed"] == story["skipped"]


def test_the_end_of_a_mission_is_seen_after_its_command_has_ended(story):
    assert story["ended"] == 1
    assert story["last"].startswith("zones visited 3 of 4 · survivors found 1 · survivors reported 1")


def test_the_replay_says_why_the_mission_has_failed(story):
    assert story["why"].startswith("Why: ")
    assert "MissionComplete? FAILURE (incomplete), zone_a was" in story["why"]


def test_the_journal_shows_the_same_again(story):
    progress, zones = story["replayed"]
    assert progress == story["last"]
    assert zones[0] == story["skipped"]
    assert zones[1].startswith("zone_b: visited;")


def test_ctrl_c_is_the_end_of_a_replay(story):
    assert story["of replay"] == 0
