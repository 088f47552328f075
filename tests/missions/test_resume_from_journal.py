"""Tests of resuming search and rescue from its journal: after a crash at any point, the next run has the same state."""

import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from sar_compiler.journal.display import DisplayState, Landmark
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import CHANGED, JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.json_values import json_text, json_value
from sar_compiler.missions.parameter_reader import ParameterReader
from search_and_rescue.operator_commands import OperatorCommands
from search_and_rescue.plugin import MISSION
from search_and_rescue.record import (
    DetectionVerdict,
    MissionRecord,
    StoredReports,
    SurvivorReport,
)
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import Zone, ZoneManager

ZONES = ("zone_a", "zone_b", "zone_c")
PARAMETERS: dict[str, Any] = {
    "zone_order": list(ZONES),
    **{f"zones.{zone}.{key}": 1.0 for zone in ZONES for key in ("x", "y", "yaw")},
    **{f"base_station.{key}": 0.0 for key in ("x", "y", "yaw")},
}


def known_landmark(landmark: Landmark) -> Landmark:
    """Return a landmark without unknown details."""
    known = {key: value for key, value in landmark.details.items() if value not in (None, "")}
    return landmark._replace(details=known)


class MissionProcess:
    """One run of the mission with its journal, as in one process."""

    def __init__(self, place: Path, *, resume: bool) -> None:
        self.journal = open_journal(place, resume=resume)
        self.situation = DisplayState()
        self.journal.add_listener(self.on_entry)
        self.run: Search = MISSION.begin(ParameterReader(PARAMETERS))
        self.run.use_journal(self.journal)
        self.journal.begin({"mission": MISSION.name}, {})
        self.zones: ZoneManager = self.part(ZoneManager)
        self.record: MissionRecord = self.part(MissionRecord)
        self.kept: StoredReports = self.part(StoredReports)
        self.orders: OperatorCommands = self.part(OperatorCommands)

    def on_entry(self, entry: JournalEntry) -> None:
        if entry.kind == CHANGED:
            self.situation.apply(**json_value(json_text(entry.data)))

    def part(self, kind: type) -> Any:
        return self.run.context[kind]

    def state(self) -> dict[str, Any]:
        """Return the state that leaves can read."""
        return {
            "left": self.zones.remaining_zones(),
            "abandoned": self.zones.abandoned_zones(),
            "attempts": self.zones.times_postponed() if self.zones.has_remaining() else 0,
            "visited": self.record.zones_visited,
            "survivors": self.record.survivors,
            "kept": list(self.kept),
            "home": self.record.home,
            "alarm": self.record.alarm,
            "orders": (self.orders.held, self.orders.given),
            "shortfalls": self.run.shortfalls(),
        }

    def crash(self) -> None:
        """End as after SIGKILL: data that is not on the disk is lost."""
        assert self.journal._file is not None
        self.journal._file.close()
        if self.journal._reserve is not None:
            self.journal._reserve.close(is_needed=True)


