"""The resilient mission against what goes wrong: flown in the simulator, judged by log, summary and status."""

from contextlib import closing

import pytest

from sar_compiler.cli.journal_command import main as sar_journal
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.recorded_events import recorded_events
from tests.e2e.test_search_and_rescue import MISSION_LOG
from tests.processes import Command, in_order

pytestmark = pytest.mark.ros

LATE = "Timed out while waiting for action server to acknowledge goal request for follow_path"


def fly(*faults, zones="[zone_a, zone_b, zone_c, zone_d]", options=(), parameters=()):
    """Fly the resilient tree with faults to zones, watched for its properties; return the run, ended, and its exit status."""
    options = [*options, *(word for fault in faults for word in ("--fault", fault))]
    run = Command(
        "sar-run",
        "search_and_rescue_resilient",
        "--sim",
        "--speed",
        20,
        "--properties",
        *options,
        "--ros-args",
        "-p",
        f"zone_order:={zones}",
        *parameters,
    )
    try:
        status = run.end()
        assert "Monitored 7 properties: none violated." in run.output
        assert "Assumption failed" not in run.output
        return run, status
    finally:
        run.kill()


@pytest.fixture(scope="module")
def overcome():
    """A flight with more than one attempt can mend, and yet all is mended."""
    late = "navigate_to_pose:late=50ms@zone_b"
    return fly("report_survivor:refuse=3", late, "navigate_to_pose:die@zone_c,back=5")


def zones_driven_to(run):
    """Return where the robot set out for, in order, repeated attempts at one place once."""
    drives = [line.split()[-1] for line in run.log if line.startswith("Navigating to")]
    return [place for place, before in zip(drives, ["", *drives], strict=False) if place != before]


def test_without_faults_the_mission_says_and_does_what_the_contract_has():
    run, status = fly()
    assert status == 0, run.output
    assert [line for line in run.log if line in set(MISSION_LOG)] == MISSION_LOG


@pytest.mark.costly
def test_a_rehearsal_like_nav2_has_nav2_s_recoveries_and_codes():
    wall = ("-p", "zones.zone_a.x:=3.0", "-p", "zones.zone_a.y:=-3.0")
    run, status = fly(zones="[zone_a]", options=("--like", "nav2"), parameters=wall)
    assert status == 1, run.output
    assert (
        len([line for line in run.log if line.startswith("Navigation to zone_a failed:") and "208" in line])
        == 6
    )
    assert any("the robot backs up" in line for line in run.log), run.output


@pytest.mark.costly
def test_what_fails_once_is_tried_again_where_the_robot_is():
    run, status = fly("navigate_to_pose:reject=1", "detect_survivor:drop=1", "report_survivor:refuse=1")
    assert status == 0, run.output
    assert zones_driven_to(run) == ["zone_a...", "zone_b...", "zone_c...", "zone_d...", "station..."]
    for line in (
        "Navigating to zone_a...",
        "Calling detect_survivor for zone_a...",
        "Reporting survivor_1 to base...",
    ):
        assert run.log.count(line) == 2, run.output
    assert "No survivor found at zone_a." not in run.log


@pytest.mark.costly
def test_a_report_that_is_refused_is_kept_and_delivered_on_the_way(overcome):
    run, status = overcome
    assert status == 0, run.output
    told = [
        "The report of survivor_1 is stored until base acknowledges it.",
        "Reporting survivor_1 to base...",
        "Navigating to zone_b...",
        "Base acknowledged survivor_1.",
        "Mission complete.",
    ]
    assert in_order(told, run.log) is None, run.output
    assert not any("survivor_3" in line for line in run.log)


@pytest.mark.costly
def test_reports_that_are_never_acknowledged_are_named_at_the_end():
    run, status = fly("report_survivor:refuse=99", zones="[zone_a, zone_c]")
    assert status == 1
    assert zones_driven_to(run)[-1] == "station..."
    for survivor in ("survivor_1 in zone_a", "survivor_2 in zone_c"):
        assert f"missing:         The base station did not acknowledge {survivor}" in run.output
    assert "Mission complete." not in run.log


@pytest.fixture(scope="module")
def out_of_reach(tmp_path_factory):
    """A flight in which a zone cannot be reached, with its journal."""
    journal = tmp_path_factory.mktemp("out_of_reach") / "m.journal"
    return *fly("navigate_to_pose:abort=zone_b", options=["--journal", journal]), journal


def test_a_zone_out_of_reach_is_come_back_to_then_abandoned_and_the_rest_is_done(out_of_reach):
    run, status, _ = out_of_reach
    assert status == 1
    zones = ["zone_a...", "zone_b...", "zone_c...", "zone_d...", "zone_b...", "station..."]
    assert zones_driven_to(run) == zones, run.output
    assert run.log.count("Navigating to zone_b...") == 6
    assert "  zones visited:   3 of 4 (zone_a, zone_c, zone_d)" in run.output
    assert "  back at base:    yes" in run.output
    assert run.output.splitlines()[-1].endswith("zone_b was abandoned after attempt 3.")


def test_of_a_zone_out_of_reach_the_journal_says_which_answer_would_have_been_enough(out_of_reach, capsys):
    assert sar_journal(["why", str(out_of_reach[-1])]) == 0
    told = capsys.readouterr().out
    assert "NavigateToZone SUCCESS (arrived) instead of FAILURE (aborted)" in told


def test_each_fact_of_a_flight_belongs_to_an_answer_of_the_leaf_that_has_noted_it(out_of_reach):
    with closing(JournalFile.read(out_of_reach[-1])) as file:
        noted = [fact.kind for fact in file.events()]
        events = [event for event in recorded_events(file.last_run()) if event.facts]
    assert [kind for event in events for kind, _ in event.facts] == noted
    told = {f"{event.leaf} {event.outcome}: {kind}" for event in events for kind, _ in event.facts}
    assert told >= {
        "NavigateToZone driving: goal_sent",
        "DetectSurvivor found: zone_searched",
        "BroadcastSurvivorTF named: survivor_named",
        "NotifyBase acknowledged: report_acknowledged",
        "NavigateToBase arrived: base_reached",
    }


def test_a_server_that_comes_back_is_driven_with_again(overcome):
    run, status = overcome
    assert status == 0, run.output
    assert "Fault: bt_navigator disappears." in run.log


def test_a_goal_that_nav2_aborts_because_a_server_is_late_is_sent_again_and_costs_no_attempt(overcome):
    run, status = overcome
    assert status == 0, run.output
    assert any(f'"{LATE}"). The goal is sent again in 1 s.' in line for line in run.log), run.output
    assert run.log.count("Navigating to zone_b...") == 2
    assert not any("abandoned" in line for line in run.log), run.output


@pytest.mark.costly
def test_each_zone_is_reported_as_not_searched_because_nav2_did_not_answer_where_every_goal_is_aborted_late():
    run, status = fly("navigate_to_pose:late=50ms", zones="[zone_a, zone_b]", options=["--speed", 50])
    assert status == 1, run.output
    missing = [line for line in run.output.splitlines() if line.startswith("  missing:")]
    assert len(missing) == 2, run.output
    assert "zone_a and zone_b were abandoned: navigation is unavailable (Nav2 has aborted" in missing[0]
    assert f'"{LATE}"' in missing[0]
    assert "The robot did not return to the base station." in missing[1]
    assert not any("after attempt" in line for line in run.log), run.output
