"""Tests of the live tree: it stays in step with the py_trees nodes, even if other code changes them between two ticks."""

import copy
import random

import pytest
from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure, StatusQueue, Success
from py_trees.common import OneShotPolicy, ParallelPolicy, Status

from sar_compiler.runtime.kernel.cells import FAILURE, RUNNING, SUCCESS
from sar_compiler.runtime.kernel.leaf_nodes import insist_on_status
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.stock import Sequence
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

RunOnce = own("RunOnce")


def test_changed_attribute_of_leaf_takes_effect():
    leaf = StatusQueue("q", [Status.RUNNING, Status.SUCCESS], eventually=Status.FAILURE)
    live = LiveTree(composites.Sequence("root", memory=True, children=[leaf]))
    assert live.tick() == RUNNING
    leaf.current_queue = [Status.FAILURE]
    assert live.tick() == FAILURE


def test_stopped_composite_starts_over():
    stage = Stage()
    root = composites.Sequence("root", memory=True, children=stage.leaves(a="S", b="R"))
    live = LiveTree(root)
    live.tick()
    root.stop(Status.INVALID)
    live.tick()
    assert stage.new_events() == "a=S b=R halt b a=S b=R"


@pytest.mark.parametrize("last", ["R", "S"])
def test_tip_is_last_ticked_child_after_stopped_composite_restarts(last):
    root = composites.Sequence("root", memory=True, children=Stage().leaves(a="S", b=last))
    live = LiveTree(root)
    live.tick()
    root.stop(Status.INVALID)
    live.tick()
    assert root.tip() is root.children[1]


def test_oneshot_exposes_final_status():
    root = decorators.OneShot("once", Success("a"), OneShotPolicy.ON_COMPLETION)
    LiveTree(root).tick()
    assert root.final_status is Status.SUCCESS
    assert LiveTree(root).tick() == SUCCESS


def test_child_added_to_empty_composite_is_noticed():
    root = composites.Selector("root", memory=False, children=[])
    live = LiveTree(root)
    assert (live.tick(), live.is_whole()) == (FAILURE, True)
    root.add_child(Success("a"))
    assert not live.is_whole()


def test_nodes_keep_their_state_when_tree_changes():
    stage = Stage()
    once = RunOnce("once", stage.leaf("a"))
    memory = composites.Sequence("memory", memory=True, children=stage.leaves(b="S", c="R"))
    root = Sequence("root", memory=False, children=[once, memory])
    live = LiveTree(root)
    assert live.tick() == RUNNING
    root.add_child(stage.leaf("d"))
    later = LiveTree(root, former=live)
    stage.new_events()
    assert later.tick() == RUNNING
    assert stage.new_events() == "c=R"


def test_stopped_inner_composite_starts_over():
    stage = Stage()
    inner = composites.Sequence("inner", memory=True, children=stage.leaves(a="S", b="R"))
    live = LiveTree(composites.Sequence("root", memory=True, children=[stage.leaf("first"), inner]))
    live.tick()
    inner.stop(Status.INVALID)
    live.tick()
    assert stage.new_events() == "first=S a=S b=R halt b a=S b=R"


def test_succeeded_branch_of_parallel_is_ticked_again_if_stopped():
    stage = Stage()
    ended = composites.Sequence("ended", memory=True, children=stage.leaves(a="S"))
    policy = ParallelPolicy.SuccessOnAll(synchronise=True)
    live = LiveTree(composites.Parallel("root", policy, children=[ended, stage.leaf("b", "R")]))
    live.tick()
    live.tick()
    ended.stop(Status.INVALID)
    live.tick()
    assert stage.new_events() == "a=S b=R b=R a=S b=R"


class StatusReadCounter(Behaviour):
    """A behaviour with its own `tick`, which counts how often its status was read."""

    reads = 0

    def update(self) -> Status:
        return Status.SUCCESS

    def tick(self):
        self.status = Status.SUCCESS
        yield self

    @property
    def status(self) -> Status:
        type(self).reads += 1
        return self._status

    @status.setter
    def status(self, status: Status) -> None:
        self._status = status


