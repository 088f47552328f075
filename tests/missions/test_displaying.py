"""Journals whose facts stand alone are shown by the mission that is installed."""

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.opening import open_journal
from sar_compiler.journal.situation import CHANGED
from sar_compiler.missions.displaying import add_displays, run_of
from sar_compiler.missions.search_and_rescue.plugin import SearchAndRescue
from sar_compiler.missions.search_and_rescue.search import Search
from sar_compiler.ros.parameter_reader import ParameterReader

PARAMETERS = {
    "zone_order": ["zone_a", "zone_b"],
    **{
        f"{place}.{key}": 1.0
        for place in ("zones.zone_a", "zones.zone_b", "base_station")
        for key in ("x", "y", "yaw")
    },
}
FACTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("zone_started", {"zone": "zone_a"}),
    ("goal_sent", {"action": "/navigate_to_pose", "goal": "00"}),
    ("zone_searched", {"zone": "zone_a", "survivor": [1.0, 2.0]}),
    ("survivor_named", {"survivor": "survivor_1", "x": 1.0, "y": 2.0, "possibly": None}),
    ("zone_visited", {"zone": "zone_a"}),
)


def written(place: Path, mission: str | None = "search_and_rescue") -> list[JournalEntry]:
    """Return what a search has written in two runs, of which the first was killed."""
    for resume, facts in ((False, FACTS[:3]), (True, FACTS[3:])):
        journal = open_journal(place, resume=resume)
        SearchAndRescue().begin(ParameterReader(PARAMETERS)).keep_in(journal)
        journal.begin({"mission": mission}, {"parameters": PARAMETERS})
        for kind, data in facts:
            journal.note(kind, **data)
        if resume:
            journal.end(Ending.OVER, 0)
        journal.close()
    with closing(JournalFile.read(place)) as file:
        return list(file.stream())


def facts_alone(entries: list[JournalEntry]) -> list[JournalEntry]:
    return [entry for entry in entries if entry.kind != CHANGED]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "mission.journal"


def shown(state: MissionState) -> tuple[Any, ...]:
    situation = state.situation
    return situation.landmarks, situation.figures, situation.phase, [each.text for each in state.facts]


def test_a_journal_that_says_what_is_shown_is_passed_on(place: Path) -> None:
    entries = written(place)
    assert list(add_displays(entries)) == entries


@pytest.mark.parametrize("count", range(1, len(FACTS) + 4))
def test_what_facts_alone_have_changed_the_mission_says(place: Path, count: int) -> None:
    entries = written(place)
    alone = facts_alone(entries)[:count]
    whole = entries[: entries.index(alone[-1]) + 1]
    following = entries[len(whole) : len(whole) + 1]
    whole += [entry for entry in following if entry.kind == CHANGED]
    assert shown(MissionState.of(add_displays(alone))) == shown(MissionState.of(whole))


def test_whose_a_fact_is_changes_nothing_of_what_facts_alone_show(place: Path) -> None:
    alone = facts_alone(written(place))
    with_leaves = [
        each
        for entry in alone
        for each in (entry, entry._replace(kind=CHANGED, data={"leaf": 3, "tick": 1}))
        if each.kind != CHANGED or entry.kind in dict(FACTS)
    ]
    assert len(with_leaves) == len(alone) + len(FACTS)
    assert shown(MissionState.of(add_displays(with_leaves))) == shown(MissionState.of(add_displays(alone)))


@pytest.mark.parametrize("mission", ["of_nobody", None])
def test_facts_of_a_mission_that_is_not_installed_are_yielded_as_they_are(
    place: Path, mission: str | None
) -> None:
    alone = facts_alone(written(place, mission))
    assert list(add_displays(alone)) == alone


def test_after_a_fact_that_is_none_of_the_mission_the_rest_is_yielded_as_it_is(place: Path) -> None:
    alone = facts_alone(written(place))
    strange = alone[1]._replace(data={"place": "elsewhere"})
    entries = list(add_displays([alone[0], strange, *alone[2:]]))
    assert [entry for entry in entries if entry.kind != CHANGED] == [alone[0], strange, *alone[2:]]
    assert [entry.kind for entry in entries].count(CHANGED) == 1


def test_no_file_is_read_that_a_journal_names(place: Path, tmp_path: Path) -> None:
    """It may be anybody's; what the run itself has read of a file is among its parameters."""
    first, areas = written(place)[0], tmp_path / "areas.geojson"
    square = [[0.001, 0.001], [0.002, 0.001], [0.002, 0.002], [0.001, 0.001]]
    area = {"properties": {"name": "secret"}, "geometry": {"type": "Polygon", "coordinates": [square]}}
    areas.write_text(json.dumps({"features": [area]}), encoding="utf-8")
    georeference = {f"georeference.{name}": 0.0 for name in ("lat", "lon", "heading")}
    base = {name: value for name, value in PARAMETERS.items() if name.startswith("base")}
    parameters = {**base, **georeference, "areas_file": str(areas)}
    assert [*SearchAndRescue().begin(ParameterReader(parameters)).zones.remaining_zones()]
    run = run_of(first._replace(data={**first.data, "run": {"parameters": parameters}}))
    assert isinstance(run, Search)
    assert [*run.zones.remaining_zones()] == []
