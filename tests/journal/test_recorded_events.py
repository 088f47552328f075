"""Tests of reading the actions and outcomes of leaves from the journal of a run."""

import contextlib
from collections import Counter

import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import StatusQueue
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.recorded_events import recorded_events
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.runtime.events import HALTED, RESET, STARTED, TICKED, Event, append_end
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.walking import pre_order
from tests.analysis.verify.stage import simulated_tree
from tests.analysis.verify.test_same_as_py_trees import trees
from tests.checks.test_events import ByChance
from tests.random_inputs import rounds
from tests.views.recorded_runs import watched_tick

TICKS = 8
S, F, R = Status.SUCCESS, Status.FAILURE, Status.RUNNING


def plain(behaviour):
    return {"name": behaviour.name, "children": [*map(plain, behaviour.children)]}


class RecordedTree:
    """A tree that is ticked with a journal.

    Attributes:
        journal: The journal.
        stream: Its entries.
    """

    def __init__(self, root, outcomes=None):
        self.journal = Journal()
        self.stream: list[JournalEntry] = []
        self.journal.add_listener(self.stream.append)
        self.journal.begin({"tree": plain(root)}, {})
        self._watch = StatusWatch(root, self.journal, outcomes)
        self._tree = LiveTree(root)

    def tick(self):
        """Tick once; return the status of the root."""
        return watched_tick(self._tree, self._watch)

    def leaf_events(self):
        """Return the events of leaves as tick, leaf, action and kinds of the journal events, without the ends of ticks."""
        return [
            (event.tick, event.leaf, event.action, *(kind for kind, _ in event.facts))
            for event in recorded_events(self.stream)
            if event.what != TICKED
        ]


def record_ticks(root, ticks):
    recorded = RecordedTree(root)
    for _ in range(ticks):
        recorded.tick()
    return recorded


def in_ticks(events):
    """Return events by tick number, without times and journal events."""
    found: dict[int, list[Event]] = {}
    for event in events:
        found.setdefault(event.tick, []).append(event._replace(time_sec=None, facts=(), statuses=()))
    return found


@pytest.mark.parametrize("binding", trees(range(600, 600 + rounds(25))))
def test_recorded_events_omit_only_outcomes_equal_to_previous_tick(binding):
    simulated = simulated_tree(binding)
    simulated.policy = ByChance(3)
    paths = {leaf.number: leaf.path for leaf in simulated.leaves}
    recorded = RecordedTree(simulated.root, {leaf.id: leaf.outcomes for leaf in simulated.leaves})
    happened: list[Event] = []
    with contextlib.suppress(Exception):  # scripts of random trees go wrong
        for number in range(1, TICKS + 1):
            simulated.events.clear()
            root = recorded.tick()
            happened += append_end(simulated.events, simulated.root.name, root, number)
    read = in_ticks(
        event._replace(path=paths.get(event.number, event.path))
        for event in recorded_events(recorded.stream)
        if event.number in paths or event.what == TICKED
    )
    known: dict[int, tuple[str, str]] = {}
    for number, events in in_ticks(happened).items():
        told = [event for event in read.get(number, []) if event.what != RESET]
        assert Counter(told) <= Counter(events)
        last = {event.number: (event.status, event.label) for event in events if event.outcome}
        as_before = {leaf for leaf, answer in last.items() if known.get(leaf) == answer}
        assert {event.number for event in told if event.outcome} >= last.keys() - as_before
        last_deeds = {event.number: event.what for event in events if event.what != TICKED}
        halted = {leaf for leaf, what in last_deeds.items() if what == HALTED}
        assert {event.number for event in told if event.what == HALTED} >= halted
        # Only outcomes that equal those of the previous tick are omitted.
        at_rest = {event.number for event in read.get(number, []) if event.what == RESET}
        known = {leaf: answer for leaf, answer in last.items() if leaf not in at_rest}


def test_leaf_that_was_reset_is_recorded_as_reset():
    first = StatusQueue("first", [S, F], eventually=F)
    recorded = record_ticks(
        Sequence("root", memory=True, children=[first, StatusQueue("second", [F], eventually=F)]), 2
    )
    assert recorded.leaf_events() == [
        (1, "first", STARTED),
        (1, "first", "SUCCESS"),
        (1, "second", STARTED),
        (1, "second", "FAILURE"),
        (2, "first", STARTED),
        (2, "first", "FAILURE"),
        (2, "second", RESET),
    ]


def test_continuing_leaf_does_not_start_again_and_halted_leaf_does():
    first = StatusQueue("first", [F, F, S, F], eventually=F)
    second = StatusQueue("second", [R, R, R], eventually=R)
    recorded = record_ticks(Selector("root", memory=False, children=[first, second]), 4)
    assert [deed for deed in recorded.leaf_events() if deed[1] == "second"] == [
        (1, "second", STARTED),
        (1, "second", "RUNNING"),
        (3, "second", HALTED),
        (4, "second", STARTED),
        (4, "second", "RUNNING"),
    ]


def test_end_of_tick_has_status_of_root_and_time():
    recorded = record_ticks(
        Sequence("root", memory=True, children=[StatusQueue("one", [R, S], eventually=S)]), 2
    )
    ends = [event for event in recorded_events(recorded.stream) if event.what == TICKED]
    assert [(each.path, each.status, each.tick) for each in ends] == [
        (("root",), "RUNNING", 1),
        (("root",), "SUCCESS", 2),
    ]
    (began, *_), last = recorded.stream, recorded.stream[-1]
    assert ends[1].time_sec == last.time - began.time