class CrashingMission(RuleBasedStateMachine):
    """Events of leaves in any order, with crashes in between."""

    @initialize()
    def begin(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.place = Path(self.folder.name) / "mission.journal"
        self.process = MissionProcess(self.place, resume=False)
        self.names: list[str] = []

    def teardown(self) -> None:
        if hasattr(self, "process"):
            self.process.crash()
            self.folder.cleanup()

    @property
    def zone(self) -> str:
        return self.process.zones.current_zone()["id"]

    @precondition(lambda self: self.process.zones.has_remaining())
    @rule()
    def drive(self) -> None:
        self.process.record.zone_started(self.zone)

    @precondition(lambda self: self.process.zones.has_remaining())
    @rule(found=st.booleans(), x=st.floats(-5, 5), y=st.floats(-5, 5))
    def search(self, found: bool, x: float, y: float) -> None:
        self.process.record.zone_searched(self.zone, (x, y) if found else None)

    @rule()
    def name(self) -> None:
        nameless = [each for each in self.process.record.survivors if each.survivor_id is None]
        if nameless:
            name = self.process.zones.next_survivor_id()
            assert name not in self.names
            self.names.append(name)
            self.process.record.survivor_named(name, nameless[0].x, nameless[0].y)

    @rule(acknowledged=st.booleans())
    def report(self, acknowledged: bool) -> None:
        for survivor in self.process.record.survivors:
            if survivor.survivor_id is not None and not survivor.acknowledged:
                self.process.record.report_sent(survivor.survivor_id)
                if acknowledged:
                    self.process.record.record_acknowledgement(survivor.survivor_id)
                else:
                    report = SurvivorReport(survivor.survivor_id, survivor.x, survivor.y)
                    self.process.record.report_kept(report)
                return

    @precondition(lambda self: self.process.zones.has_remaining())
    @rule(how=st.sampled_from(["visited", "postponed", "abandoned", "given up"]))
    def leave(self, how: str) -> None:
        if how == "visited":
            self.process.zones.select_next_zone()
        elif how == "postponed":
            self.process.zones.postpone()
        elif how == "given up":
            self.process.zones.abandon("the battery is low")
        else:
            self.process.zones.abandon()

    @rule(x=st.floats(-5, 5))
    def add_zone(self, x: float) -> None:
        name = f"zone_{self.process.zones.total_zones()}"
        self.process.zones.add(Zone(id=name, x=x, y=0.0, yaw=1.0))

    @rule(verb=st.sampled_from(["pause", "resume", "go_home", "abort"]))
    def order(self, verb: str) -> None:
        self.process.orders.record(verb)

    @rule(reason=st.sampled_from(["the battery is low", "time is up"]))
    def raise_an_alarm(self, reason: str) -> None:
        self.process.record.record_alarm(reason)

    @rule(verdict=st.sampled_from(DetectionVerdict))
    def judge(self, verdict: DetectionVerdict) -> None:
        if self.names:
            same_as = self.names[0] if verdict is DetectionVerdict.MERGED else None
            self.process.record.survivor_judged(self.names[-1], verdict, same_as)

    @rule()
    def come_home(self) -> None:
        self.process.record.base_reached()

    @rule()
    def crash_and_resume(self) -> None:
        before = self.process.state()
        self.process.crash()
        self.process = MissionProcess(self.place, resume=True)
        assert self.process.state() == before

    @invariant()
    def display_matches_journal_entries(self) -> None:
        if hasattr(self, "process"):
            shown, situation = self.process.run.display(), self.process.situation
            assert situation.landmarks == {
                (each.kind, each.name): known_landmark(each) for each in shown.landmarks
            }
            assert list(situation.figures.values()) == list(shown.figures)
            assert situation.phase == shown.phase

    @invariant()
    def survivor_names_are_unique(self) -> None:
        if hasattr(self, "process"):
            given = [each.survivor_id for each in self.process.record.survivors if each.survivor_id]
            assert len(given) == len(set(given))


TestCrashingMission = CrashingMission.TestCase


@pytest.fixture
def start_process(tmp_path: Path) -> Callable[..., MissionProcess]:
    def begin(*, resume: bool = False) -> MissionProcess:
        return MissionProcess(tmp_path / "mission.journal", resume=resume)

    return begin


def test_search_of_current_zone_is_reused_once(start_process: Callable[..., MissionProcess]) -> None:
    process = start_process()
    process.record.zone_searched("zone_a", (1.0, 2.0))
    process.crash()
    before = start_process(resume=True).record.before
    assert before.has_searched("zone_a")
    assert before.pop_search("zone_a") == (1.0, 2.0)
    assert not before.has_searched("zone_a")


def test_search_of_left_zone_is_not_reused(start_process: Callable[..., MissionProcess]) -> None:
    process = start_process()
    process.record.zone_searched("zone_a", None)
    process.zones.select_next_zone()
    process.crash()
    assert not start_process(resume=True).record.before.has_searched("zone_a")


def test_return_is_not_reused_after_start_of_a_zone(start_process: Callable[..., MissionProcess]) -> None:
    process = start_process()
    process.record.base_reached()
    process.crash()
    process = start_process(resume=True)
    assert process.record.home
    process.record.zone_started("zone_a")
    assert not process.record.before.pop_home()
    process.crash()
    assert not start_process(resume=True).record.before.pop_home()


def test_names_from_elsewhere_do_not_affect_numbering(start_process: Callable[..., MissionProcess]) -> None:
    process = start_process()
    process.record.survivor_named("anna", 1.0, 2.0)
    process.record.survivor_named(process.zones.next_survivor_id(), 3.0, 4.0)
    process.crash()
    assert start_process(resume=True).zones.next_survivor_id() == "survivor_2"


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("zone_visited", {"zone": "zone_x"}),
        ("zone_visited", {}),
        ("zone_abandoned", {"zone": "zone_a", "attempts": "many", "reason": ""}),
        ("zone_searched", {"zone": "zone_a", "survivor": [1.0]}),
        ("report_kept", {"survivor": "survivor_7"}),
        ("survivor_named", {"survivor": 7, "x": 1.0, "y": 2.0}),
        ("command_given", {"command": "dance", "by": "Ann"}),
        ("survivor_judged", {"survivor": "survivor_1", "standing": "tired", "same_as": None}),
    ],
)
def test_inconsistent_event_is_rejected_with_its_number(
    start_process: Callable[..., MissionProcess], tmp_path: Path, kind: str, data: dict[str, Any]
) -> None:
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({"mission": MISSION.name}, {})
    journal.record_event(kind, **data)
    journal.close()
    with pytest.raises(JournalError, match=f"event 1 of the journal, {kind}"):
        start_process(resume=True)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from([*ZONES, "survivor_1", ""]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["x", "y"]), inner),
    max_leaves=4,
)
KEYS = st.sampled_from(
    [
        *("id", "zone", "survivor", "x", "y", "yaw", "attempts", "goal"),
        *("reason", "standing", "same_as", "order"),
    ]
)
KINDS = st.sampled_from(
    (
        *(
            "zone_started",
            "zone_searched",
            "zone_visited",
            "zone_postponed",
            "zone_abandoned",
            "survivor_named",
        ),
        *("report_sent", "report_acknowledged", "report_kept", "base_reached", "goal_sent", "nonsense"),
        *("zone_added", "area_drawn", "command_given", "survivor_judged", "alarmed"),
    )
)


