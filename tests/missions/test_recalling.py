"""Search and rescue and its journal: whatever has happened when the process dies, the next run knows it."""

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


def seen(landmark: Landmark) -> Landmark:
    """Return a landmark without the details that nobody knows."""
    known = {key: value for key, value in landmark.details.items() if value not in (None, "")}
    return landmark._replace(details=known)


class Life:
    """One run of the mission, a process as it were, with its journal."""

    def __init__(self, place: Path, *, resume: bool) -> None:
        self.journal = open_journal(place, resume=resume)
        self.situation = DisplayState()
        self.journal.add_listener(self.take)
        self.run: Search = MISSION.begin(ParameterReader(PARAMETERS))
        self.run.use_journal(self.journal)
        self.journal.begin({"mission": MISSION.name}, {})
        self.zones: ZoneManager = self.part(ZoneManager)
        self.record: MissionRecord = self.part(MissionRecord)
        self.kept: StoredReports = self.part(StoredReports)
        self.orders: OperatorCommands = self.part(OperatorCommands)

    def take(self, entry: JournalEntry) -> None:
        if entry.kind == CHANGED:
            self.situation.apply(**json_value(json_text(entry.data)))

    def part(self, kind: type) -> Any:
        return self.run.context[kind]

    def state(self) -> dict[str, Any]:
        """Everything that leaves can ask for."""
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

    def die(self) -> None:
        """End as by SIGKILL: what is not on the disk yet is lost."""
        assert self.journal._file is not None
        self.journal._file.close()
        if self.journal._reserve is not None:
            self.journal._reserve.close(is_needed=True)


