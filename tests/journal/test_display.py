"""Tests of a mission's display and of the journal entries that record its changes after events."""

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.journal.display import (
    Alarm,
    Display,
    DisplayState,
    EventTime,
    Figure,
    Gauge,
    Landmark,
    LandmarkKind,
    Level,
    MissionPhase,
    RasterLayer,
    changes,
    default_sentence,
    initial_display,
    with_author,
)
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import CHANGED, CommandAuthor, Ending, JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.json_values import json_text, json_value
from sar_compiler.missions.mission import MissionRun

WORDS = st.sampled_from(["", "a", "b", "c"])
NUMBERS = st.floats(-1e6, 1e6)
MOMENTS = st.builds(EventTime, st.integers(1, 3), NUMBERS, NUMBERS)
LANDMARKS = st.builds(
    Landmark,
    st.sampled_from(["zone", "survivor"]),
    st.sampled_from("pqrs"),
    NUMBERS,
    NUMBERS,
    WORDS,
    st.sampled_from(Level),
    WORDS,
    WORDS,
    st.booleans(),
    st.dictionaries(st.sampled_from(["found", "attempts"]), MOMENTS | st.integers(0, 9), max_size=2),
    st.lists(st.tuples(NUMBERS, NUMBERS), max_size=3).map(tuple),
    st.none() | st.floats(0.0, 1.0),
)


def without_duplicates(landmarks: list[Landmark]) -> list[Landmark]:
    return list({(each.kind, each.name): each for each in landmarks}.values())


DISPLAYS = st.builds(
    Display,
    st.lists(LANDMARKS, max_size=5).map(without_duplicates),
    st.lists(
        st.builds(Figure, WORDS, NUMBERS, of=st.none() | NUMBERS, least=st.none() | NUMBERS),
        max_size=3,
        unique_by=lambda each: each.name,
    ),
    st.lists(
        st.builds(Gauge, WORDS, NUMBERS, least=st.none() | NUMBERS),
        max_size=2,
        unique_by=lambda each: each.name,
    ),
    st.lists(st.builds(Alarm, WORDS), max_size=2, unique_by=lambda each: each.text),
    st.builds(MissionPhase, WORDS, WORDS, WORDS),
    st.lists(
        st.builds(
            RasterLayer.from_shares,
            WORDS,
            WORDS,
            NUMBERS,
            NUMBERS,
            st.floats(0.1, 9.0),
            st.lists(st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4), min_size=1, max_size=3),
        ),
        max_size=2,
        unique_by=lambda each: each.name,
    ),
)


def by_name(landmarks: Any) -> dict[tuple[str, str], Landmark]:
    return {(each.kind, each.name): each for each in landmarks}


@given(st.lists(DISPLAYS, min_size=1, max_size=6))
def test_applied_changes_reproduce_display(moments: list[Display]) -> None:
    situation, before = DisplayState(), Display()
    for shown in moments:
        situation.apply(**json_value(json_text(changes(before, shown))))
        before = shown
        assert situation.landmarks == by_name(shown.landmarks)
        assert set(shown.figures) <= set(situation.figures.values())
        assert set(shown.gauges) <= set(situation.gauges.values())
        assert set(shown.rasters) <= set(situation.rasters.values())
        assert situation.phase == shown.phase


def test_unchanged_display_has_no_changes() -> None:
    shown = Display([Landmark("zone", "a", 1.0, 2.0)], [Figure("zones", 1.0)])
    assert changes(shown, shown) == {}
    assert initial_display([LandmarkKind("zone", "zones")], shown) == {
        "kinds": [{"name": "zone", "plural": "zones"}],
        "landmarks": [{"kind": "zone", "name": "a", "x": 1.0, "y": 2.0}],
        "figures": [{"name": "zones", "value": 1.0}],
    }


@pytest.mark.parametrize(
    ("figure", "text"),
    [(Figure("zones", 3, of=4), "zones 3 of 4"), (Figure("way", 2.5, unit="m"), "way 2.5 m")],
)
def test_figure_has_text(figure: Figure, text: str) -> None:
    assert figure.text == text


@pytest.mark.parametrize("place", [(math.nan, 0.0), (None, 0.0), ("x", 0.0), (0.0, math.inf)])
def test_landmark_at_invalid_position_is_rejected(place: tuple[Any, Any]) -> None:
    with pytest.raises((TypeError, ValueError)):
        DisplayState().apply(landmarks=[{"kind": "zone", "name": "a", "x": place[0], "y": place[1]}])


