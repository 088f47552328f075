"""Tests of the record of a mission."""

import pytest

from sar_compiler.missions import Journal, JournalEntry
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.context import preview_of
from search_and_rescue.record import (
    DetectionVerdict,
    FoundSurvivor,
    MissionRecord,
    SurvivorReport,
)
from search_and_rescue.search import Search
from search_and_rescue.search_theory import Ground, SearchExpectation
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import MapPose, ZoneManager


@pytest.fixture
def search() -> Search:
    plan = [{"id": "zone_a", "x": 0, "y": 0, "yaw": 0}, {"id": "zone_b", "x": 1, "y": 0, "yaw": 0}]
    return Search(ZoneManager(plan, {"x": 0, "y": 0, "yaw": 0}))


@pytest.fixture
def zones(search: Search) -> ZoneManager:
    return search.zones


@pytest.fixture
def record(search: Search) -> MissionRecord:
    return search.record


def visit_everything(record: MissionRecord, zones: ZoneManager) -> None:
    while zones.has_remaining():
        zone_id = zones.current_zone()["id"]
        record.zone_started(zone_id)
        zones.select_next_zone()


def test_finished_mission_has_no_shortfalls(record: MissionRecord, zones: ZoneManager) -> None:
    visit_everything(record, zones)
    record.zone_searched("zone_b", (1.0, 2.0))
    record.survivor_named("survivor_1", 1.0, 2.0)
    record.record_acknowledgement("survivor_1")
    record.base_reached()
    assert record.shortfalls(zones) == []
    assert record.zones_visited == ("zone_a", "zone_b")
    assert record.survivors == (FoundSurvivor("zone_b", 1.0, 2.0, "survivor_1", acknowledged=True),)
    assert record.home


def test_shortfalls_are_sentences(record: MissionRecord, zones: ZoneManager) -> None:
    zones.select_next_zone()
    record.zone_searched("zone_a", (-2.5, 3.2))
    record.survivor_named("survivor_1", -2.5, 3.2)
    record.zone_searched("zone_a", (0.0, 0.0))
    assert record.shortfalls(zones) == [
        "zone_b was not visited.",
        "The base station did not acknowledge survivor_1 in zone_a at (-2.50, 3.20).",
        "The base station did not acknowledge a survivor without a name in zone_a at (0.00, 0.00).",
        "The robot did not return to the base station.",
    ]


def test_abandoned_zone_is_a_shortfall(record: MissionRecord, zones: ZoneManager) -> None:
    zones.abandon()
    visit_everything(record, zones)
    record.base_reached()
    assert [zone["id"] for zone in zones.abandoned_zones()] == ["zone_a"]
    assert record.shortfalls(zones) == ["zone_a was abandoned after attempt 1."]


def test_zones_with_same_shortfall_share_a_sentence() -> None:
    plan = [{"id": f"zone_{letter}", "x": 0, "y": 0, "yaw": 0} for letter in "abcdef"]
    search = Search(ZoneManager(plan, {"x": 0, "y": 0, "yaw": 0}))
    search.zones.abandon("the operator has skipped it")
    for _ in range(3):
        search.zones.abandon("the battery is low")
    assert search.shortfalls()[:3] == [
        "zone_e and zone_f were not visited.",
        "zone_a was abandoned: the operator has skipped it.",
        "zone_b, zone_c and zone_d were abandoned: the battery is low.",
    ]


def test_report_is_stored_until_acknowledged(record: MissionRecord) -> None:
    record.zone_searched("zone_a", (1.0, 2.0))
    record.survivor_named("survivor_1", 1.0, 2.0)
    record.report_kept(SurvivorReport("survivor_1", 1.0, 2.0))
    assert [known.kept for known in record.survivors] == [True]
    record.record_acknowledgement("survivor_1")
    assert [known.kept for known in record.survivors] == [False]
    assert record.survivors[0].acknowledged


def test_start_of_zone_ends_being_home(record: MissionRecord) -> None:
    record.base_reached()
    record.zone_started("zone_a")
    assert not record.home


def test_survivor_found_again_at_same_position_is_the_same(record: MissionRecord) -> None:
    record.zone_searched("zone_a", (1.0, 2.0))
    record.survivor_named("survivor_1", 1.0, 2.0)
    record.zone_searched("zone_a", (1.0, 2.0))
    record.survivor_named("survivor_2", 1.0, 2.0)
    record.record_acknowledgement("survivor_2")
    assert record.survivors == (FoundSurvivor("zone_a", 1.0, 2.0, "survivor_2", acknowledged=True),)


def test_name_goes_to_survivor_at_its_position(record: MissionRecord) -> None:
    record.zone_searched("zone_a", (1.0, 2.0))
    record.zone_searched("zone_b", (3.0, 4.0))
    record.survivor_named("survivor_1", 1.0, 2.0)
    assert [survivor.survivor_id for survivor in record.survivors] == ["survivor_1", None]


