"""Tests of the page of a whole mission: start, commands, stop, resume and replay."""

import re
import signal
from contextlib import ExitStack
from typing import Any

import pytest

from tests.processes import Command, free_port
from tests.web.browsers import Browser, open_browser

# All tests share one mission. For the content of the page, see tests/web; for resumed runs, see tests/faults/test_resume.py.
pytestmark = [pytest.mark.ros, pytest.mark.costly]


def address(command):
    """Return the address of the engineer's page that a command serves, and its port."""
    found = re.search(r"http://127\.0\.0\.1:(\d+)/\S*", command.wait_for("http://").output)
    assert found
    whole, _, token = found[0].partition("#")
    return f"{whole}tree#{token}" if token else f"{whole}tree", found[1]


class MissionPage(Browser):
    """The page of a run, with the actions of an operator."""

    def send_command(self, verb, said):
        """Press a button, confirm its dialog, if any, and wait for the response."""
        button = f"[data-verb={verb}]:enabled"
        self.wait(
            lambda: self.js("return !!document.querySelector(arguments[0])", button), f"the button of {verb}"
        )
        self.click(button)
        if self.js("return document.getElementById('ask').open"):
            self.click("#ask .yes")
        self.wait_for("#answer", said)

    def wait_for_rest(self):
        """Wait until the robot stands still and the tree is paused."""
        stands = "AwaitStandstillAndHold, AwaitStandstill, SUCCESS"
        self.wait(lambda: any(row.startswith(stands) for row in self.rows()), f"'{stands}'")

    def zone(self, name):
        """Return the title of a zone on the map."""
        titles = "return [...document.querySelectorAll('#map [data-kind=zone] title')].map((title) => title.textContent)"
        return next((title for title in self.js(titles) if title.startswith(f"{name}: ")), "")


@pytest.fixture(scope="module")
def observations(tmp_path_factory):
    """Run a mission with a page; return the observations.

    The operator pauses the robot as soon as the button appears, reloads the page, skips the zone, resumes, and pauses again. The
    run is stopped, then resumed on the same port and by the operator. In the end, its journal is replayed.
    """
    journal = tmp_path_factory.mktemp("page") / "mission.journal"
    seen: dict[str, Any] = {}
    with ExitStack() as stack:
        page = MissionPage(stack.enter_context(open_browser()).driver)
        page.size(1400, 900)

        def start(name, *arguments):
            command = Command(name, *arguments)
            stack.callback(command.kill)
            return command

        def start_run(*options):
            tree = "search_and_rescue_guarded"
            return start(
                "sar-run", tree, "--sim", "--speed", 2, "--view", "web", "--journal", journal, *options
            )

        run = start_run("--web-port", free_port())
        url, port = address(run)
        page.open(url).send_command("pause", "Pause: done")
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
        page.send_command("skip_zone", "Skip zone: done")
        page.wait(lambda: "abandoned" in page.zone("zone_a"), "the end of zone_a")
        seen["skipped"] = page.zone("zone_a")
        page.send_command("resume", "Resume: done")
        page.wait_for("#now", "navigating to zone_b")
        page.send_command("pause", "Pause: done")
        page.wait_for("#condition strong", "paused").wait_for(
            "#condition", "by an operator (page, 127.0.0.1)"
        )
        run.send(signal.SIGINT)
        seen["stopped"] = run.end()
        page.wait_for("#condition strong", "stopped")

        again = start_run("--resume", "--web-port", port)
        page.wait_for("#clock", "run 2").wait_for("#condition strong", "paused")
        seen["resumed"] = page.zone("zone_a")
        page.send_command("resume", "this page is read-only")
        page.open(address(again)[0])
        page.send_command("resume", "Resume: done")
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


def test_page_shows_paused_mission(observations):
    assert "NotHeld?, NotHeld, FAILURE, paused by an operator (page, 127.0.0.1)" in observations["live"]


def test_reloaded_page_shows_same_rows(observations):
    assert observations["reloaded"][:10] == observations["live"][:10]


def test_operator_skips_zone_on_page(observations):
    assert re.match(
        r"zone_a: abandoned, .*skipped by an operator \(page, 127\.0\.0\.1\);", observations["skipped"]
    )


def test_page_of_stopped_run_continues_with_resumed_run(observations):
    assert observations["stopped"] == 130
    assert observations["resumed"] == observations["skipped"]


def test_page_shows_end_of_mission_after_command_has_ended(observations):
    assert observations["ended"] == 1
    assert observations["last"].startswith("zones visited 3 of 4 · survivors found 1 · survivors reported 1")


def test_replay_explains_failure_of_mission(observations):
    assert observations["why"].startswith("Why: ")
    assert "MissionComplete? FAILURE (incomplete), zone_a was" in observations["why"]


def test_replay_shows_same_progress_and_zones(observations):
    progress, zones = observations["replayed"]
    assert progress == observations["last"]
    assert zones[0] == observations["skipped"]
    assert zones[1].startswith("zone_b: visited;")


def test_ctrl_c_ends_replay_with_status_0(observations):
    assert observations["of replay"] == 0
