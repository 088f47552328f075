"""Tests of the outcome labels that the leaves of the mission report.

`Stage.take` checks in every test of this folder that each reported outcome is declared. These tests check which one it is.
"""

from typing import TYPE_CHECKING, Any

import pytest
from py_trees.behaviour import Behaviour

from search_and_rescue import SPECS
from search_and_rescue.actions.navigation import NavigateToBase, NavigateToZone
from search_and_rescue.actions.report_queue import DeliverReports
from search_and_rescue.actions.survivors import DetectSurvivor, NotifyBase
from search_and_rescue.actions.zones import AbandonZone, AdvanceZone
from search_and_rescue.record import SurvivorReport

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

pytestmark = pytest.mark.ros


def run_and_get_outcome(stage: "Stage", leaf: Any) -> str:
    """Run a leaf, and return its status and outcome label."""
    return f"{stage.run(leaf).value} {leaf.outcome_label}"


def drive(stage: "Stage", cls: type[Behaviour] = NavigateToZone, **options: Any) -> Any:
    return stage.take(cls("Drive", stage.zones, record=stage.record, **options))  # type: ignore[call-arg]


def search(stage: "Stage", **options: Any) -> Any:
    return stage.take(DetectSurvivor("Search", stage.zones, record=stage.record, **options))


def visit_all_zones(stage: "Stage") -> None:
    while stage.zones.has_remaining():
        stage.zones.select_next_zone()


@pytest.mark.parametrize("cls", [NavigateToZone, NavigateToBase])
def test_aborted_drive_reports_its_outcome(stage: "Stage", cls: type[Behaviour]) -> None:
    stage.nav_server().script = ["abort"]
    assert run_and_get_outcome(stage, drive(stage, cls)) == "FAILURE aborted"


def test_drive_reports_that_it_waits_for_nav2(stage: "Stage") -> None:
    leaf = drive(stage, server_timeout_sec=0.05)
    leaf.tick_once()
    assert leaf.outcome_label == "driving"
    stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
    assert leaf.outcome_label == "waiting for Nav2"


def test_drive_without_server_is_unavailable_not_aborted(stage: "Stage") -> None:
    assert (
        run_and_get_outcome(stage, drive(stage, server_timeout_sec=0.05, hold_timeout_sec=0.1))
        == "FAILURE unavailable"
    )


def test_leaves_report_no_zone_after_last_zone(stage: "Stage") -> None:
    visit_all_zones(stage)
    assert run_and_get_outcome(stage, drive(stage)) == "FAILURE no zone"
    assert run_and_get_outcome(stage, search(stage)) == "FAILURE no zone"
    assert run_and_get_outcome(stage, stage.take(AdvanceZone("Advance", stage.zones))) == "SUCCESS no zone"
    assert run_and_get_outcome(stage, stage.take(AbandonZone("Abandon", stage.zones))) == "SUCCESS no zone"


def test_advance_and_abandon_report_their_outcomes(stage: "Stage") -> None:
    assert run_and_get_outcome(stage, stage.take(AdvanceZone("Advance", stage.zones))) == "SUCCESS advanced"
    assert run_and_get_outcome(stage, stage.take(AbandonZone("Abandon", stage.zones))) == "SUCCESS abandoned"


def test_search_reports_found_or_nothing(stage: "Stage") -> None:
    stage.detect_service({"zone_a": (-2.5, 3.2)})
    leaf = search(stage)
    first = run_and_get_outcome(stage, leaf)
    stage.zones.select_next_zone()
    assert [first, run_and_get_outcome(stage, leaf)] == ["SUCCESS found", "SUCCESS nothing"]


def test_search_without_response_reports_no_answer(stage: "Stage") -> None:
    assert run_and_get_outcome(stage, search(stage, server_timeout_sec=0.05)) == "FAILURE no answer"


def test_failed_report_states_reason(stage: "Stage") -> None:
    found = search(stage)
    leaf = stage.take(NotifyBase("Report", found, record=stage.record))
    without_detection = run_and_get_outcome(stage, leaf)
    found._pose, found._survivor_id = (-2.5, 3.2), "survivor_1"
    stage.record.survivor_named("survivor_1", -2.5, 3.2)
    stage.report_service(acknowledged=False)
    assert [without_detection, run_and_get_outcome(stage, leaf)] == [
        "FAILURE nothing to report",
        "FAILURE refused",
    ]


def test_delivery_reports_how_many_reports_were_accepted(stage: "Stage") -> None:
    leaf = stage.take(DeliverReports("Deliver", stage.kept, record=stage.record))
    none = run_and_get_outcome(stage, leaf)
    for number in (1, 2, 3):
        report = SurvivorReport(f"survivor_{number}", -2.5, 3.2)
        stage.record.survivor_named(report.survivor_id, report.x, report.y)
        stage.record.report_kept(report)
    verdicts = iter([False, False, False, True, False, False, True, False, True])

    def judge(_: Any, response: Any) -> None:
        response.acknowledged = next(verdicts)

    stage.report_service(acknowledged=False).answer = judge
    assert [none, *(run_and_get_outcome(stage, leaf) for _ in range(4))] == [
        "SUCCESS nothing kept",
        "FAILURE refused",
        "FAILURE ",  # two of three are left, for which there is no outcome
        "FAILURE all but one delivered",
        "SUCCESS delivered",
    ]


def test_leaves_with_several_outcomes_per_status_are_listed() -> None:
    said = {
        spec.tag for spec in SPECS if len({each.status for each in spec.outcomes}) < len(spec.outcomes)
    }  # fmt: skip
    assert said == {
        "NavigateToZone",
        "NavigateToBase",
        "DetectSurvivor",
        "NotifyBase",
        "DeliverReports",
        "AdvanceZone",
        "AbandonZone",
        "FullBatterySuffices",  # in tests/missions/test_charging_at_home.py
        "NavigateToCharge",  # as NavigateToBase
        # The following ones are tested in tests/missions/test_sweeping.py.
        "PlanSweep",
        "RefineSweep",
        "NavigateToPiece",
        "NavigateThroughPieces",
        "AdvancePiece",
        "SkipPiece",
        "IsFindNew",
        "ReturnInReach",  # in tests/missions/test_charging_at_home.py
        "NotHeld",  # in tests/faults/test_failsafes.py
    }
