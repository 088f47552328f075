"""What leaves did, read again from the journal of a run."""

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
from tests.chance import rounds
from tests.checks.test_events import ByChance
from tests.views.flown import watched_tick

TICKS = 8
S, F, R = Status.SUCCESS, Status.FAILURE, Status.RUNNING


def plain(behaviour):
    return {"name": behaviour.name, "children": [*map(plain, behaviour.children)]}


class Flight:
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
        """Tick once; return what the root has come to."""
        return watched_tick(self._tree, self._watch)

    def deeds(self):
        """Return what leaves did, and what was noted, with the tick of each, without the ends of ticks."""
        return [
            (event.tick, event.leaf, event.action, *(kind for kind, _ in event.facts))
            for event in recorded_events(self.stream)
            if event.what != TICKED
        ]


def flown(root, ticks):
    flight = Flight(root)
    for _ in range(ticks):
        flight.tick()
    return flight


def in_ticks(events):
    """Return events by the numbers of their ticks, without times and facts."""
    found: dict[int, list[Event]] = {}
    for event in events:
        found.setdefault(event.tick, []).append(event._replace(time_sec=None, facts=(), statuses=()))
    return found


@pytest.mark.parametrize("binding", trees(range(600, 600 + rounds(25))))
def test_what_is_read_has_happened_and_nothing_is_left_out_but_answers_as_in_the_tick_before(binding):
    simulated = simulated_tree(binding)
    simulated.policy = ByChance(3)
    paths = {leaf.number: leaf.path for leaf in simulated.leaves}
    flight = Flight(simulated.root, {leaf.id: leaf.outcomes for leaf in simulated.leaves})
    happened: list[Event] = []
    with contextlib.suppress(Exception):  # scripts of random trees go wrong
        for number in range(1, TICKS + 1):
            simulated.events.clear()
            root = flight.tick()
            happened += append_end(simulated.events, simulated.root.name, root, number)
    read = in_ticks(
        event._replace(path=paths.get(event.number, event.path))
        for event in recorded_events(flight.stream)
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
        # What is as in the tick before is left out, and nothing else.
        at_rest = {event.number for event in read.get(number, []) if event.what == RESET}
        known = {leaf: answer for leaf, answer in last.items() if leaf not in at_rest}


def test_a_leaf_that_is_at_rest_again_is_not_taken_for_one_that_answers_the_same():
    first = StatusQueue("first", [S, F], eventually=F)
    flight = flown(
        Sequence("root", memory=True, children=[first, StatusQueue("second", [F], eventually=F)]), 2
    )
    assert flight.deeds() == [
        (1, "first", STARTED),
        (1, "first", "SUCCESS"),
        (1, "second", STARTED),
        (1, "second", "FAILURE"),
        (2, "first", STARTED),
        (2, "first", "FAILURE"),
        (2, "second", RESET),
    ]


def test_a_leaf_that_goes_on_does_not_start_again_and_one_that_was_halted_does():
    first = StatusQueue("first", [F, F, S, F], eventually=F)
    second = StatusQueue("second", [R, R, R], eventually=R)
    flight = flown(Selector("root", memory=False, children=[first, second]), 4)
    assert [deed for deed in flight.deeds() if deed[1] == "second"] == [
        (1, "second", STARTED),
        (1, "second", "RUNNING"),
        (3, "second", HALTED),
        (4, "second", STARTED),
        (4, "second", "RUNNING"),
    ]


def test_the_end_of_a_tick_says_what_the_root_has_come_to_and_when():
    flight = flown(Sequence("root", memory=True, children=[StatusQueue("one", [R, S], eventually=S)]), 2)
    ends = [event for event in recorded_events(flight.stream) if event.what == TICKED]
    assert [(each.path, each.status, each.tick) for each in ends] == [
        (("root",), "RUNNING", 1),
        (("root",), "SUCCESS", 2),
    ]
    (began, *_), last = flight.stream, flight.stream[-1]
    assert ends[1].time_sec == last.time - began.time


class Noting(Behaviour):
    """Notes a fact whenever it is ticked, and one when it ends."""

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


def noting(root, ticks):
    flight = Flight(root)
    for each in pre_order(root):
        if isinstance(each, Noting):
            each.journal = flight.journal
    for _ in range(ticks):
        with contextlib.suppress(IndexError):
            flight.tick()
    return flight


def test_a_fact_belongs_to_the_answer_of_the_leaf_that_has_noted_it():
    one, two = Noting("one", R, S), Noting("two", S)
    flight = noting(Sequence("root", memory=True, children=[one, two]), 2)
    assert [
        (each.leaf, each.outcome, each.facts) for each in recorded_events(flight.stream) if each.facts
    ] == [
        ("one", "RUNNING", (("seen", {"tick": 2}),)),
        ("one", "SUCCESS", (("seen", {"tick": 1}),)),
        ("two", "SUCCESS", (("seen", {"tick": 1}),)),
    ]


def test_a_fact_that_is_noted_when_a_leaf_is_halted_belongs_to_its_halt():
    first = StatusQueue("first", [F, S], eventually=S)
    flight = noting(Selector("root", memory=False, children=[first, Noting("second", R)]), 2)
    assert flight.deeds()[-1] == (2, "second", HALTED, "given_up")


def test_a_fact_of_a_leaf_that_gives_no_answer_stands_at_the_end_of_the_tick():
    flight = noting(Noting("one", R), 3)
    *_, end = recorded_events(flight.stream)
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


def test_facts_of_journals_that_do_not_say_whose_they_are_are_left_out():
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
def test_entries_of_somebody_else_are_no_events(odd):
    stream = entries(("base_reached", {}), odd, status(1, "SUCCESS", label="found"))
    assert [event.action for event in recorded_events(stream)] == [STARTED, "found", TICKED]


def test_a_leaf_that_is_skipped_while_it_runs_goes_on():
    stream = entries(
        *(status(tick, words) for tick, words in enumerate(("RUNNING", "SKIPPED", "RUNNING"), 1))
    )
    deeds = [event.action for event in recorded_events(stream) if event.what != TICKED]
    assert deeds == [STARTED, "RUNNING", "SKIPPED", "RUNNING"]


def test_what_becomes_of_the_root_afterwards_is_not_what_it_has_come_to():
    stream = entries(status(1, "FAILURE"), status(1, "IDLE"))
    assert [event.status for event in recorded_events(stream) if event.what == TICKED] == ["FAILURE"]


def test_with_each_run_ticks_and_times_begin_anew():
    first = entries(status(1, "RUNNING"))
    second = [each._replace(run=2, time=each.time + 100.0) for each in entries(status(1, "RUNNING"))]
    read = [(event.action, event.tick, event.time_sec) for event in recorded_events([*first, *second])]
    assert read == [(STARTED, 1, 2.0), ("RUNNING", 1, 2.0), (TICKED, 1, 2.0)] * 2


def test_a_tick_in_which_an_assumption_failed_is_told_although_all_was_as_before():
    flight = Flight(StatusQueue("one", [R, R, R], None))
    flight.tick()
    flight.journal.record_event("assumption_failed", tick=3)
    assert [(each.tick, each.what, each.status) for each in recorded_events(flight.stream)] == [
        (1, STARTED, ""),
        (1, "returned", "RUNNING"),
        (1, TICKED, "RUNNING"),
        (3, TICKED, "RUNNING"),
    ]


@pytest.mark.parametrize("binding", trees(range(800, 800 + rounds(25))))
def test_a_node_is_at_rest_by_its_last_entry_whenever_it_is_at_rest(binding):
    simulated = simulated_tree(binding)
    simulated.policy = ByChance(3)
    flight = Flight(simulated.root)
    nodes = list(pre_order(simulated.root))
    for _ in range(TICKS):
        with contextlib.suppress(Exception):  # scripts of random trees go wrong
            flight.tick()
        written = {
            entry.data["node"]: entry.data["status"] for entry in flight.stream if entry.kind == "status"
        }
        # What was skipped stays as it is.
        told = {number for number, word in written.items() if word in ("HALTED", "IDLE")}
        shown = {number for number, node in enumerate(nodes) if node.status is Status.INVALID}
        skipped = {number for number, word in written.items() if word == "SKIPPED"}
        assert told - skipped == shown & written.keys() - skipped