class EventRecorder(Behaviour):
    """Records an event at each tick, and one when it is halted."""

    def __init__(self, name, *statuses):
        super().__init__(name)
        self.statuses = list(statuses)
        self.journal = Journal()

    def update(self):
        self.journal.record_event("seen", tick=len(self.statuses))
        return self.statuses.pop(0)

    def terminate(self, new_status):
        if new_status is Status.INVALID:
            self.journal.record_event("given_up")


def record_noting_ticks(root, ticks):
    recorded = RecordedTree(root)
    for each in pre_order(root):
        if isinstance(each, EventRecorder):
            each.journal = recorded.journal
    for _ in range(ticks):
        with contextlib.suppress(IndexError):
            recorded.tick()
    return recorded


def test_event_belongs_to_outcome_of_leaf_that_recorded_it():
    one, two = EventRecorder("one", R, S), EventRecorder("two", S)
    recorded = record_noting_ticks(Sequence("root", memory=True, children=[one, two]), 2)
    assert [
        (each.leaf, each.outcome, each.facts) for each in recorded_events(recorded.stream) if each.facts
    ] == [
        ("one", "RUNNING", (("seen", {"tick": 2}),)),
        ("one", "SUCCESS", (("seen", {"tick": 1}),)),
        ("two", "SUCCESS", (("seen", {"tick": 1}),)),
    ]


def test_event_recorded_during_halt_belongs_to_halt():
    first = StatusQueue("first", [F, S], eventually=S)
    recorded = record_noting_ticks(
        Selector("root", memory=False, children=[first, EventRecorder("second", R)]), 2
    )
    assert recorded.leaf_events()[-1] == (2, "second", HALTED, "given_up")


def test_event_of_leaf_without_outcome_belongs_to_end_of_tick():
    recorded = record_noting_ticks(EventRecorder("one", R), 3)
    *_, end = recorded_events(recorded.stream)
    assert (end.what, end.status, end.facts) == (TICKED, "", (("seen", {"tick": 0}),))


def entries(*kinds_and_data):
    began = JournalEntry(1, 1, 0.0, 10.0, "run_began", {"tree": {"name": "one", "children": []}, "run": {}})
    return [
        began,
        *(
            JournalEntry(number, 1, 0.0, 10.0 + number, kind, data)
            for number, (kind, data) in enumerate(kinds_and_data, 2)
        ),
    ]


def status(tick, words, **more):
    return "status", {"node": 0, "tick": tick, "status": words, "message": "", **more}


def test_events_without_recorded_leaf_are_omitted():
    stream = entries(("zone_searched", {"zone": "a"}), ("changed", {"said": "Zone a."}), status(1, "SUCCESS"))
    assert [event.facts for event in recorded_events(stream)] == [(), (), ()]


@pytest.mark.parametrize(
    "odd",
    [
        ("status", {"node": 1, "tick": 1, "status": "FAILURE"}),
        ("status", {"node": -1, "tick": 1, "status": "FAILURE"}),
        ("status", {"node": 0, "status": "FAILURE"}),
        ("status", {"node": 0, "tick": 1, "status": {}}),
        ("status", {"node": "one", "tick": 1, "status": "FAILURE"}),
        ("changed", {"leaf": 0}),
    ],
)
def test_malformed_entries_are_no_recorded_events(odd):
    stream = entries(("base_reached", {}), odd, status(1, "SUCCESS", label="found"))
    assert [event.action for event in recorded_events(stream)] == [STARTED, "found", TICKED]


def test_leaf_skipped_while_running_continues():
    stream = entries(
        *(status(tick, words) for tick, words in enumerate(("RUNNING", "SKIPPED", "RUNNING"), 1))
    )
    leaf_events = [event.action for event in recorded_events(stream) if event.what != TICKED]
    assert leaf_events == [STARTED, "RUNNING", "SKIPPED", "RUNNING"]


def test_reset_of_root_does_not_change_its_status_of_tick():
    stream = entries(status(1, "FAILURE"), status(1, "IDLE"))
    assert [event.status for event in recorded_events(stream) if event.what == TICKED] == ["FAILURE"]


def test_ticks_and_times_restart_with_each_run():
    first = entries(status(1, "RUNNING"))
    second = [each._replace(run=2, time=each.time + 100.0) for each in entries(status(1, "RUNNING"))]
    read = [(event.action, event.tick, event.time_sec) for event in recorded_events([*first, *second])]
    assert read == [(STARTED, 1, 2.0), ("RUNNING", 1, 2.0), (TICKED, 1, 2.0)] * 2


def test_tick_with_failed_assumption_is_recorded_without_status_change():
    recorded = RecordedTree(StatusQueue("one", [R, R, R], None))
    recorded.tick()
    recorded.journal.record_event("assumption_failed", tick=3)
    assert [(each.tick, each.what, each.status) for each in recorded_events(recorded.stream)] == [
        (1, STARTED, ""),
        (1, "returned", "RUNNING"),
        (1, TICKED, "RUNNING"),
        (3, TICKED, "RUNNING"),
    ]


@pytest.mark.parametrize("binding", trees(range(800, 800 + rounds(25))))
def test_last_entry_of_inactive_node_is_halted_or_idle(binding):
    simulated = simulated_tree(binding)
    simulated.policy = ByChance(3)
    recorded = RecordedTree(simulated.root)
    nodes = list(pre_order(simulated.root))
    for _ in range(TICKS):
        with contextlib.suppress(Exception):  # scripts of random trees go wrong
            recorded.tick()
        written = {
            entry.data["node"]: entry.data["status"] for entry in recorded.stream if entry.kind == "status"
        }
        # A skipped node keeps its last entry.
        told = {number for number, word in written.items() if word in ("HALTED", "IDLE")}
        shown = {number for number, node in enumerate(nodes) if node.status is Status.INVALID}
        skipped = {number for number, word in written.items() if word == "SKIPPED"}
        assert told - skipped == shown & written.keys() - skipped