@pytest.mark.parametrize("shade", [-0.1, 1.1, math.nan, "dark"])
def test_shade_outside_0_to_1_is_rejected(shade: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        DisplayState().apply(landmarks=[{"kind": "zone", "name": "a", "x": 0, "y": 0, "shade": shade}])


@pytest.mark.parametrize(
    "wrong",
    [
        {"figures": [{"name": "zones", "value": "3"}]},
        {"figures": [{"name": "zones", "value": 3, "of": "4"}]},
        {"gauges": [{"name": "battery", "value": [80]}]},
        {"gauges": [{"name": "battery", "value": 80, "least": "20"}]},
    ],
)
def test_figure_or_gauge_that_is_not_a_number_is_rejected(wrong: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match="is not a number"):
        DisplayState().apply(**wrong)


def test_cells_of_raster_layer_are_run_length_encoded_tenths() -> None:
    layer = RasterLayer.from_shares(
        "lawn", "mown", 1.0, 2.0, 0.25, [[0.0, 0.01, 0.1, 0.11], [0.9, 0.91, 1.0, 1.0]]
    )
    assert layer == RasterLayer("lawn", "mown", 1.0, 2.0, 0.25, 4, "-2abi3j")


@pytest.mark.parametrize(
    "wrong",
    [
        {"cells": "3a"},
        {"cells": "4k"},
        {"cells": ""},
        {"cells": "0a4a"},
        {"cells": "999998a"},
        {"columns": 0},
        {"columns": "4"},
        {"cell_m": 0.0},
        {"cell_m": math.nan},
        {"x": math.inf},
    ],
)
def test_invalid_raster_layer_is_rejected(wrong: dict[str, Any]) -> None:
    layer = RasterLayer("lawn", "mown", 0.0, 0.0, 0.25, 4, "4a2-2b")._asdict()
    DisplayState().apply(rasters=[layer])
    with pytest.raises((TypeError, ValueError)):
        DisplayState().apply(rasters=[{**layer, **wrong}])


def test_event_without_sentence_has_default_text() -> None:
    assert default_sentence("photo_taken", {"photo": "photo_1", "by": None}) == "photo taken: photo: photo_1"
    assert default_sentence("point_left", {}) == "point left"


class Count:
    """A mission state that counts up to three events."""

    def __init__(self) -> None:
        self.count = 0

    def apply(self, fact: JournalEntry) -> None:
        if fact.kind == "counted":
            if self.count == 3:
                message = "three is the end"
                raise ValueError(message)
            self.count += 1

    def display(self) -> Display:
        return Display(figures=[Figure("facts", self.count)])

    def sentence(self, fact: JournalEntry) -> str:
        return "one more" if fact.kind == "counted" else ""


def test_event_is_followed_by_entry_with_its_display_changes() -> None:
    journal, state, heard = Journal(), Count(), []
    journal.add_listener(lambda entry: heard.append((entry.kind, entry.data)))
    journal.attach(state)
    journal.record_event("counted")
    assert state.count == 1
    assert heard == [
        ("counted", {}),
        (CHANGED, {"said": "one more", "figures": [{"name": "facts", "value": 1}]}),
    ]


def test_display_changes_are_written_together_with_event(tmp_path: Path) -> None:
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.attach(Count())
    journal.begin({}, {})
    journal.record_event("counted")
    assert journal._file is not None
    journal._file.close()  # as by SIGKILL
    resumed = open_journal(place, resume=True)
    told = [(entry.kind, entry.data.get("figures")) for entry in resumed.earlier()]
    assert told[-2:] == [("counted", None), (CHANGED, [{"name": "facts", "value": 1}])]
    resumed.close()


def test_resumed_run_begins_with_complete_display(tmp_path: Path) -> None:
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.attach(Count())
    journal.begin({}, {})
    journal.record_event("counted")
    journal.end_run(Ending.STOPPED, 130)
    journal.close()
    journal, state, situation = open_journal(place, resume=True), Count(), DisplayState()
    journal.add_listener(lambda entry: situation.apply(**entry.data) if entry.kind == CHANGED else None)
    journal.attach(state)
    journal.begin({}, {})
    assert (state.count, situation.figures["facts"].value) == (1, 1)
    journal.close()


def test_contradictory_recorded_event_is_rejected_with_its_number(tmp_path: Path) -> None:
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.begin({}, {})
    for _ in range(4):
        journal.record_event("counted")
    journal.close()
    journal = open_journal(place, resume=True)
    with pytest.raises(
        JournalError,
        match=r"event 4 of the journal, counted .* contradicts the events before it: three is the end",
    ):
        journal.attach(Count())
    journal.close()


def test_contradictory_event_is_not_written(tmp_path: Path) -> None:
    place = tmp_path / "mission.journal"
    journal = open_journal(place)
    journal.attach(Count())
    journal.begin({}, {})
    for _ in range(3):
        journal.record_event("counted")
    with pytest.raises(ValueError, match="three is the end"):
        journal.record_event("counted")
    journal.close()
    journal = open_journal(place, resume=True)
    assert len(journal.earlier_events()) == 3
    journal.close()


@pytest.mark.parametrize(
    ("text", "by", "told"),
    [
        ("the operator: pause", "Ada", "Ada: pause"),
        ("by the operator", "Ada", "by Ada"),
        ("yard was added", "Ada", "Ada: yard was added"),
        ("the operator: pause", "", "the operator: pause"),
        ("the operator asks the operator", "Ada", "Ada asks the operator"),
    ],
)
def test_author_of_command_replaces_the_operator_in_text(text, by, told):
    assert with_author(text, CommandAuthor(by)) == told
    if by:
        assert with_author(text, CommandAuthor(by, "smoke")) == f"{told}: smoke"
        assert with_author(f"{told}: smoke", CommandAuthor(by, "smoke")) == f"{told}: smoke"


def test_raised_alarm_is_shown_beside_alarms_of_mission():
    journal, entries = Journal(), list[JournalEntry]()
    journal.add_listener(entries.append)

    class Mission(MissionRun):
        def display(self):
            return Display(alarms=[Alarm("the battery is low")])

    journal.attach(Mission())
    journal.begin({}, {})
    journal.raise_alarm("Property violated: p", "property_broken", property="p")
    journal.record_event("photo_taken")
    fact, changed = entries[2:4]
    assert (fact.kind, dict(fact.data)) == ("property_broken", {"property": "p"})
    assert changed.data == {"said": "Property violated: p", "alarms": [{"text": "Property violated: p"}]}
    situation = DisplayState()
    for entry in entries:
        if entry.kind == CHANGED:
            situation.apply(**entry.data)
    assert [each.is_over for each in situation.alarms.values()] == [False, False]


def test_raised_alarm_is_shown_without_mission():
    journal, entries = Journal(), list[JournalEntry]()
    journal.add_listener(entries.append)
    journal.begin({}, {})
    journal.raise_alarm("Property violated: p", "property_broken", property="p")
    assert entries[-1].data["alarms"] == [{"text": "Property violated: p"}]
