"""Tests of the state that is sent to a page, and of its changes."""

import json
import random
from typing import Any

import pytest

from sar_compiler.journal.display import Level
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import condition
from sar_compiler.reports.mission_report import report_data
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.web.page_state import PageState
from tests.random_inputs import rounds
from tests.web.conftest import ABOUT, KINDS, Patrol
from tests.web.folding import folded, happen, history, plain


def state_after(*told):
    """Return the page state of a started run after entries, given as pairs of kind and data."""
    state = PageState()
    begun = ("run_began", {**ABOUT, "run": {"node": "/patrol"}})
    for number, (kind, data) in enumerate((begun, *told), 1):
        state.apply(JournalEntry(number, 1, 0.0, float(number), kind, data))
    return state


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(15)))
def test_all_changes_add_up_to_full_state(seed):
    chance, state = random.Random(seed), PageState()  # noqa: S311
    known: dict[str, Any] = {}
    for entry in history(seed, 120):
        state.apply(entry)
        if chance.random() < 0.2:
            known = folded(known, state.change() or {})
            assert known == folded({}, state.full_state())


@pytest.mark.parametrize("seed", range(5))
def test_full_state_between_changes_is_updated_by_next_change(seed):
    state, late = PageState(), {}
    for number, entry in enumerate(history(seed, 60)):
        state.apply(entry)
        if number % 10 == 5:
            late = folded({}, state.full_state())
        if number % 10 == 9:
            assert folded(late, state.change()) == folded({}, state.full_state())


@pytest.mark.unmeasured
@pytest.mark.parametrize("part", range(4))
def test_page_and_report_always_agree_with_display_of_mission(part):
    for seed in range(part, rounds(150), 4):
        mission, page, state = Patrol(), PageState(), MissionState()
        chance, journal = random.Random(seed), Journal()  # noqa: S311
        journal.attach(mission, KINDS)
        journal.add_listener(page.apply)
        journal.add_listener(state.apply)
        journal.begin(ABOUT, {})
        for number in range(12):
            happen(journal, chance, f"event {number}")
            so, shown, reported = mission.display(), plain(page.full_state()), plain(report_data(state))
            marks = {
                (each.kind, each.name): (each.x, each.y, each.state, each.level.name.lower())
                for each in so.landmarks
            }
            assert marks == {
                (each["kind"], each["name"]): (
                    each["x"],
                    each["y"],
                    each["state"],
                    Level(each["level"]).name.lower(),
                )
                for each in shown["landmarks"].values()
            }
            assert marks == {
                (kind.name, each["name"]): (*each["position"].values(), each["state"], each["level"])
                for kind in KINDS
                for each in reported["landmarks"][kind.plural]
            }
            figures = [(each.name, each.value) for each in so.figures]
            assert figures == [(each["name"], each["value"]) for each in shown["figures"]]
            assert figures == [(each["name"], each["value"]) for each in reported["figures"]]
            assert shown["condition"]["word"] == reported["outcome"]


@pytest.mark.parametrize("seed", range(20))
def test_page_state_agrees_with_mission_state(seed):
    entries = history(seed, 80)
    state = PageState()
    for entry in entries:
        state.apply(entry)
    # If another mission has begun in the journal, only the last one counts.
    begun = max(number for number, entry in enumerate(entries) if entry.kind == "run_began")
    mission = MissionState.from_stream(entries if entries[begun].run == 2 else entries[begun:])
    shown = json.loads(json.dumps(state.full_state()))
    assert list(shown["landmarks"]) == ["/".join(key) for key in mission.situation.landmarks]
    for key, mark in mission.situation.landmarks.items():
        told = shown["landmarks"]["/".join(key)]
        assert (told["x"], told["y"], told["state"], told["level"]) == (
            mark.x,
            mark.y,
            mark.state,
            mark.level,
        )
        assert told["shade"] == mark.shade
    assert [each["text"] for each in shown["figures"]] == [
        each.text for each in mission.situation.figures.values()
    ]
    assert shown["rasters"] == {name: each._asdict() for name, each in mission.situation.rasters.items()}
    assert {each["text"]: (each["run"], each["time"]) for each in shown["alarms"]} == {
        text: (since.run, since.time) for text, since in mission.since.items()
    }
    assert shown["properties"]["assumption_failed_at"] == (
        mission.assumption_failed_at and mission.assumption_failed_at.time
    )
    assert {
        each["name"]: (each["word"], each["since"], each["event"]) for each in shown["properties"]["watched"]
    } == {
        name: (mission.word_of(each), each.broken and each.broken.time, each.event)
        for name, each in mission.properties.items()
    }
    assert shown["condition"] == condition(mission)._asdict()
    assert (shown["place"], shown["plan"], shown["map"]) == (
        mission.phase.place,
        [[*point] for point in mission.plan],
        mission.map or None,
    )
    assert shown["drive"] == (mission.drive and mission.drive._asdict())
    assert mission.pose is not None
    assert shown["pose"] == {"x": mission.pose.x, "y": mission.pose.y, "yaw": mission.pose.yaw}
    assert shown["trail"]["values"] == [[pose.x, pose.y] for pose in mission.trail]
    for node in mission.nodes:
        if node.status not in ("", "IDLE"):
            told = shown["states"][str(node.number)]
            assert (told[0], told[1]) == (node.status, node.status_time and node.status_time.time)
    facts = [text for *_, level, text in shown["log"]["values"] if level == "fact" and "The run" not in text]
    assert facts == [fact.text for fact in mission.facts]