def test_named_survivor_without_search_is_recorded(record: MissionRecord) -> None:
    record.survivor_named("survivor_1", 1.0, 2.0)
    assert str(record.survivors[0]) == "survivor_1 at (1.00, 2.00)"


def test_acknowledgement_of_unknown_survivor_changes_nothing(record: MissionRecord) -> None:
    record.zone_searched("zone_a", (1.0, 2.0))
    record.record_acknowledgement("survivor_9")
    assert not record.survivors[0].acknowledged


def test_mission_record_has_a_preview() -> None:
    assert isinstance(preview_of(MissionRecord), MissionRecord)


def detect_survivor_after(journal: Journal, search: Search, seconds: float) -> None:
    """Begin a search at 50 s of its clock, and detect a survivor the given number of seconds later."""
    journal.clock = clock = ManualClock()
    search.use_journal(journal)
    clock.advance(50.0)
    journal.begin({}, {})
    clock.advance(seconds)
    search.record.zone_searched("zone_a", (1.0, 2.0))


def test_first_detection_is_timed_from_mission_start(search: Search) -> None:
    assert search.record.first_detection_sec is None
    detect_survivor_after(Journal(), search, 12.5)
    search.record.zone_searched("zone_b", (3.0, 4.0))
    assert search.record.first_detection_sec == 12.5


def test_rejected_survivor_is_not_the_first_detection(search: Search) -> None:
    detect_survivor_after(Journal(), search, 12.5)
    search.record.survivor_named("survivor_1", 1.0, 2.0)
    search.record.survivor_judged("survivor_1", DetectionVerdict.REJECTED)
    assert search.record.first_detection_sec is None


def test_detection_in_later_run_is_timed_by_wall_clock(search: Search) -> None:
    for number, kind, run, wall, data in (
        (1, "run_began", 1, 1000.0, {}),
        (2, "run_ended", 1, 1030.0, {}),
        (3, "run_began", 2, 1060.0, {}),
        (4, "zone_searched", 2, 1100.0, {"zone": "zone_a", "survivor": (1.0, 2.0)}),
    ):
        search.apply(JournalEntry(number, run, wall, 5.0, kind, data))
    assert search.record.first_detection_sec == 100.0


def test_first_detection_is_displayed_only_with_probabilities() -> None:
    shown = {}
    for name, areas in (("without", {}), ("with", {"zone_a": SearchExpectation(0.5, 0.8)})):
        plan = [{"id": "zone_a", "x": 0.0, "y": 0.0, "yaw": 0.0}]
        search = Search(ZoneManager(plan, {"x": 0.0, "y": 0.0, "yaw": 0.0}, areas=areas))
        detect_survivor_after(Journal(), search, 12.5)
        shown[name] = [each.text for each in search.display().figures if "first" in each.name]
    assert shown == {"without": [], "with": ["first detection after 12.5 s"]}


def test_swept_distance_and_seen_area_are_displayed_only_with_polygon() -> None:
    plan = [{"id": "zone_a", "x": 0.0, "y": 0.0, "yaw": 0.0}]
    ground = Ground(((0.0, 0.0), (8.0, 0.0), (8.0, 8.0)), sweep_width=4.0, detection_range=2.5)
    sweeps = SweepStates({"zone_a": ground})
    sweeps.plan("zone_a", "parallel", 4.0, [MapPose(x=6.0, y=2.0, yaw=0.0)])
    sweeps.drive("zone_a", [(3.0, 1.0), (6.0, 1.0)], None)
    sweeps.finish_piece("zone_a", None, 0.6)
    base = {"x": 0.0, "y": 0.0, "yaw": 0.0}
    with_outline, without = Search(ZoneManager(plan, base), sweeps=sweeps), Search(ZoneManager(plan, base))
    shown = [[each.text for each in search.display().figures] for search in (with_outline, without)]
    assert shown[0] == [*shown[1], "swept 3 m", "seen 21 of 31 m²"]


def test_resent_report_is_an_operator_task_until_acknowledged() -> None:
    search = Search(
        ZoneManager([{"id": "zone_a", "x": 0.0, "y": 0.0, "yaw": 0.0}], {"x": 0.0, "y": 0.0, "yaw": 0.0})
    )
    search.use_journal(Journal())

    def task() -> str:
        [survivor] = [each for each in search.display().landmarks if each.kind == "survivor"]
        return survivor.task

    search.record.zone_searched("zone_a", (1.0, 2.0))
    search.record.survivor_named("survivor_1", 1.0, 2.0)
    search.record.report_sent("survivor_1")
    assert task() == ""
    search.record.report_sent("survivor_1")
    assert task() == "Report survivor_1 yourself: the base station does not acknowledge the report"
    search.record.record_acknowledgement("survivor_1")
    assert task() == ""
