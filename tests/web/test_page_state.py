"""The state that a page is sent, and its changes."""

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
from tests.chance import rounds
from tests.web.conftest import ABOUT, KINDS, Patrol
from tests.web.folding import folded, happen, history, plain


def run_of(*told):
    """Return the state of a run, begun and told of entries as pairs of a kind and values, and these again."""
    state = PageState()
    begun = ("run_began", {**ABOUT, "run": {"node": "/patrol"}})
    for number, (kind, data) in enumerate((begun, *told), 1):
        state.apply(JournalEntry(number, 1, 0.0, float(number), kind, data))
    return state


@pytest.mark.unmeasured
@pytest.mark.parametrize("seed", range(rounds(15)))
def test_who_was_told_all_changes_knows_what_one_knows_who_comes_late(seed):
    chance, state = random.Random(seed), PageState()  # noqa: S311
    known: dict[str, Any] = {}
    for entry in history(seed, 120):
        state.apply(entry)
        if chance.random() < 0.2:
            known = folded(known, state.change() or {})
            assert known == folded({}, state.full_state())


@pytest.mark.parametrize("seed", range(5))
def test_who_comes_between_two_changes_knows_the_same_after_the_next(seed):
    state, late = PageState(), {}
    for number, entry in enumerate(history(seed, 60)):
        state.apply(entry)
        if number % 10 == 5:
            late = folded({}, state.full_state())
        if number % 10 == 9:
            assert folded(late, state.change()) == folded({}, state.full_state())


@pytest.mark.unmeasured
@pytest.mark.parametrize("part", range(4))
def test_at_every_moment_page_and_report_show_what_the_mission_itself_says(part):
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
def test_a_page_shows_what_the_mission_s_state_is(seed):
    entries = history(seed, 80)
    state = PageState()
    for entry in entries:
        state.apply(entry)
    # Of a journal in which another mission has begun, the last one.
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


def test_nothing_is_told_of_nothing():
    state = run_of()
    state.change()
    assert state.change() is None


def test_a_change_is_as_large_as_what_has_changed():
    state = run_of(*(("log", {"node": "", "level": 20, "text": "line"}) for _ in range(500)))
    state.change()
    state.apply(JournalEntry(9, 1, 0.0, 9.0, "pose", {"x": 1.0, "y": 2.0, "yaw": 0.5}))
    assert state.change() == {
        "robot": 0,
        "time": 8.0,
        "pose": {"x": 1.0, "y": 2.0, "yaw": 0.5},
        "times": {"pose": 8.0},
        "trail": {"at": 0, "values": [[1.0, 2.0]]},
    }


def test_a_fact_is_told_as_the_sentence_that_comes_behind_it():
    state = run_of(("found", {"name": "bag"}))
    state.change()
    state.apply(JournalEntry(9, 1, 0.0, 9.0, "changed", {"said": "a bag was found"}))
    change = state.change()
    assert change is not None
    assert change["log"]["values"] == [[1, 1.0, "fact", "a bag was found"]]


def test_a_fact_that_somebody_has_ordered_is_told_with_who_has():
    said = ("changed", {"said": "the operator: pause", "by": "Ada"})
    told = {"verb": "pause", "label": "Pause", "by": "Ada", "is_told": True}
    shown = run_of(("command_given", {"command": "pause", "by": "Ada"}), said, ("ordered", told)).full_state()
    assert [line[-1] for line in shown["log"]["values"][1:]] == ["Ada: pause"]
    why = {"by": "Ada", "reason": "smoke"}
    entries = (
        ("command_given", {"command": "pause", **why}),
        (said[0], {**said[1], **why}),
        ("ordered", {**told, **why}),
    )
    assert [line[-1] for line in run_of(*entries).full_state()["log"]["values"][1:]] == ["Ada: pause: smoke"]