def test_no_change_without_entries():
    state = state_after()
    state.change()
    assert state.change() is None


def test_change_contains_only_changed_parts():
    state = state_after(*(("log", {"node": "", "level": 20, "text": "line"}) for _ in range(500)))
    state.change()
    state.apply(JournalEntry(9, 1, 0.0, 9.0, "pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}))
    assert state.change() == {
        "robot": 0,
        "time": 8.0,
        "pose": {"x": 1.0, "y": 2.0, "yaw": 0.5},
        "times": {"pose": 8.0},
        "trail": {"at": 0, "values": [[1.0, 2.0]]},
    }


def test_event_is_logged_as_its_sentence():
    state = state_after(("found", {"name": "bag"}))
    state.change()
    state.apply(JournalEntry(9, 1, 0.0, 9.0, "changed", {"said": "a bag was found"}))
    change = state.change()
    assert change is not None
    assert change["log"]["values"] == [[1, 1.0, "fact", "a bag was found"]]


def test_event_of_command_is_logged_with_author_and_reason():
    said = ("changed", {"said": "the operator: pause", "by": "Ada"})
    told = {"verb": "pause", "label": "Pause", "by": "Ada", "is_told": True}
    shown = state_after(
        ("command_given", {"command": "pause", "by": "Ada"}), said, ("ordered", told)
    ).full_state()
    assert [line[-1] for line in shown["log"]["values"][1:]] == ["Ada: pause"]
    why = {"by": "Ada", "reason": "smoke"}
    entries = (
        ("command_given", {"command": "pause", **why}),
        (said[0], {**said[1], **why}),
        ("ordered", {**told, **why}),
    )
    assert [line[-1] for line in state_after(*entries).full_state()["log"]["values"][1:]] == [
        "Ada: pause: smoke"
    ]


def test_last_outcome_of_node_is_kept_after_reset():
    told = [
        ("status", {"node": 1, "tick": tick, "status": status, "message": message, **said})
        for tick, status, message, said in (
            (3, "RUNNING", "a", {}),
            (4, "RUNNING", "b", {}),
            (5, "FAILURE", "c", {"label": "refused"}),
            (6, "IDLE", "", {}),
        )
    ]
    assert state_after(*told).full_state()["states"]["1"][:9] == (
        "FAILURE",
        3.0,
        3,
        3.0,
        5,
        "c",
        3.0,
        "c",
        "refused",
    )


def test_state_of_long_run_is_limited():
    told: list[tuple[str, dict[str, Any]]] = [
        ("pose", {"x": float(number), "y": 0.0, "yaw": 0.0}) for number in range(20_000)
    ]
    told += [("log", {"node": "", "level": 20, "text": str(number)}) for number in range(5_000)]
    told += [("found", {"name": "first"})]
    told += [
        ("log", {"node": "", "level": 20 + number % 2 * 10, "text": str(number)}) for number in range(5_000)
    ]
    shown = state_after(*told).full_state()
    lines = [line[-1] for line in shown["log"]["values"]]
    assert len(lines) <= 2000
    assert lines[-300:] == [str(number) for number in range(4_700, 5_000)]
    assert 500 <= len(shown["trail"]["values"]) <= 1000
    assert shown["trail"]["values"][-1] == [19_999.0, 0.0]
    assert shown["pose"]["x"] == 19_999.0


def test_log_lines_with_equal_time_keep_their_order():
    told = [("log", {"node": "", "level": 20, "text": text, "stamp": -1.0}) for text in ("first", "second")]
    lines = [line[-1] for line in state_after(*told).full_state()["log"]["values"]]
    assert [line for line in lines if line in ("first", "second")] == ["first", "second"]


def test_events_outlast_log_lines():
    told: list[tuple[str, dict[str, Any]]] = [("found", {"name": "first"})]
    told += [("log", {"node": "", "level": 20, "text": str(number)}) for number in range(10_000)]
    lines = [line[-1] for line in state_after(*told).full_state()["log"]["values"]]
    assert lines[:2] == ["The run began.", "found: name: first"]


def test_events_are_kept_when_next_run_begins():
    state = state_after(
        ("found", {"name": "bag"}), ("status", {"node": 0, "tick": 1, "status": "RUNNING", "message": ""})
    )
    state.apply(JournalEntry(9, 2, 0.0, 50.0, "run_began", {**ABOUT, "run": {}}))
    shown = state.full_state()
    assert [line[-1] for line in shown["log"]["values"]] == [
        "The run began.",
        "found: name: bag",
        "The run began.",
    ]
    assert (shown["states"], shown["time"]) == ({}, 0.0)


def test_node_has_its_data_from_tree():
    nodes = state_after().full_state()["nodes"]
    assert [(node["name"], node["parent"]) for node in nodes] == [
        ("Mission", -1),
        ("Drive", 0),
        ("Search", 0),
    ]
    assert nodes[0]["attributes"] == {"memory": True}
    assert (nodes[1]["path"], nodes[1]["file"], nodes[1]["line"]) == ("leaves.Drive", "trees/mission.xml", 4)


def test_malformed_entry_is_logged_as_event():
    journal, state = Journal(), state_after()
    journal.add_listener(state.apply)
    journal.record_observation("pose", somewhere=True)
    journal.record_observation("status", node="Drive", tick=1, status="RUNNING", message="")
    journal.record_observation("changed", landmarks=[{"odd": 1}])
    shown = state.full_state()
    assert [line[-1].partition(":")[0] for line in shown["log"]["values"][1:]] == [
        "pose",
        "status",
        "changed",
    ]
    assert (shown["pose"], shown["states"]) == (None, {})


def test_node_has_counts_of_ends_and_durations():
    journal = Journal()
    journal.clock = clock = ManualClock(100.0)
    state = PageState()
    journal.add_listener(state.apply)
    journal.begin(ABOUT, {})
    for number, (status, seconds) in enumerate(
        [
            ("RUNNING", 2.0),
            ("SUCCESS", 1.0),
            ("IDLE", 1.0),
            ("RUNNING", 6.0),
            ("FAILURE", 1.0),
            ("RUNNING", 1.0),
        ]
    ):
        journal.record_observation("status", node=1, tick=number, status=status, message="")
        clock.advance(seconds)
    *_, ends, ran, longest = state.full_state()["states"]["1"]
    assert (ends, ran, longest) == ((1, 1, 0), 8.0, 6.0)


def test_status_time_restarts_after_reset():
    journal = Journal()
    journal.clock = clock = ManualClock(100.0)
    state = PageState()
    journal.add_listener(state.apply)
    journal.begin(ABOUT, {})
    for number, status in enumerate(["SUCCESS", "IDLE", "SUCCESS"]):
        journal.record_observation("status", node=1, tick=number, status=status, message="")
        clock.advance(2.0)
    assert state.full_state()["states"]["1"][1] == 4.0


WATCHED = {"properties": [{"name": name, "if_broken": "tell"} for name in "ab"]}


def test_change_of_property_contains_only_properties():
    state = state_after(("properties_watched", WATCHED))
    state.change()
    state.apply(JournalEntry(3, 1, 0.0, 5.0, "properties_owed", {"owed": ["b"]}))
    change = state.change()
    assert change is not None
    assert {each["name"]: each["word"] for each in change["properties"]["watched"]} == {
        "a": "watched",
        "b": "owed",
    }
    assert change.keys() == {"robot", "time", "properties"}


def test_violated_property_is_logged():
    state = state_after(("properties_watched", WATCHED))
    state.change()
    state.apply(JournalEntry(3, 1, 0.0, 5.0, "property_broken", {"property": "a", "event": "Drive aborted"}))
    state.apply(JournalEntry(4, 1, 0.0, 5.0, "changed", {"said": "Property violated: a"}))
    change = state.change()
    assert change is not None
    assert change["log"]["values"] == [[1, 4.0, "fact", "Property violated: a"]]
    assert [(each["word"], each["since"], each["event"]) for each in change["properties"]["watched"]] == [
        ("broken", 4.0, "Drive aborted"),
        ("watched", None, ""),
    ]


def test_cause_of_failure_is_cleared_when_next_run_begins():
    state = state_after(("properties_watched", WATCHED))
    state.set_why({"chain": []})
    assert folded({}, state.full_state())["why"] == {"chain": []}
    state.apply(JournalEntry(9, 2, 0.0, 0.0, "run_began", {**ABOUT, "run": {}}))
    assert folded({}, state.full_state())["why"] is None


def test_end_of_run_recorded_twice_is_logged_once():
    end = {"ending": "failed", "status": 1, "reason": "Goal failed"}
    state = state_after(("run_ended", end), ("run_ended", {**end, "reason": "the tree returned FAILURE"}))
    assert [line[3] for line in state.full_state()["log"]["values"]] == [
        "The run began.",
        "The run ended: Goal failed",
    ]
    state.apply(JournalEntry(9, 2, 0.0, 9.0, "run_began", {**ABOUT, "run": {}}))
    state.apply(JournalEntry(10, 2, 0.0, 10.0, "run_ended", end))
    assert len(state.full_state()["log"]["values"]) == 4
