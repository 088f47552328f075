"""Tests of `sar-run --properties`: a violated property is an alarm in all views of the run, and may end the mission."""

import json
from contextlib import closing

import pytest

from sar_compiler.journal.database import JournalFile
from tests.e2e.test_mission_page import address
from tests.processes import Command
from tests.web.browsers import open_browser

pytestmark = pytest.mark.ros

NEVER_FOUND = """properties:
  nobody is found:
    never: DetectSurvivor found
    if_broken: {done}
"""
VIOLATION = "Property violated: nobody is found (DetectSurvivor found)"


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def aborted_run(tmp_path_factory):
    """Run a mission that a property aborts; return the status, the run, the entries of its journal, and its report."""
    folder = tmp_path_factory.mktemp("aborted")
    properties = write(folder / "properties.yaml", NEVER_FOUND.format(done="abort"))
    options = ("--properties", properties, "--journal", folder / "m.journal", "--report", folder / "r.json")
    run = Command("sar-run", "search_and_rescue_guarded", "--sim", "--speed", 20, *options)
    try:
        status = run.end()
        with closing(JournalFile.read(folder / "m.journal")) as file:
            entries = [*file.stream()]
        return status, run, entries, json.loads((folder / "r.json").read_text(encoding="utf-8"))
    finally:
        run.kill()


def test_violated_property_is_reported_at_once_and_in_summary(aborted_run):
    status, run, _, _ = aborted_run
    assert status == 1
    assert VIOLATION in run.log
    assert "Monitored 1 property: 1 violated (nobody is found)." in run.output


def test_journal_has_violating_event_and_its_history(aborted_run):
    _, _, entries, _ = aborted_run
    (watched,) = [each.data for each in entries if each.kind == "properties_watched"]
    assert watched["properties"] == [{"name": "nobody is found", "if_broken": "abort"}]
    (broken,) = [each for each in entries if each.kind == "property_broken"]
    assert (broken.data["event"], broken.data["owed"]) == ("DetectSurvivor found", False)
    time_sec, tick, node, action = broken.data["run"][-1]
    assert (tick, node, action) == (broken.data["tick"], broken.data["node"], "found")
    # Times of events count from the start of the run, and times of the journal from the start of the simulation.
    (began,) = [each.time for each in entries if each.kind == "run_began"]
    assert began + time_sec == pytest.approx(broken.time, abs=0.5)
    assert [each[3] for each in broken.data["run"]].count("searching") == 1


def test_report_has_alarm(aborted_run):
    *_, report = aborted_run
    assert VIOLATION in [each["text"] for each in report["alarms"]]


def test_command_of_violated_property_is_recorded_with_its_name(aborted_run):
    _, _, entries, _ = aborted_run
    (command,) = [each.data for each in entries if each.kind == "command_given"]
    assert command["command"] == "abort"
    assert {(each.data["by"], each.data["reason"]) for each in entries if "by" in each.data} == {
        ("the property 'nobody is found'", "violated by DetectSurvivor found")
    }


def test_property_with_command_unknown_to_tree_is_rejected_before_start(start, tmp_path):
    properties = write(tmp_path / "properties.yaml", NEVER_FOUND.format(done="hold"))
    run = start("sar-run", "search_and_rescue", "--sim", "--properties", properties, "--journal", "none")
    assert run.end() == 1
    assert (
        "'nobody is found' has `if_broken: pause`, but no node of this tree executes that command"
        in run.output
    )
    assert "Navigating" not in run.output


def test_error_in_property_file_is_reported_before_start(start, tmp_path):
    properties = write(tmp_path / "properties.yaml", "properties: {p: {never: DetectSurvivor fuond}}\n")
    run = start("sar-run", "search_and_rescue", "--sim", "--properties", properties)
    assert run.end() == 2
    assert f"{properties}:1:40: error[unknown-outcome]: 'DetectSurvivor' has no event 'fuond'" in run.output
    assert "did you mean 'found'?" in run.output


TWO_PROPERTIES = """properties:
  nobody is found: {never: DetectSurvivor found}
  no report without a find: {before: NotifyBase starts, comes: DetectSurvivor found}
"""


@pytest.mark.costly
def test_page_and_replay_show_properties(start, tmp_path):
    properties, journal = write(tmp_path / "properties.yaml", TWO_PROPERTIES), tmp_path / "m.journal"
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


def test_halt_by_stop_of_run_violates_no_property(start, tmp_path):
    text = "properties: {p: {never: [NavigateToZone halted, NavigateToZone SUCCESS]}}\n"
    properties = write(tmp_path / "properties.yaml", text)
    run = start("sar-run", "--sim", "--properties", properties, "--journal", "none")
    run.wait_for("Navigating to zone_a...")
    assert run.stop(within_sec=10.0) == 130
    assert "Monitored 1 property: none violated." in run.output
