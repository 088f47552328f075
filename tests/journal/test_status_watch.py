"""Tests of the journal entries about the nodes of a tree."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import StatusQueue
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.trees import BehaviourTree

from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.runtime.kernel.live import LiveTree, show_visits
from sar_compiler.runtime.kernel.tree_nodes import Visit
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.runtime.skipping import SKIPPED, SkippableLeaf
from tests.views.recorded_runs import watched_tick


@pytest.fixture
def journal(tmp_path):
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({}, {})
    yield journal
    journal.close()


def leaf(name, *statuses):
    return StatusQueue(name, list(statuses), eventually=statuses[-1])


def recorded_statuses(journal, root, ticks):
    """Tick a tree; return the tick, node number and status of each entry."""
    tree = BehaviourTree(root)
    tree.add_visitor(StatusWatch(root, journal))
    for _ in range(ticks):
        tree.tick()
    journal._write()
    entries = [entry.data for entry in journal._file.observations("status")]
    return [(entry["tick"], entry["node"], entry["status"]) for entry in entries]


def test_status_is_written_when_it_changes(journal):
    one = leaf("one", Status.RUNNING, Status.RUNNING, Status.SUCCESS)
    two = leaf("two", Status.FAILURE)
    root = Sequence("root", memory=True, children=[one, two])
    assert recorded_statuses(journal, root, 3) == [
        (1, 1, "RUNNING"),
        (1, 0, "RUNNING"),
        (3, 1, "SUCCESS"),
        (3, 2, "FAILURE"),
        (3, 0, "FAILURE"),
    ]


def test_stopped_node_is_written_as_halted(journal):
    first = leaf("first", Status.FAILURE, Status.SUCCESS)
    second = leaf("second", Status.RUNNING)
    root = Selector("root", memory=False, children=[first, second])
    assert (2, 2, "HALTED") in recorded_statuses(journal, root, 2)


def test_tree_stopped_from_outside_is_written_down_to_its_leaves(journal):
    done, runs = leaf("done", Status.SUCCESS), leaf("runs", Status.RUNNING)
    root = Sequence("root", memory=True, children=[Sequence("inner", memory=True, children=[done]), runs])
    tree, watch = BehaviourTree(root), StatusWatch(root, journal)
    tree.add_visitor(watch)
    tree.tick()
    watch.initialise()
    root.stop(Status.INVALID)
    watch.finalise()
    journal._write()
    last = {entry.data["node"]: entry.data["status"] for entry in journal._file.observations("status")}
    assert last == {0: "HALTED", 1: "IDLE", 2: "IDLE", 3: "HALTED"}


def test_same_status_is_written_again_after_tick_without_node(journal):
    first = leaf("first", Status.FAILURE, Status.SUCCESS, Status.FAILURE)
    # py_trees does not reset its status: only the tick shows that it was active again.
    second = leaf("second", Status.SUCCESS)
    root = Selector("root", memory=False, children=[first, second])
    entries = recorded_statuses(journal, root, 4)
    assert [entry for entry in entries if entry[1] == 2] == [(1, 2, "SUCCESS"), (3, 2, "SUCCESS")]


def test_node_halted_after_skip_while_running_is_written_as_halted(journal):
    class Passed(SkippableLeaf):
        outcomes = [Status.RUNNING, SKIPPED]  # noqa: RUF012 - used by one instance

        def update(self):
            return self.outcomes.pop(0)

    first = leaf("first", Status.FAILURE, Status.FAILURE, Status.SUCCESS)
    tree = LiveTree(Selector("root", memory=False, children=[first, Passed("second")]))
    watch = StatusWatch(tree.root, journal)
    for _ in range(3):
        watched_tick(tree, watch)
    journal._write()
    entries = [entry.data for entry in journal._file.observations("status") if entry.data["node"] == 2]
    assert [entry["status"] for entry in entries] == ["RUNNING", "SKIPPED", "HALTED"]


def test_changed_message_is_written(journal):
    one = leaf("one", Status.RUNNING)
    tree = BehaviourTree(one)
    tree.add_visitor(StatusWatch(one, journal))
    for message in ("2.5 m left", "2.5 m left", "1.0 m left"):
        one.feedback_message = message
        one.update = lambda: Status.RUNNING
        tree.tick()
    journal._write()
    entries = [entry.data["message"] for entry in journal._file.observations("status")]
    assert entries == ["2.5 m left", "1.0 m left"]


def test_finished_node_is_written_as_idle_when_its_parent_restarts(journal):
    first = leaf("first", Status.SUCCESS, Status.FAILURE)
    second = leaf("second", Status.FAILURE)
    root = Sequence("root", memory=True, children=[first, second])
    assert recorded_statuses(journal, root, 3) == [
        (1, 1, "SUCCESS"),
        (1, 2, "FAILURE"),
        (1, 0, "FAILURE"),
        (2, 1, "FAILURE"),
        (2, 2, "IDLE"),
    ]


OUTCOMES = (
    Outcome("SUCCESS", "found"),
    Outcome("SUCCESS", "nothing"),
    Outcome("FAILURE", "no answer"),
    Outcome("RUNNING", "searching"),
)


def labels_of(journal, statuses, said, warnings):
    """Tick a leaf with declared outcomes that sets these labels; return the labels that are written."""
    one = Scripted("one", statuses, said)
    tree = BehaviourTree(one)
    tree.add_visitor(StatusWatch(one, journal, {one.id: OUTCOMES}, warnings.append))
    for _ in statuses:
        tree.tick()
    journal._write()
    return [entry.data["label"] for entry in journal._file.observations("status")]


class Scripted(Behaviour):
    def __init__(self, name, statuses, said):
        super().__init__(name)
        self._script = list(zip(statuses, said, strict=True))

    def update(self):
        status, label = self._script.pop(0)
        if label is not None:
            self.outcome_label = label
        return status


def test_outcome_label_of_leaf_is_written(journal):
    warnings: list[str] = []
    statuses = [Status.RUNNING, Status.SUCCESS, Status.SUCCESS, Status.FAILURE]
    # A status with one outcome needs no label, and an earlier label has no effect on it.
    assert labels_of(journal, statuses, [None, "found", "nothing", None], warnings) == [
        "searching",
        "found",
        "nothing",
        "no answer",
    ]
    assert warnings == []


def test_missing_label_is_not_guessed_from_several_outcomes(journal):
    warnings: list[str] = []
    assert labels_of(journal, [Status.SUCCESS], [None], warnings) == [""]
    assert warnings == []


def test_undeclared_outcome_label_is_reported_once_per_status(journal):
    warnings: list[str] = []
    statuses = [Status.SUCCESS, Status.SUCCESS, Status.FAILURE]
    assert labels_of(journal, statuses, ["fuond", "fuond", None], warnings) == ["", "no answer"]
    assert warnings == [
        "'one' (Scripted): its outcome_label 'fuond' is not a declared label for SUCCESS (declared labels: found, nothing).",
        "'one' (Scripted): its outcome_label 'fuond' is not a declared label for FAILURE (declared labels: no answer).",
    ]


def test_leaf_without_declared_outcomes_has_no_label(journal):
    assert recorded_statuses(journal, leaf("one", Status.SUCCESS), 1) == [(1, 0, "SUCCESS")]
    (entry,) = journal._file.observations("status")
    assert "label" not in entry.data


def test_leaf_ticked_twice_is_written_with_each_outcome(journal):
    one = Scripted("one", [Status.FAILURE, Status.SUCCESS], [None, "nothing"])
    live = LiveTree(one)
    visits: list[Visit] = []
    watch = StatusWatch(one, journal, {one.id: OUTCOMES})
    watch.initialise()
    live.tick_and_visit(visits)
    live.tick_and_visit(visits)
    for behaviour in show_visits(visits):
        watch.run(behaviour)
    journal._write()
    entries = [entry.data for entry in journal._file.observations("status")]
    assert [entry["label"] for entry in entries] == ["no answer", "nothing"]
    assert one.outcome_label == "nothing"


class Record:
    """Records events for leaves like a mission's record."""

    def __init__(self, journal):
        self._journal = journal

    def see(self, what):
        self._journal.record_event("seen", what=what)


