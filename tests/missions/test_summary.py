"""Tests of the summary of a mission."""

from search_and_rescue.record import MissionRecord
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager

POSE = {"x": 0.0, "y": 0.0, "yaw": 0.0}


def test_summary_lists_everything_that_is_missing():
    search = Search(ZoneManager([{"id": "a", **POSE}, {"id": "b", **POSE}], POSE))
    zones, record = search.context[ZoneManager], search.context[MissionRecord]
    zones.select_next_zone()
    record.zone_searched("a", (1.0, 2.0))
    record.survivor_named("survivor_1", 1.0, 2.0)
    assert search.summary(12.34, 7) == (
        "Summary: the mission is incomplete.\n"
        "  zones visited:   1 of 2 (a)\n"
        "  survivors found: survivor_1 in a at (1.00, 2.00), NOT acknowledged\n"
        "  back at base:    no\n"
        "  duration:        0:12, 7 ticks\n"
        "  missing:         b was not visited.\n"
        "  missing:         The base station did not acknowledge survivor_1 in a at (1.00, 2.00).\n"
        "  missing:         The robot did not return to the base station."
    )


def test_summary_states_that_no_survivor_was_found():
    search = Search(ZoneManager([], POSE))
    record = search.context[MissionRecord]
    record.base_reached()
    assert search.summary(0.0, 1).splitlines()[:3] == [
        "Summary: the mission is complete.",
        "  zones visited:   0 of 0",
        "  survivors found: none",
    ]


def test_summary_of_complete_mission_names_unsearched_zone():
    search = Search(ZoneManager([{"id": "a", **POSE}, {"id": "b", **POSE}], POSE))
    search.zones.select_next_zone()
    search.record.zone_searched("b", None)
    search.zones.select_next_zone()
    search.record.base_reached()
    assert search.open_points() == ["a was visited, not searched."]
    assert search.summary(0.0, 1).splitlines()[:3] == [
        "Summary: the mission is complete.",
        "  zones visited:   2 of 2 (a, b)",
        "  visited, not searched: a",
    ]
