"""The leaves of the mission say which of their declared answers they give.

`Stage.take` holds of every leaf in every test of this folder that what it says is declared; here is what they say.
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


def answer(stage: "Stage", leaf: Any) -> str:
    """Run a leaf, and return what it has answered."""
    return f"{stage.run(leaf).value} {leaf.outcome_label}"


def drive(stage: "Stage", cls: type[Behaviour] = NavigateToZone, **options: Any) -> Any:
    return stage.take(cls("Drive", stage.zones, record=stage.record, **options))  # type: ignore[call-arg]


def search(stage: "Stage", **options: Any) -> Any:
    return stage.take(DetectSurvivor("Search", stage.zones, record=stage.record, **options))


def finish(stage: "Stage") -> None:
    while stage.zones.has_remaining():
        stage.zones.select_next_zone()


@pytest.mark.parametrize("cls", [NavigateToZone, NavigateToBase])
def test_a_drive_says_how_it_has_ended(stage: "Stage", cls: type[Behaviour]) -> None:
    stage.nav_server().script = ["abort"]
    assert answer(stage, drive(stage, cls)) == "FAILURE aborted"


def test_a_drive_says_whether_it_waits_for_somebody_to_judge_it(stage: "Stage") -> None:
    leaf = drive(stage, server_timeout_sec=0.05)
    leaf.tick_once()
    assert leaf.outcome_label == "driving"
    stage.tick_until(leaf, lambda: stage.record.navigation_lost, "the wait")
    assert leaf.outcome_label == "waiting for Nav2"


def test_a_drive_that_nobody_judges_is_no_aborted_one(stage: "Stage") -> None:
    assert answer(stage, drive(stage, server_timeout_sec=0.05, hold_timeout_sec=0.1)) == "FAILURE unavailable"


def test_without_a_zone_there_is_nothing_to_drive_to_to_search_or_to_leave(stage: "Stage") -> None:
    finish(stage)
    assert answer(stage, drive(stage)) == "FAILURE no zone"
    assert answer(stage, search(stage)) == "FAILURE no zone"
    assert answer(stage, stage.take(AdvanceZone("Advance", stage.zones))) == "SUCCESS no zone"
    assert answer(stage, stage.take(AbandonZone("Abandon", stage.zones))) == "SUCCESS no zone"


def test_zones_that_are_left_are_advanced_and_abandoned(stage: "Stage") -> None:
    assert answer(stage, stage.take(AdvanceZone("Advance", stage.zones))) == "SUCCESS advanced"
    assert answer(stage, stage.take(AbandonZone("Abandon", stage.zones))) == "SUCCESS abandoned"


def test_a_search_says_what_it_has_found(stage: "Stage") -> None:
    stage.detect_service({"zone_a": (-2.5, 3.2)})
    leaf = search(stage)
    first = answer(stage, leaf)
    stage.zones.select_next_zone()
    assert [first, answer(stage, leaf)] == ["SUCCESS found", "SUCCESS nothing"]


def test_a_search_without_an_answer_says_so(stage: "Stage") -> None:
    assert answer(stage, search(stage, server_timeout_sec=0.05)) == "FAILURE no answer"


def test_a_report_says_why_it_is_not_acknowledged(stage: "Stage") -> None:
    found = search(stage)
    leaf = stage.take(NotifyBase("Report", found, record=stage.record))
    nobody = answer(stage, leaf)
    found._pose, found._survivor_id = (-2.5, 3.2), "survivor_1"
    stage.record.survivor_named("survivor_1", -2.5, 3.2)
    stage.report_service(acknowledged=False)
    assert [nobody, answer(stage, leaf)] == ["FAILURE nothing to report", "FAILURE refused"]


def test_a_delivery_says_what_has_become_of_the_reports(stage: "Stage") -> None:
    leaf = stage.take(DeliverReports("Deliver", stage.kept, record=stage.record))
    none = answer(stage, leaf)
    for number in (1, 2, 3):
        report = SurvivorReport(f"survivor_{number}", -2.5, 3.2)
        stage.record.survivor_named(report.survivor_id, report.x, report.y)
        stage.record.report_kept(report)
    verdicts = iter([False, False, False, True, False, False, True, False, True])

    def judge(_: Any, response: Any) -> None:
        response.acknowledged = next(verdicts)

    stage.report_service(acknowledged=False).answer = judge
    assert [none, *(answer(stage, leaf) for _ in range(4))] == [
        "SUCCESS nothing kept",
        "FAILURE refused",
        "FAILURE ",  # two of three are left, which is none of its answers
        "FAILURE all but one delivered",
        "SUCCESS delivered",
    ]


def test_these_are_the_leaves_with_several_answers_of_a_status() -> None:
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
        "FullBatterySuffices",  # in tests/missions/test_home_again.py
        "NavigateToCharge",  # as NavigateToBase
        # These in tests/missions/test_sweeping.py.
        "PlanSweep",
        "RefineSweep",
        "NavigateToPiece",
        "NavigateThroughPieces",
        "AdvancePiece",
        "SkipPiece",
        "IsFindNew",
        "ReturnInReach",  # in tests/missions/test_home_again.py
        "NotHeld",  # in tests/faults/test_failsafes.py
    }