class RecordingLeaf(Behaviour):
    """Records its start, ticks and end."""

    def __init__(self, name, record, *statuses):
        super().__init__(name)
        self._record, self._statuses = record, list(statuses)

    def initialise(self):
        self._record.see("the start")

    def update(self):
        self._record.see("the tick")
        return self._statuses.pop(0)

    def terminate(self, new_status):
        self._record.see(f"the end by {new_status.value}")

    def take_reply(self):
        self._record.see("a reply")


def facts_by_leaf(journal):
    """Return the recorded events, each with the leaf and the tick in the entry after it, or None."""
    journal._write()
    behind = {entry.number - 1: entry.data for entry in journal._file.observations("changed")}
    return [
        (fact.data["what"], *(behind.get(fact.number, {}).get(key) for key in ("leaf", "tick")))
        for fact in journal._file.entries(1, with_watched=False)
    ]


def test_event_is_followed_by_its_leaf_and_tick_unless_between_ticks(journal):
    one = RecordingLeaf("one", Record(journal), Status.RUNNING, Status.SUCCESS)
    tree = BehaviourTree(Sequence("root", memory=True, children=[leaf("first", Status.SUCCESS), one]))
    tree.add_visitor(StatusWatch(tree.root, journal))
    tree.tick()
    one.take_reply()
    tree.tick()
    assert facts_by_leaf(journal) == [
        ("the start", 2, 1),
        ("the tick", 2, 1),
        ("a reply", None, None),
        ("the tick", 2, 2),
        ("the end by SUCCESS", 2, 2),
    ]


def test_event_recorded_by_control_node_has_no_leaf(journal):
    class Around(Sequence):
        def stop(self, new_status=Status.INVALID):
            journal.record_event("seen", what="the end")
            super().stop(new_status)

    tree = BehaviourTree(Around("root", memory=True, children=[leaf("one", Status.FAILURE)]))
    tree.add_visitor(StatusWatch(tree.root, journal))
    tree.tick()
    assert {fact[1:] for fact in facts_by_leaf(journal)} == {(None, None)}


def test_unchanged_status_is_written_if_leaf_recorded_an_event(journal):
    one = RecordingLeaf("one", Record(journal), *[Status.RUNNING] * 3)
    one._record.see = lambda what: (
        journal.record_event("seen", what=what) if len(one._statuses) != 2 else None
    )
    assert recorded_statuses(journal, one, 3) == [(1, 0, "RUNNING"), (3, 0, "RUNNING")]
