"""Tests of the state and display of a search, computed from its events."""

from pathlib import Path
from typing import Any

import pytest

from sar_compiler.journal.display import Level
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import OF_EVERY_MISSION, JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from search_and_rescue import search_events
from search_and_rescue.record import DetectionVerdict, MissionRecord, SurvivorReport
from search_and_rescue.search import Search
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import Geofence, ZoneManager


@pytest.fixture
def search() -> Search:
    plan = [{"id": name, "x": float(x), "y": 0.0, "yaw": 0.0} for x, name in enumerate("abcd")]
    return Search(ZoneManager(plan, {"x": 9.0, "y": 9.0, "yaw": 0.0}))


def displayed_states(search: Search, kind: str) -> list[tuple[Any, ...]]:
    return [(each.name, each.state, each.level) for each in search.display().landmarks if each.kind == kind]


def test_every_event_of_search_has_a_sentence() -> None:
    from search_and_rescue.search import _SENTENCES

    handled = {*MissionRecord._HANDLERS, *SweepStates._HANDLERS, *ZoneManager._HANDLERS}
    # The journal itself has the sentences of these events.
    assert handled - {*OF_EVERY_MISSION} == set(_SENTENCES) - {search_events.COMMAND_GIVEN}
    declared = {value for name, value in vars(search_events).items() if name.isupper()}
    assert declared == set(_SENTENCES)


@pytest.mark.parametrize("is_resumed", [False, True])
def test_unknown_event_is_rejected_on_write_and_on_resume(
    search: Search, tmp_path: Path, is_resumed: bool
) -> None:
    place = tmp_path / "search.journal"
    journal = open_journal(place)
    if is_resumed:  # as if a newer version had written it
        journal.begin({}, {})
        journal.record_event("zone_flooded", zone="a")
        journal.close()
        journal = open_journal(place, resume=True)
        with pytest.raises(JournalError, match="this version does not support the event 'zone_flooded'"):
            search.use_journal(journal)
    else:
        search.use_journal(journal)
        journal.begin({}, {})
        with pytest.raises(ValueError, match="this version does not support the event 'zone_flooded'"):
            journal.record_event("zone_flooded", zone="a")
        assert [each for each in journal.earlier_events() if each.kind == "zone_flooded"] == []
    journal.close()


@pytest.mark.parametrize("kind", OF_EVERY_MISSION)
def test_events_of_every_mission_do_not_change_search(search: Search, kind: str) -> None:
    before = search.display()
    search.apply(JournalEntry(1, 1, 0.0, 0.0, kind, {"numbers": {}}))
    assert search.display() == before


def test_zones_have_states(search: Search) -> None:
    search.record.zone_searched("a", None)
    search.zones.select_next_zone()
    search.zones.abandon("the operator has skipped it")
    search.record.zone_started("c")
    assert displayed_states(search, "zone") == [
        ("a", "visited", Level.DONE),
        ("b", "abandoned", Level.GIVEN_UP),
        ("c", "under way", Level.IN_HAND),
        ("d", "open", Level.TO_COME),
    ]
    search.record.zone_searched("c", None)
    assert displayed_states(search, "zone")[2] == ("c", "searched", Level.IN_HAND)
    search.zones.postpone()
    assert displayed_states(search, "zone")[2] == ("c", "postponed", Level.TO_COME)


def test_abandoned_zone_states_reason(search: Search) -> None:
    search.record.zone_started("a")
    search.zones.abandon()
    search.zones.abandon("the operator has skipped it")
    reasons = [each.reason for each in search.display().landmarks if each.kind == "zone"]
    assert reasons == ["after attempt 1", "the operator has skipped it", "", ""]


def test_unsearched_zone_is_not_done(search: Search) -> None:
    search.zones.select_next_zone()
    search.record.zone_searched("b", None)
    search.zones.abandon()
    assert displayed_states(search, "zone")[:2] == [
        ("a", "visited, not searched", Level.GIVEN_UP),
        ("b", "searched, abandoned", Level.DONE),
    ]


