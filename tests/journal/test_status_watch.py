"""What is written of the nodes of a tree."""

import pytest
from py_trees.behaviours import StatusQueue
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.trees import BehaviourTree

from sar_compiler.journal.opening import open_journal
from sar_compiler.journal.status_watch import StatusWatch


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
