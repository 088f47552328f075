"""Tests of the resilient mission with faults in the simulator, by its log, summary and status."""

from contextlib import closing

import pytest

from sar_compiler.cli.journal_command import main as sar_journal
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.recorded_events import recorded_events
from tests.e2e.test_search_and_rescue import MISSION_LOG
from tests.processes import Command, in_order

pytestmark = pytest.mark.ros

LATE = "Timed out while waiting for action server to acknowledge goal request for follow_path"


def run_mission(*faults, zones="[zone_a, zone_b, zone_c, zone_d]", options=(), parameters=()):
    """Run the resilient tree with faults and monitored properties; return the completed run and its exit status."""
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
def recovered_run():
    """Run a mission that recovers from several faults."""
    late = "navigate_to_pose:late=50ms@zone_b"
    return run_mission("report_survivor:refuse=3", late, "navigate_to_pose:die@zone_c,back=5")


def zones_driven_to(run):
    """Return the destinations of the robot in order, without repeated attempts at the same destination."""
    drives = [line.split()[-1] for line in run.log if line.startswith("Navigating to")]
    return [place for place, before in zip(drives, ["", *drives], strict=False) if place != before]


def test_mission_without_faults_has_log_of_contract():
    run, status = run_mission()
    assert status == 0, run.output
    assert [line for line in run.log if line in set(MISSION_LOG)] == MISSION_LOG


@pytest.mark.costly
def test_simulation_like_nav2_has_its_recoveries_and_error_codes():
    wall = ("-p", "zones.zone_a.x:=3.0", "-p", "zones.zone_a.y:=-3.0")
    run, status = run_mission(zones="[zone_a]", options=("--like", "nav2"), parameters=wall)
    assert status == 1, run.output
    assert (
        len([line for line in run.log if line.startswith("Navigation to zone_a failed:") and "208" in line])
        == 6
    )
    assert any("the robot backs up" in line for line in run.log), run.output


@pytest.mark.costly
def test_failed_request_is_retried_at_same_position():
    run, status = run_mission(
        "navigate_to_pose:reject=1", "detect_survivor:drop=1", "report_survivor:refuse=1"
    )
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
def test_rejected_report_is_stored_and_delivered_later(recovered_run):
    run, status = recovered_run
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
def test_unacknowledged_reports_are_named_in_summary():
    run, status = run_mission("report_survivor:refuse=99", zones="[zone_a, zone_c]")
    assert status == 1
    assert zones_driven_to(run)[-1] == "station..."
    for survivor in ("survivor_1 in zone_a", "survivor_2 in zone_c"):
        assert f"missing:         The base station did not acknowledge {survivor}" in run.output
    assert "Mission complete." not in run.log


@pytest.fixture(scope="module")
def unreachable_zone_run(tmp_path_factory):
    """Run a mission with an unreachable zone; return the run, its status and its journal."""
    journal = tmp_path_factory.mktemp("out_of_reach") / "m.journal"
    return *run_mission("navigate_to_pose:abort=zone_b", options=["--journal", journal]), journal


def test_unreachable_zone_is_retried_later_and_then_abandoned(unreachable_zone_run):
    run, status, _ = unreachable_zone_run
    assert status == 1
    zones = ["zone_a...", "zone_b...", "zone_c...", "zone_d...", "zone_b...", "station..."]
    assert zones_driven_to(run) == zones, run.output
    assert run.log.count("Navigating to zone_b...") == 6
    assert "  zones visited:   3 of 4 (zone_a, zone_c, zone_d)" in run.output
    assert "  back at base:    yes" in run.output
    assert run.output.splitlines()[-1].endswith("zone_b was abandoned after attempt 3.")


def test_journal_explains_which_outcome_would_have_sufficed(unreachable_zone_run, capsys):
    assert sar_journal(["why", str(unreachable_zone_run[-1])]) == 0
    told = capsys.readouterr().out
    assert "NavigateToZone SUCCESS (arrived) instead of FAILURE (aborted)" in told


def test_each_journal_event_belongs_to_outcome_of_its_leaf(unreachable_zone_run):
    with closing(JournalFile.read(unreachable_zone_run[-1])) as file:
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


def test_mission_succeeds_after_server_has_returned(recovered_run):
    run, status = recovered_run
    assert status == 0, run.output
    assert "Fault: bt_navigator disappears." in run.log


def test_goal_aborted_because_of_late_server_is_resent_without_using_attempt(recovered_run):
    run, status = recovered_run
    assert status == 0, run.output
    assert any(f'"{LATE}"). The goal is sent again in 1 s.' in line for line in run.log), run.output
    assert run.log.count("Navigating to zone_b...") == 2
    assert not any("abandoned" in line for line in run.log), run.output


@pytest.mark.costly
def test_zones_are_abandoned_if_every_goal_is_aborted_because_of_late_server():
    run, status = run_mission("navigate_to_pose:late=50ms", zones="[zone_a, zone_b]", options=["--speed", 50])
    assert status == 1, run.output
    missing = [line for line in run.output.splitlines() if line.startswith("  missing:")]
    assert len(missing) == 2, run.output
    assert "zone_a and zone_b were abandoned: navigation is unavailable (Nav2 has aborted" in missing[0]
    assert f'"{LATE}"' in missing[0]
    assert "The robot did not return to the base station." in missing[1]
    assert not any("after attempt" in line for line in run.log), run.output