def test_tick_reads_no_status_of_unreached_nodes():
    done = [StatusReadCounter(f"done {number}") for number in range(20)]
    live = LiveTree(composites.Sequence("root", memory=True, children=[*done, Stage().leaf("runs", "R")]))
    live.tick()
    before = StatusReadCounter.reads
    live.tick()
    assert StatusReadCounter.reads == before


def test_node_stopped_by_another_during_tick_is_halted_once():
    stage = Stage()
    first = composites.Sequence("first", memory=True, children=stage.leaves(a="R"))

    class Stopper(Behaviour):
        def update(self) -> Status:
            first.stop(Status.INVALID)
            return Status.RUNNING

    policy = ParallelPolicy.SuccessOnAll(synchronise=False)
    live = LiveTree(composites.Parallel("root", policy, children=[first, Stopper("stopper")]))
    live.tick()
    live.tick()
    assert stage.new_events() == "a=R halt a a=R halt a"


@pytest.mark.parametrize(
    "change",
    [
        lambda children: children.reverse(),
        lambda children: children.clear(),
        lambda children: children.pop(),
        lambda children: children.remove(children[0]),
        lambda children: children.insert(1, Success("new")),
        lambda children: children.extend([Success("new")]),
        lambda children: children.__iadd__([Success("new")]),
        lambda children: children.__imul__(2),
        lambda children: children.__setitem__(0, Success("new")),
        lambda children: children.__delitem__(0),
        lambda children: random.Random(1).shuffle(children),  # noqa: S311
        lambda children: children.sort(key=lambda child: child.name),
    ],
)
def test_every_change_of_children_list_is_noticed(change):
    root = composites.Selector("root", memory=False, children=[Success("c"), Success("b"), Success("a")])
    live = LiveTree(root)
    change(root.children)
    assert not live.is_whole()


def test_change_of_other_tree_is_ignored():
    live, other = (
        LiveTree(composites.Selector("root", memory=False, children=[Success("a")])) for _ in range(2)
    )
    other.root.add_child(Success("b"))
    assert (live.is_whole(), other.is_whole()) == (True, False)


def test_copy_of_children_is_plain_list():
    root = composites.Selector("root", memory=False, children=[Success("a")])
    LiveTree(root)
    assert type(copy.copy(root.children)) is list


def test_py_trees_decorator_is_updated_only_when_child_changes(monkeypatch):
    asked, update = [], decorators.SuccessIsRunning.update

    def counted(decorator):
        asked.append(decorator.name)
        return update(decorator)

    monkeypatch.setattr(decorators.SuccessIsRunning, "update", counted)
    leaf = Success("a")
    root = decorators.SuccessIsRunning("root", leaf)
    live = LiveTree(root)
    for _ in range(3):
        assert live.tick() == RUNNING
    assert (len(asked), root.feedback_message) == (1, "success is running [success]")
    leaf.feedback_message = "done"
    live.tick()
    live.tick()
    assert (len(asked), root.feedback_message) == (2, "success is running [done]")


def test_cleared_message_of_decorator_is_set_again():
    root = decorators.SuccessIsRunning("root", Success("a"))
    live = LiveTree(root)
    live.tick()
    root.feedback_message = ""
    live.tick()
    assert root.feedback_message == "success is running [success]"


def test_decorator_is_updated_when_status_of_child_changes():
    root = decorators.Inverter("root", StatusQueue("q", [Status.SUCCESS, Status.FAILURE], Status.FAILURE))
    live = LiveTree(root)
    assert [live.tick() for _ in range(3)] == [FAILURE, SUCCESS, SUCCESS]


@pytest.mark.parametrize("constant", [Success, Failure])
def test_constant_leaf_with_status_check_is_reset_without_message(constant):
    leaf = constant("a")
    insist_on_status(leaf)
    LiveTree(own("ReactiveSequence")("root", [leaf])).tick()
    assert (leaf.status, leaf.feedback_message) == (Status.INVALID, "")
