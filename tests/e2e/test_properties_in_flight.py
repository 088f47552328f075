"""`sar-run --properties`: what breaks a property in flight is an alarm wherever the run is shown, and may end the mission."""

import json
from contextlib import closing

import pytest

from sar_compiler.journal.database import JournalFile
from tests.e2e.test_page_of_a_mission import address
from tests.processes import Command
from tests.web.browsers import open_browser

pytestmark = pytest.mark.ros

NOBODY = """properties:
  nobody is found:
    never: DetectSurvivor found
    if_broken: {done}
"""
BROKEN = "Property violated: nobody is found (DetectSurvivor found)"


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def aborted(tmp_path_factory):
    """A flight that was broken off by a property: what it has said, its journal and its report."""
    folder = tmp_path_factory.mktemp("aborted")
    properties = write(folder / "properties.yaml", NOBODY.format(done="abort"))
    options = ("--properties", properties, "--journal", folder / "m.journal", "--report", folder / "r.json")
    run = Command("sar-run", "search_and_rescue_guarded", "--sim", "--speed", 20, *options)
    try:
        status = run.end()
        with closing(JournalFile.read(folder / "m.journal")) as file:
            entries = [*file.stream()]
        return status, run, entries, json.loads((folder / "r.json").read_text(encoding="utf-8"))
    finally:
        run.kill()


def test_a_property_that_is_broken_is_told_at_once_and_summed_up(aborted):
    status, run, _, _ = aborted
    assert status == 1
    assert BROKEN in run.log
    assert "Monitored 1 property: 1 violated (nobody is found)." in run.output


def test_the_journal_says_which_event_has_broken_it_and_what_led_there(aborted):
    _, _, entries, _ = aborted
    (watched,) = [each.data for each in entries if each.kind == "properties_watched"]
    assert watched["properties"] == [{"name": "nobody is found", "if_broken": "abort"}]
    (broken,) = [each for each in entries if each.kind == "property_broken"]
    assert (broken.data["event"], broken.data["owed"]) == ("DetectSurvivor found", False)
    time_sec, tick, node, deed = broken.data["run"][-1]
    assert (tick, node, deed) == (broken.data["tick"], broken.data["node"], "found")
    # Those of events count from the run's beginning, and those of the journal from when the simulation was begun.
    (began,) = [each.time for each in entries if each.kind == "run_began"]
    assert began + time_sec == pytest.approx(broken.time, abs=0.5)
    assert [each[3] for each in broken.data["run"]].count("searching") == 1


def test_the_report_has_the_alarm(aborted):
    *_, report = aborted
    assert BROKEN in [each["text"] for each in report["alarms"]]


def test_what_is_done_then_is_ordered_of_the_mission_in_the_property_s_name(aborted):
    _, _, entries, _ = aborted
    (command,) = [each.data for each in entries if each.kind == "command_given"]
    assert command["command"] == "abort"
    assert {(each.data["by"], each.data["reason"]) for each in entries if "by" in each.data} == {
        ("the property 'nobody is found'", "violated by DetectSurvivor found")
    }


def test_a_tree_whose_leaves_heed_no_such_order_is_refused_before_anything_moves(start, tmp_path):
    properties = write(tmp_path / "properties.yaml", NOBODY.format(done="hold"))
    run = start("sar-run", "search_and_rescue", "--sim", "--properties", properties, "--journal", "none")
    assert run.end() == 1
    assert (
        "'nobody is found' has `if_broken: pause`, but no node of this tree executes that command"
        in run.output
    )
    assert "Navigating" not in run.output


def test_a_slip_in_the_file_is_a_finding_before_anything_starts(start, tmp_path):
    properties = write(tmp_path / "properties.yaml", "properties: {p: {never: DetectSurvivor fuond}}\n")
    run = start("sar-run", "search_and_rescue", "--sim", "--properties", properties)
    assert run.end() == 2
    assert f"{properties}:1:40: error[unknown-outcome]: 'DetectSurvivor' has no event 'fuond'" in run.output
    assert "did you mean 'found'?" in run.output


WATCHED = """properties:
  nobody is found: {never: DetectSurvivor found}
  no report without a find: {before: NotifyBase starts, comes: DetectSurvivor found}
"""


@pytest.mark.costly
def test_the_page_and_its_replay_have_a_card_for_each_property(start, tmp_path):
    properties, journal = write(tmp_path / "properties.yaml", WATCHED), tmp_path / "m.journal"
    options = ("--properties", properties, "--journal", journal, "--view", "web", "--web-port", 0)
    run = start("sar-run", "search_and_rescue", "--sim", "--speed", 2, *options)
    with open_browser() as page:
        page.size(1400, 900)
        page.open(address(run)[0]).wait_for("#properties summary", "Properties: 2 watched")
        page.click("#properties summary")
        page.wait_for("#properties li.broken", "(DetectSurvivor found)")
        run.end()
        page.wait_for("#properties summary", "1 broken, 1 kept")
        replay = start("sar-journal", "replay", journal, "--web-port", 0)
        page.open(address(replay)[0]).wait_for("#properties summary", "2 watched")
        page.js(
            "const time = document.getElementById('time'); time.value = time.max; time.dispatchEvent(new Event('input'))"
        )
        page.wait_for("#properties summary", "1 broken, 1 kept")


def test_what_is_halted_because_the_run_is_stopped_breaks_nothing(start, tmp_path):
    text = "properties: {p: {never: [NavigateToZone halted, NavigateToZone SUCCESS]}}\n"
    properties = write(tmp_path / "properties.yaml", text)
    run = start("sar-run", "--sim", "--properties", properties, "--journal", "none")
    run.wait_for("Navigating to zone_a...")
    assert run.stop(within_sec=10.0) == 130
    assert "Monitored 1 property: none violated." in run.output