class Dying(RuleBasedStateMachine):
    """What leaves do, in any order, with deaths in between."""

    @initialize()
    def begin(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.place = Path(self.folder.name) / "mission.journal"
        self.life = Life(self.place, resume=False)
        self.names: list[str] = []

    def teardown(self) -> None:
        if hasattr(self, "life"):
            self.life.die()
            self.folder.cleanup()

    @property
    def zone(self) -> str:
        return self.life.zones.current_zone()["id"]

    @precondition(lambda self: self.life.zones.has_remaining())
    @rule()
    def drive(self) -> None:
        self.life.record.zone_started(self.zone)

    @precondition(lambda self: self.life.zones.has_remaining())
    @rule(found=st.booleans(), x=st.floats(-5, 5), y=st.floats(-5, 5))
    def search(self, found: bool, x: float, y: float) -> None:
        self.life.record.zone_searched(self.zone, (x, y) if found else None)

    @rule()
    def name(self) -> None:
        nameless = [each for each in self.life.record.survivors if each.survivor_id is None]
        if nameless:
            name = self.life.zones.next_survivor_id()
            assert name not in self.names
            self.names.append(name)
            self.life.record.survivor_named(name, nameless[0].x, nameless[0].y)

    @rule(acknowledged=st.booleans())
    def report(self, acknowledged: bool) -> None:
        for survivor in self.life.record.survivors:
            if survivor.survivor_id is not None and not survivor.acknowledged:
                self.life.record.report_sent(survivor.survivor_id)
                if acknowledged:
                    self.life.record.record_acknowledgement(survivor.survivor_id)
                else:
                    report = SurvivorReport(survivor.survivor_id, survivor.x, survivor.y)
                    self.life.record.report_kept(report)
                return

    @precondition(lambda self: self.life.zones.has_remaining())
    @rule(how=st.sampled_from(["visited", "postponed", "abandoned", "given up"]))
    def leave(self, how: str) -> None:
        if how == "visited":
            self.life.zones.select_next_zone()
        elif how == "postponed":
            self.life.zones.postpone()
        elif how == "given up":
            self.life.zones.abandon("the battery is low")
        else:
            self.life.zones.abandon()

    @rule(x=st.floats(-5, 5))
    def add_zone(self, x: float) -> None:
        name = f"zone_{self.life.zones.total_zones()}"
        self.life.zones.add(Zone(id=name, x=x, y=0.0, yaw=1.0))

    @rule(verb=st.sampled_from(["pause", "resume", "go_home", "abort"]))
    def order(self, verb: str) -> None:
        self.life.orders.record(verb)

    @rule(reason=st.sampled_from(["the battery is low", "time is up"]))
    def raise_an_alarm(self, reason: str) -> None:
        self.life.record.record_alarm(reason)

    @rule(verdict=st.sampled_from(DetectionVerdict))
    def judge(self, verdict: DetectionVerdict) -> None:
        if self.names:
            same_as = self.names[0] if verdict is DetectionVerdict.MERGED else None
            self.life.record.survivor_judged(self.names[-1], verdict, same_as)

    @rule()
    def come_home(self) -> None:
        self.life.record.base_reached()

    @rule()
    def die_and_resume(self) -> None:
        before = self.life.state()
        self.life.die()
        self.life = Life(self.place, resume=True)
        assert self.life.state() == before

    @invariant()
    def what_is_shown_is_what_the_entries_say(self) -> None:
        if hasattr(self, "life"):
            shown, situation = self.life.run.display(), self.life.situation
            assert situation.landmarks == {(each.kind, each.name): seen(each) for each in shown.landmarks}
            assert list(situation.figures.values()) == list(shown.figures)
            assert situation.phase == shown.phase

    @invariant()
    def nobody_has_two_names(self) -> None:
        if hasattr(self, "life"):
            given = [each.survivor_id for each in self.life.record.survivors if each.survivor_id]
            assert len(given) == len(set(given))


TestDying = Dying.TestCase


@pytest.fixture
def live(tmp_path: Path) -> Callable[..., Life]:
    def begin(*, resume: bool = False) -> Life:
        return Life(tmp_path / "mission.journal", resume=resume)

    return begin


def test_a_search_of_the_zone_that_was_not_left_is_answered_once(live: Callable[..., Life]) -> None:
    life = live()
    life.record.zone_searched("zone_a", (1.0, 2.0))
    life.die()
    before = live(resume=True).record.before
    assert before.has_searched("zone_a")
    assert before.pop_search("zone_a") == (1.0, 2.0)
    assert not before.has_searched("zone_a")


def test_a_search_of_a_zone_that_was_left_is_not_answered(live: Callable[..., Life]) -> None:
    life = live()
    life.record.zone_searched("zone_a", None)
    life.zones.select_next_zone()
    life.die()
    assert not live(resume=True).record.before.has_searched("zone_a")


def test_the_way_home_is_done_only_while_no_zone_was_set_out_for(live: Callable[..., Life]) -> None:
    life = live()
    life.record.base_reached()
    life.die()
    life = live(resume=True)
    assert life.record.home
    life.record.zone_started("zone_a")
    assert not life.record.before.pop_home()
    life.die()
    assert not live(resume=True).record.before.pop_home()


def test_names_of_somebody_elses_do_not_disturb_the_numbering(live: Callable[..., Life]) -> None:
    life = live()
    life.record.survivor_named("anna", 1.0, 2.0)
    life.record.survivor_named(life.zones.next_survivor_id(), 3.0, 4.0)
    life.die()
    assert live(resume=True).zones.next_survivor_id() == "survivor_2"


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
def test_facts_that_do_not_fit_are_refused_with_their_number(
    live: Callable[..., Life], tmp_path: Path, kind: str, data: dict[str, Any]
) -> None:
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({"mission": MISSION.name}, {})
    journal.record_event(kind, **data)
    journal.close()
    with pytest.raises(JournalError, match=f"event 1 of the journal, {kind}"):
        live(resume=True)


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
def test_facts_of_any_content_are_taken_over_or_refused_in_words(
    facts: list[tuple[str, dict[str, Any]]],
) -> None:
    run = MISSION.begin(ParameterReader(PARAMETERS))
    entries = [JournalEntry(number, 1, 0.0, 0.0, *fact) for number, fact in enumerate(facts, 1)]
    journal = Journal()
    journal.earlier_events = lambda: entries  # type: ignore[method-assign]
    with suppress(JournalError):
        run.use_journal(journal)
        run.shortfalls()


def test_facts_of_other_kinds_are_passed_over(live: Callable[..., Life]) -> None:
    life = live()
    life.journal.record_event("goal_sent", action="/navigate_to_pose", goal="00")
    state = life.state()
    life.die()
    assert live(resume=True).state() == state


def test_without_a_journal_nothing_is_written() -> None:
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
def test_a_fact_with_a_position_that_is_none_is_refused(kind: str, data: dict[str, Any]) -> None:
    journal = Journal()
    journal.earlier_events = lambda: [JournalEntry(1, 1, 0.0, 0.0, kind, data)]  # type: ignore[method-assign]
    with pytest.raises(JournalError, match="contradicts the events before it: "):
        MISSION.begin(ParameterReader(PARAMETERS)).use_journal(journal)


def test_numbers_that_lost_facts_have_given_are_not_given_again() -> None:
    journal, run = Journal(), MISSION.begin(ParameterReader(PARAMETERS))
    lost = {"count": 5, "numbers": {"survivor": 7}}
    journal.earlier_events = lambda: [JournalEntry(1, 1, 0.0, 0.0, "facts_lost", lost)]  # type: ignore[method-assign]
    run.use_journal(journal)
    assert run.context[ZoneManager].next_survivor_id() == "survivor_8"
