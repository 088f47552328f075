"""Tests of end conditions of a run."""

import pytest
from py_trees.common import Status

from sar_compiler.execution.end_condition import EndCondition, default_summary
from sar_compiler.execution.until import Until
from sar_compiler.journal.display import Display, Figure
from sar_compiler.missions.mission import MissionRun
from search_and_rescue.record import MissionRecord
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager

SUCCESS, FAILURE, RUNNING, SKIPPED = Status.SUCCESS, Status.FAILURE, Status.RUNNING, Status.INVALID
POSE = {"x": 0.0, "y": 0.0, "yaw": 0.0}


@pytest.fixture
def mission():
    return Search(ZoneManager([{"id": "a", **POSE}], POSE))


@pytest.fixture
def zones(mission):
    return mission.context[ZoneManager]


@pytest.fixture
def record(mission):
    return mission.context[MissionRecord]


def test_run_ends_when_mission_is_complete(mission, zones, record):
    ending = EndCondition(Until.COMPLETE, mission)
    assert ending.after_tick(RUNNING, 1.0) is None
    record.zone_searched("a", None)
    zones.select_next_zone()
    assert ending.after_tick(SUCCESS, 2.0) is None
    record.base_reached()
    result = ending.after_tick(SUCCESS, 3.0)
    assert result is not None
    assert (result.achieved, result.reason) == (True, "Mission complete.")


def test_complete_mission_reports_open_points(mission, zones, record):
    zones.select_next_zone()
    record.base_reached()
    result = EndCondition(Until.COMPLETE, mission).after_tick(SUCCESS, 1.0)
    assert result is not None
    assert (result.achieved, result.reason) == (True, "Mission complete. a was visited, not searched.")


def test_run_ends_when_mission_can_no_longer_complete(mission, zones, record):
    ending = EndCondition(Until.COMPLETE, mission)
    record.zone_searched("a", (1.0, 2.0))
    record.base_reached()
    zones.select_next_zone()
    assert ending.after_tick(SUCCESS, 1.0) is None
    result = ending.after_tick(SUCCESS, 2.0)
    assert result is not None
    missing = "The base station did not acknowledge a survivor without a name in a at (1.00, 2.00)."
    assert ending.shortfalls() == [missing]
    assert (result.achieved, result.reason) == (
        False,
        f"No zone is left. {missing}",
    )


def test_run_continues_while_tree_runs_between_failures(mission, zones):
    ending = EndCondition(Until.COMPLETE, mission)
    zones.select_next_zone()
    assert [ending.after_tick(status, 1.0) for status in (FAILURE, RUNNING, FAILURE)] == [None] * 3
    assert ending.after_tick(FAILURE, 2.0) is not None


def test_run_continues_after_failures_while_zones_remain(mission):
    ending = EndCondition(Until.COMPLETE, mission)
    assert [ending.after_tick(FAILURE, 1.0) for _ in range(5)] == [None] * 5


@pytest.mark.parametrize(("until", "wanted"), [(Until.SUCCESS, SUCCESS), (Until.FAILURE, FAILURE)])
def test_run_until_status_ends_with_that_status_only(until, wanted):
    ending = EndCondition(until)
    for status in (RUNNING, SUCCESS, FAILURE, SKIPPED):
        result = ending.after_tick(status, 1.0)
        assert (result is not None) == (status == wanted)
        assert result is None or result.achieved


@pytest.mark.parametrize(
    ("status", "achieved", "name"),
    [(SUCCESS, True, "SUCCESS"), (FAILURE, False, "FAILURE"), (SKIPPED, False, "SKIPPED")],
)
def test_run_until_end_is_achieved_if_root_succeeds(status, achieved, name):
    ending = EndCondition(Until.END)
    assert ending.after_tick(RUNNING, 1.0) is None
    result = ending.after_tick(status, 2.0)
    assert result is not None
    assert (result.achieved, result.reason) == (achieved, f"The root of the tree ended with {name}.")


def test_restarts_are_logged_with_numbers_at_growing_intervals():
    said: list[str] = []
    ending = EndCondition(Until.SUCCESS, say=said.append)
    for status in (FAILURE, RUNNING, SKIPPED, *[FAILURE] * 220):
        assert ending.after_tick(status, 1.0) is None
    assert said[:4] == [
        "Root FAILURE, starting again (1st time).",
        "Root SKIPPED, starting again (2nd time).",
        "Root FAILURE, starting again (3rd time).",
        "Root FAILURE, starting again (4th time).",
    ]
    numbers = [each.partition("(")[2].removesuffix(" time).") for each in said]
    assert numbers[8:12] == ["9th", "10th", "20th", "30th"]
    assert numbers[-3:] == ["90th", "100th", "200th"]


@pytest.mark.parametrize("until", [Until.COMPLETE, Until.FOREVER])
def test_run_not_ended_by_root_logs_no_restarts(until, mission):
    said: list[str] = []
    ending = EndCondition(until, mission, say=said.append)
    for status in (FAILURE, SUCCESS):
        ending.after_tick(status, 1.0)
    assert said == []


@pytest.mark.parametrize("status", list(Status))
def test_endless_run_never_ends(status, mission, zones, record):
    zones.select_next_zone()
    record.base_reached()
    ending = EndCondition(Until.FOREVER, mission)
    assert ending.after_tick(status, 1e9) is None
    assert ending.complete


def test_time_limit_ends_running_mission(mission):
    ending = EndCondition(Until.COMPLETE, mission, time_limit_sec=10.0)
    assert ending.after_tick(RUNNING, 10.0) is None
    result = ending.after_tick(RUNNING, 10.1)
    assert result is not None
    assert (result.achieved, result.reason) == (
        False,
        "The time limit of 0:10 has expired. a was not visited. The robot did not return to the base station.",
    )


def test_mission_that_completes_at_time_limit_is_complete(mission, zones, record):
    ending = EndCondition(Until.COMPLETE, mission, time_limit_sec=10.0)
    zones.select_next_zone()
    record.base_reached()
    result = ending.after_tick(SUCCESS, 11.0)
    assert result is not None
    assert result.achieved


class Unending(MissionRun):
    """A mission that overrides no method."""


@pytest.mark.parametrize("mission", [MissionRun(), Unending()])
def test_default_mission_has_no_shortfalls_and_is_never_complete(mission):
    ending = EndCondition(Until.FOREVER, mission)
    assert ending.shortfalls() == []
    assert not ending.complete


def test_default_summary_has_figures_and_shortfalls():
    class Patrol(MissionRun):
        def display(self):
            return Display(figures=[Figure("photos", 1, of=2)])

        def shortfalls(self):
            return ["The gate was not photographed."]

    assert default_summary(Patrol(), "failed", 61.0, 1).splitlines() == [
        "Summary: the run failed.",
        "  photos 1 of 2",
        "  duration: 1:01, 1 tick",
        "  missing: The gate was not photographed.",
    ]