def test_what_a_node_came_to_is_shown_after_it_was_reset():
    told = [
        ("status", {"node": 1, "tick": tick, "status": status, "message": message, **said})
        for tick, status, message, said in (
            (3, "RUNNING", "a", {}),
            (4, "RUNNING", "b", {}),
            (5, "FAILURE", "c", {"label": "refused"}),
            (6, "IDLE", "", {}),
        )
    ]
    assert run_of(*told).full_state()["states"]["1"][:9] == (
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


def test_of_a_long_run_little_is_kept():
    told: list[tuple[str, dict[str, Any]]] = [
        ("pose", {"x": float(number), "y": 0.0, "yaw": 0.0}) for number in range(20_000)
    ]
    told += [("log", {"node": "", "level": 20, "text": str(number)}) for number in range(5_000)]
    told += [("found", {"name": "first"})]
    told += [
        ("log", {"node": "", "level": 20 + number % 2 * 10, "text": str(number)}) for number in range(5_000)
    ]
    shown = run_of(*told).full_state()
    lines = [line[-1] for line in shown["log"]["values"]]
    assert len(lines) <= 2000
    assert lines[-300:] == [str(number) for number in range(4_700, 5_000)]
    assert 500 <= len(shown["trail"]["values"]) <= 1000
    assert shown["trail"]["values"][-1] == [19_999.0, 0.0]
    assert shown["pose"]["x"] == 19_999.0


def test_lines_of_one_time_are_shown_in_the_order_in_which_they_came():
    told = [("log", {"node": "", "level": 20, "text": text, "stamp": -1.0}) for text in ("first", "second")]
    lines = [line[-1] for line in run_of(*told).full_state()["log"]["values"]]
    assert [line for line in lines if line in ("first", "second")] == ["first", "second"]


def test_facts_outlast_the_lines_of_the_log():
    told: list[tuple[str, dict[str, Any]]] = [("found", {"name": "first"})]
    told += [("log", {"node": "", "level": 20, "text": str(number)}) for number in range(10_000)]
    lines = [line[-1] for line in run_of(*told).full_state()["log"]["values"]]
    assert lines[:2] == ["The run began.", "found: name: first"]


def test_facts_are_kept_over_the_beginning_of_another_run():
    state = run_of(
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


def test_a_node_is_told_with_what_the_tree_says_of_it():
    nodes = run_of().full_state()["nodes"]
    assert [(node["name"], node["parent"]) for node in nodes] == [
        ("Mission", -1),
        ("Drive", 0),
        ("Search", 0),
    ]
    assert nodes[0]["attributes"] == {"memory": True}
    assert (nodes[1]["path"], nodes[1]["file"], nodes[1]["line"]) == ("leaves.Drive", "trees/mission.xml", 4)


def test_an_entry_of_somebody_else_is_a_fact():
    journal, state = Journal(), run_of()
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


def test_a_node_has_how_often_it_has_ended_and_how_long_that_took():
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


def test_a_node_that_was_reset_has_its_status_anew():
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


def test_what_is_known_of_a_property_is_told_when_that_changes_and_nothing_else_of_it():
    state = run_of(("properties_watched", WATCHED))
    state.change()
    state.apply(JournalEntry(3, 1, 0.0, 5.0, "properties_owed", {"owed": ["b"]}))
    change = state.change()
    assert change is not None
    assert {each["name"]: each["word"] for each in change["properties"]["watched"]} == {
        "a": "watched",
        "b": "owed",
    }
    assert change.keys() == {"robot", "time", "properties"}


def test_a_broken_property_is_an_event_of_the_log_as_well():
    state = run_of(("properties_watched", WATCHED))
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


def test_the_reason_of_a_failure_is_forgotten_when_another_run_begins():
    state = run_of(("properties_watched", WATCHED))
    state.set_why({"chain": []})
    assert folded({}, state.full_state())["why"] == {"chain": []}
    state.apply(JournalEntry(9, 2, 0.0, 0.0, "run_began", {**ABOUT, "run": {}}))
    assert folded({}, state.full_state())["why"] is None


def test_a_run_whose_end_is_told_twice_ends_once_in_the_log():
    end = {"ending": "failed", "status": 1, "reason": "Goal failed"}
    state = run_of(("run_ended", end), ("run_ended", {**end, "reason": "the tree returned FAILURE"}))
    assert [line[3] for line in state.full_state()["log"]["values"]] == [
        "The run began.",
        "The run ended: Goal failed",
    ]
    state.apply(JournalEntry(9, 2, 0.0, 9.0, "run_began", {**ABOUT, "run": {}}))
    state.apply(JournalEntry(10, 2, 0.0, 10.0, "run_ended", end))
    assert len(state.full_state()["log"]["values"]) == 4
