"""When a run is over."""

import pytest
from py_trees.common import Status

from sar_compiler.missions.search_and_rescue.ending import Ending, Until
from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager

SUCCESS, FAILURE, RUNNING = Status.SUCCESS, Status.FAILURE, Status.RUNNING


@pytest.fixture
def zones():
    return ZoneManager([{"id": "a", "x": 0.0, "y": 0.0, "yaw": 0.0}], {"x": 0.0, "y": 0.0, "yaw": 0.0})


@pytest.fixture
def record():
    return MissionRecord()


def test_a_mission_is_over_as_soon_as_it_is_complete(zones, record):
    ending = Ending(Until.COMPLETE, record, zones)
    assert ending.after_tick(RUNNING, 1.0) is None
    zones.advance()
    assert ending.after_tick(SUCCESS, 2.0) is None
    record.base_reached()
    verdict = ending.after_tick(SUCCESS, 3.0)
    assert verdict is not None
    assert (verdict.achieved, verdict.reason) == (True, "Mission complete.")


def test_a_mission_that_can_no_longer_become_complete_is_over(zones, record):
    ending = Ending(Until.COMPLETE, record, zones)
    record.survivor_found("a", 1.0, 2.0)
    record.base_reached()
    zones.advance()
    assert ending.after_tick(SUCCESS, 1.0) is None
    verdict = ending.after_tick(SUCCESS, 2.0)
    assert verdict is not None
    missing = "The base station did not acknowledge a survivor without a name in a at (1.00, 2.00)."
    assert ending.shortfalls() == [missing]
    assert (verdict.achieved, verdict.reason) == (
        False,
        f"No zone is left, and the tree idles at SUCCESS. {missing}",
    )


def test_a_tree_that_runs_again_in_between_is_not_over(zones, record):
    ending = Ending(Until.COMPLETE, record, zones)
    zones.advance()
    assert [ending.after_tick(status, 1.0) for status in (FAILURE, RUNNING, FAILURE)] == [None] * 3
    assert ending.after_tick(FAILURE, 2.0) is not None


def test_a_tree_that_fails_while_zones_remain_goes_on(zones, record):
    ending = Ending(Until.COMPLETE, record, zones)
    assert [ending.after_tick(FAILURE, 1.0) for _ in range(5)] == [None] * 5


@pytest.mark.parametrize(("until", "wanted"), [(Until.SUCCESS, SUCCESS), (Until.FAILURE, FAILURE)])
def test_a_run_until_a_status_of_the_root_ends_with_it_and_no_other(until, wanted):
    ending = Ending(until)
    for status in (RUNNING, SUCCESS, FAILURE):
        verdict = ending.after_tick(status, 1.0)
        assert (verdict is not None) == (status == wanted)
        assert verdict is None or verdict.achieved


@pytest.mark.parametrize("status", list(Status))
def test_a_run_without_end_never_ends(status, zones, record):
    zones.advance()
    record.base_reached()
    ending = Ending(Until.FOREVER, record, zones)
    assert ending.after_tick(status, 1e9) is None
    assert ending.complete


def test_the_time_limit_ends_what_is_not_over_by_itself(zones, record):
    ending = Ending(Until.COMPLETE, record, zones, time_limit_sec=10.0)
    assert ending.after_tick(RUNNING, 10.0) is None
    verdict = ending.after_tick(RUNNING, 10.1)
    assert verdict is not None
    assert (verdict.achieved, verdict.reason) == (False, "The time limit of 10 s was reached.")


def test_a_mission_that_completes_at_the_limit_is_complete(zones, record):
    ending = Ending(Until.COMPLETE, record, zones, time_limit_sec=10.0)
    zones.advance()
    record.base_reached()
    verdict = ending.after_tick(SUCCESS, 11.0)
    assert verdict is not None
    assert verdict.achieved


def test_a_tree_of_another_kind_lacks_nothing_and_is_never_complete():
    ending = Ending(Until.FOREVER)
    assert ending.shortfalls() == []
    assert not ending.complete