@given(st.lists(st.tuples(KINDS, st.dictionaries(KEYS, ANYTHING, max_size=3)), max_size=6))
def test_arbitrary_events_are_applied_or_rejected(
    facts: list[tuple[str, dict[str, Any]]],
) -> None:
    run = MISSION.begin(ParameterReader(PARAMETERS))
    entries = [JournalEntry(number, 1, 0.0, 0.0, *fact) for number, fact in enumerate(facts, 1)]
    journal = Journal()
    journal.earlier_events = lambda: entries  # type: ignore[method-assign]
    with suppress(JournalError):
        run.use_journal(journal)
        run.shortfalls()


def test_events_of_other_kinds_are_ignored(start_process: Callable[..., MissionProcess]) -> None:
    process = start_process()
    process.journal.record_event("goal_sent", action="/navigate_to_pose", goal="00")
    state = process.state()
    process.crash()
    assert start_process(resume=True).state() == state


def test_run_works_with_journal_in_memory() -> None:
    run = MISSION.begin(ParameterReader(PARAMETERS))
    run.use_journal(Journal())
    run.context[MissionRecord].base_reached()
    assert run.context[MissionRecord].home


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("zone_searched", {"zone": "zone_a", "survivor": [float("nan"), 1.0]}),
        ("zone_searched", {"zone": "zone_a", "survivor": [None, 1.0]}),
        ("survivor_named", {"survivor": "survivor_1", "x": 1.0, "y": float("inf")}),
        ("zone_added", {"id": "zone_z", "x": float("-inf"), "y": 0.0, "yaw": 0.0}),
        ("area_drawn", {"zone": "zone_z", "x": 0.0, "y": float("nan"), "yaw": 0.0}),
    ],
)
def test_event_with_invalid_position_is_rejected(kind: str, data: dict[str, Any]) -> None:
    journal = Journal()
    journal.earlier_events = lambda: [JournalEntry(1, 1, 0.0, 0.0, kind, data)]  # type: ignore[method-assign]
    with pytest.raises(JournalError, match="contradicts the events before it: "):
        MISSION.begin(ParameterReader(PARAMETERS)).use_journal(journal)


def test_numbers_of_lost_events_are_not_reused() -> None:
    journal, run = Journal(), MISSION.begin(ParameterReader(PARAMETERS))
    lost = {"count": 5, "numbers": {"survivor": 7}}
    journal.earlier_events = lambda: [JournalEntry(1, 1, 0.0, 0.0, "facts_lost", lost)]  # type: ignore[method-assign]
    run.use_journal(journal)
    assert run.context[ZoneManager].next_survivor_id() == "survivor_8"