def test_survivors_have_states(search: Search) -> None:
    record = search.record
    for x, name in ((1.0, "survivor_1"), (20.0, "survivor_2"), (40.0, "survivor_3")):
        record.zone_searched("a", (x, 1.0))
        record.survivor_named(name, x, 1.0)
    record.record_acknowledgement("survivor_1")
    record.survivor_judged("survivor_2", DetectionVerdict.REJECTED)
    record.report_kept(SurvivorReport("survivor_3", 40.0, 1.0))
    record.zone_searched("a", (60.0, 1.0))
    assert displayed_states(search, "survivor") == [
        ("survivor_1", "candidate", Level.DONE),
        ("survivor_2", "rejected", Level.GIVEN_UP),
        ("survivor_3", "candidate", Level.IN_HAND),
        ("find 4", "candidate", Level.IN_HAND),
    ]
    details = [each.details.get("report") for each in search.display().landmarks if each.kind == "survivor"]
    assert details == ["acknowledged", "not sent", "kept", "not sent"]


def test_nearby_unnamed_detections_stay_separate(search: Search) -> None:
    for y in (0.0, 0.001):
        search.record.zone_searched("a", (1.0, y))
    assert [name for name, *_ in displayed_states(search, "survivor")] == ["find 1", "find 2"]


def test_base_station_is_done_while_robot_is_there(search: Search) -> None:
    search.record.base_reached()
    assert displayed_states(search, "base") == [("base station", "home", Level.DONE)]
    search.record.zone_started("a")
    assert displayed_states(search, "base") == [("base station", "", Level.TO_COME)]


def test_geofence_is_displayed_with_its_corners() -> None:
    corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0)]
    search = Search(ZoneManager([], {"x": 0.0, "y": 0.0, "yaw": 0.0}), fence=Geofence(corners))
    assert [tuple(each.corners) for each in search.display().landmarks if each.kind == "geofence"] == [
        tuple(corners)
    ]


def test_figures_state_progress(search: Search) -> None:
    search.zones.select_next_zone()
    search.record.zone_searched("b", (1.0, 2.0))
    assert [each.text for each in search.display().figures] == [
        "zones visited 1 of 4",
        "survivors found 1",
        "survivors reported 0",
    ]


def test_phase_is_held_while_operator_pauses_mission(search: Search) -> None:
    search.record.zone_started("a")
    search.orders.record("pause")
    assert search.display().phase == ("held", "by the operator", "a")
    search.orders.record("resume")
    assert search.display().phase == ("", "", "a")


@pytest.mark.parametrize(
    ("kind", "data", "sentence"),
    [
        ("zone_started", {"zone": "a"}, "set out for a"),
        ("zone_searched", {"zone": "a", "survivor": None}, "searched a: no survivor"),
        ("zone_searched", {"zone": "a", "survivor": [1.0, 2.0]}, "searched a: survivor at (1.00, 2.00)"),
        ("zone_abandoned", {"zone": "a", "attempts": 3, "reason": ""}, "a was abandoned after attempt 3"),
        ("zone_abandoned", {"zone": "a", "attempts": 1, "reason": "low"}, "a was abandoned: low"),
        (
            "survivor_named",
            {"survivor": "survivor_1", "x": 1.0, "y": 2.0},
            "named survivor_1 at (1.00, 2.00)",
        ),
        ("command_given", {"command": "pause", "by": "Ann"}, "Ann: pause"),
        ("base_reached", {}, "reached the base station"),
    ],
)
def test_event_is_a_sentence(search: Search, kind: str, data: dict[str, Any], sentence: str) -> None:
    assert search.sentence(JournalEntry(1, 1, 0.0, 0.0, kind, data)) == sentence


def test_no_zone_is_under_way_after_end_of_run(search: Search, tmp_path: Path) -> None:
    journal = open_journal(tmp_path / "mission.journal")
    search.use_journal(journal)
    journal.begin({}, {})
    search.record.zone_started("a")
    from sar_compiler.journal.journal_entries import Ending

    journal.end_run(Ending.STOPPED, 130)
    journal.close()
    assert displayed_states(search, "zone")[0] == ("a", "open", Level.TO_COME)
