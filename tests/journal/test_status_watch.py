"""What is written of the nodes of a tree."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import StatusQueue
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.trees import BehaviourTree

from sar_compiler.journal.opening import open_journal
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.runtime.answers import OVERRIDDEN, Answer
from sar_compiler.runtime.kernel.live import LiveTree, show_visits
from sar_compiler.runtime.kernel.tree_nodes import Visit


@pytest.fixture
def journal(tmp_path):
    journal = open_journal(tmp_path / "mission.journal")
    journal.begin({}, {})
    yield journal
    journal.close()


def leaf(name, *statuses):
    return StatusQueue(name, list(statuses), eventually=statuses[-1])


def watched(journal, root, ticks):
    """Tick a tree; return of each entry the tick, the node's number and its status."""
    tree = BehaviourTree(root)
    tree.add_visitor(StatusWatch(root, journal))
    for _ in range(ticks):
        tree.tick()
    journal._write()
    entries = [entry.data for entry in journal._file.watched("status")]
    return [(entry["tick"], entry["node"], entry["status"]) for entry in entries]


def test_a_status_is_written_when_it_changes(journal):
    one = leaf("one", Status.RUNNING, Status.RUNNING, Status.SUCCESS)
    two = leaf("two", Status.FAILURE)
    root = Sequence("root", memory=True, children=[one, two])
    assert watched(journal, root, 3) == [
        (1, 1, "RUNNING"),
        (1, 0, "RUNNING"),
        (3, 1, "SUCCESS"),
        (3, 2, "FAILURE"),
        (3, 0, "FAILURE"),
    ]


def test_a_node_that_is_stopped_is_written_as_halted(journal):
    first = leaf("first", Status.FAILURE, Status.SUCCESS)
    second = leaf("second", Status.RUNNING)
    root = Selector("root", memory=False, children=[first, second])
    assert (2, 2, "HALTED") in watched(journal, root, 2)


def test_a_message_that_changes_is_written(journal):
    one = leaf("one", Status.RUNNING)
    tree = BehaviourTree(one)
    tree.add_visitor(StatusWatch(one, journal))
    for message in ("2.5 m left", "2.5 m left", "1.0 m left"):
        one.feedback_message = message
        one.update = lambda: Status.RUNNING
        tree.tick()
    journal._write()
    entries = [entry.data["message"] for entry in journal._file.watched("status")]
    assert entries == ["2.5 m left", "1.0 m left"]


def test_a_node_that_had_ended_is_written_as_idle_once_what_is_above_it_begins_anew(journal):
    first = leaf("first", Status.SUCCESS, Status.FAILURE)
    second = leaf("second", Status.FAILURE)
    root = Sequence("root", memory=True, children=[first, second])
    assert watched(journal, root, 3) == [
        (1, 1, "SUCCESS"),
        (1, 2, "FAILURE"),
        (1, 0, "FAILURE"),
        (2, 1, "FAILURE"),
        (2, 2, "IDLE"),
    ]


SAYING = (
    Answer("SUCCESS", "found"),
    Answer("SUCCESS", "nothing"),
    Answer("FAILURE", "no answer"),
    Answer("RUNNING", "searching"),
)


def labels_of(journal, statuses, said, warnings):
    """Tick a leaf that has declared answers; return the labels that are written, where it has said these."""
    one = Scripted("one", statuses, said)
    tree = BehaviourTree(one)
    tree.add_visitor(StatusWatch(one, journal, {one.id: SAYING}, warnings.append))
    for _ in statuses:
        tree.tick()
    journal._write()
    return [entry.data["label"] for entry in journal._file.watched("status")]


class Scripted(Behaviour):
    def __init__(self, name, statuses, said):
        super().__init__(name)
        self._script = list(zip(statuses, said, strict=True))

    def update(self):
        status, label = self._script.pop(0)
        if label is not None:
            self.answer_label = label
        return status


def test_the_answer_that_a_leaf_has_given_is_written(journal):
    warnings: list[str] = []
    statuses = [Status.RUNNING, Status.SUCCESS, Status.SUCCESS, Status.FAILURE]
    # Of a status with one answer nothing is to be said, and what was said before counts for nothing then.
    assert labels_of(journal, statuses, [None, "found", "nothing", None], warnings) == [
        "searching",
        "found",
        "nothing",
        "no answer",
    ]
    assert warnings == []


def test_which_of_several_answers_it_was_is_not_guessed(journal):
    warnings: list[str] = []
    assert labels_of(journal, [Status.SUCCESS], [None], warnings) == [""]
    assert warnings == []


def test_an_answer_that_is_not_declared_is_told_once(journal):
    warnings: list[str] = []
    statuses = [Status.SUCCESS, Status.SUCCESS, Status.FAILURE]
    assert labels_of(journal, statuses, ["fuond", "fuond", None], warnings) == ["", "no answer"]
    assert warnings == [
        "'one' (Scripted): its answer_label is 'fuond' with SUCCESS, of which it has declared: found, nothing.",
        "'one' (Scripted): its answer_label is 'fuond' with FAILURE, of which it has declared: no answer.",
    ]


def test_of_a_leaf_without_declared_answers_there_is_no_label(journal):
    assert watched(journal, leaf("one", Status.SUCCESS), 1) == [(1, 0, "SUCCESS")]
    (entry,) = journal._file.watched("status")
    assert "label" not in entry.data


def test_what_was_put_in_its_place_from_outside_is_no_answer(journal):
    (label,) = labels_of(journal, [Status.FAILURE], [OVERRIDDEN], [])
    assert label == OVERRIDDEN


def test_a_leaf_that_was_ticked_twice_is_shown_with_each_of_its_answers(journal):
    one = Scripted("one", [Status.FAILURE, Status.SUCCESS], [None, "nothing"])
    live = LiveTree(one)
    visits: list[Visit] = []
    watch = StatusWatch(one, journal, {one.id: SAYING})
    watch.initialise()
    live.tick_and_visit(visits)
    live.tick_and_visit(visits)
    for behaviour in show_visits(visits):
        watch.run(behaviour)
    journal._write()
    entries = [entry.data for entry in journal._file.watched("status")]
    assert [entry["label"] for entry in entries] == ["no answer", "nothing"]
    assert one.answer_label == "nothing"
