"""A tree that is ticked for real is that of py_trees, whoever touches it between two ticks."""

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
from tests.runtime.own import own
from tests.runtime.stage import Stage

RunOnce = own("RunOnce")


def test_what_a_leaf_remembers_is_its_own_and_can_be_changed():
    leaf = StatusQueue("q", [Status.RUNNING, Status.SUCCESS], eventually=Status.FAILURE)
    live = LiveTree(composites.Sequence("root", memory=True, children=[leaf]))
    assert live.tick() == RUNNING
    leaf.current_queue = [Status.FAILURE]
    assert live.tick() == FAILURE


def test_a_composite_that_somebody_stops_begins_again():
    stage = Stage()
    root = composites.Sequence("root", memory=True, children=stage.leaves(a="S", b="R"))
    live = LiveTree(root)
    live.tick()
    root.stop(Status.INVALID)
    live.tick()
    assert stage.told() == "a=S b=R halt b a=S b=R"


@pytest.mark.parametrize("last", ["R", "S"])
def test_the_current_child_is_pointed_at_again_after_somebody_has_stopped_the_composite(last):
    root = composites.Sequence("root", memory=True, children=Stage().leaves(a="S", b=last))
    live = LiveTree(root)
    live.tick()
    root.stop(Status.INVALID)
    live.tick()
    assert root.tip() is root.children[1]


def test_how_a_oneshot_has_ended_can_be_read_from_it():
    root = decorators.OneShot("once", Success("a"), OneShotPolicy.ON_COMPLETION)
    LiveTree(root).tick()
    assert root.final_status is Status.SUCCESS
    assert LiveTree(root).tick() == SUCCESS


def test_a_child_that_comes_later_is_seen_even_where_there_was_none():
    root = composites.Selector("root", memory=False, children=[])
    live = LiveTree(root)
    assert (live.tick(), live.is_whole()) == (FAILURE, True)
    root.add_child(Success("a"))
    assert not live.is_whole()


def test_nodes_remember_what_they_did_when_the_tree_around_them_changes():
    stage = Stage()
    once = RunOnce("once", stage.leaf("a"))
    memory = composites.Sequence("memory", memory=True, children=stage.leaves(b="S", c="R"))
    root = Sequence("root", memory=False, children=[once, memory])
    live = LiveTree(root)
    assert live.tick() == RUNNING
    root.add_child(stage.leaf("d"))
    later = LiveTree(root, former=live)
    stage.told()
    assert later.tick() == RUNNING
    assert stage.told() == "c=R"


def test_a_composite_below_others_that_somebody_stops_begins_again():
    stage = Stage()
    inner = composites.Sequence("inner", memory=True, children=stage.leaves(a="S", b="R"))
    live = LiveTree(composites.Sequence("root", memory=True, children=[stage.leaf("first"), inner]))
    live.tick()
    inner.stop(Status.INVALID)
    live.tick()
    assert stage.told() == "first=S a=S b=R halt b a=S b=R"


def test_a_branch_that_has_succeeded_is_ticked_again_in_a_parallel_if_somebody_has_stopped_it():
    stage = Stage()
    ended = composites.Sequence("ended", memory=True, children=stage.leaves(a="S"))
    policy = ParallelPolicy.SuccessOnAll(synchronise=True)
    live = LiveTree(composites.Parallel("root", policy, children=[ended, stage.leaf("b", "R")]))
    live.tick()
    live.tick()
    ended.stop(Status.INVALID)
    live.tick()
    assert stage.told() == "a=S b=R b=R a=S b=R"


class Observed(Behaviour):
    """A behaviour that is ticked by a method of its own, and says how often its status was read."""

    looks = 0

    def update(self) -> Status:
        return Status.SUCCESS

    def tick(self):
        self.status = Status.SUCCESS
        yield self

    @property
    def status(self) -> Status:
        type(self).looks += 1
        return self._status

    @status.setter
    def status(self, status: Status) -> None:
        self._status = status


def test_a_tick_looks_at_no_node_that_it_does_not_reach():
    done = [Observed(f"done {number}") for number in range(20)]
    live = LiveTree(composites.Sequence("root", memory=True, children=[*done, Stage().leaf("runs", "R")]))
    live.tick()
    before = Observed.looks
    live.tick()
    assert Observed.looks == before


def test_a_node_that_stops_another_one_within_the_tick_stops_it_once():
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
    assert stage.told() == "a=R halt a a=R halt a"


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
def test_whatever_is_done_to_a_list_of_children_is_seen(change):
    root = composites.Selector("root", memory=False, children=[Success("c"), Success("b"), Success("a")])
    live = LiveTree(root)
    change(root.children)
    assert not live.is_whole()


def test_a_change_of_another_tree_is_none_of_this_one():
    live, other = (
        LiveTree(composites.Selector("root", memory=False, children=[Success("a")])) for _ in range(2)
    )
    other.root.add_child(Success("b"))
    assert (live.is_whole(), other.is_whole()) == (True, False)


def test_the_children_of_a_node_are_copied_as_a_list():
    root = composites.Selector("root", memory=False, children=[Success("a")])
    LiveTree(root)
    assert type(copy.copy(root.children)) is list


def test_a_decorator_of_py_trees_is_asked_again_only_where_its_child_says_something_else(monkeypatch):
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


def test_a_decorator_whose_message_somebody_has_taken_tells_it_again():
    root = decorators.SuccessIsRunning("root", Success("a"))
    live = LiveTree(root)
    live.tick()
    root.feedback_message = ""
    live.tick()
    assert root.feedback_message == "success is running [success]"


def test_a_decorator_is_asked_again_where_its_child_comes_to_something_else():
    root = decorators.Inverter("root", StatusQueue("q", [Status.SUCCESS, Status.FAILURE], Status.FAILURE))
    live = LiveTree(root)
    assert [live.tick() for _ in range(3)] == [FAILURE, SUCCESS, SUCCESS]


@pytest.mark.parametrize("constant", [Success, Failure])
def test_a_constant_that_is_held_to_statuses_keeps_its_node_and_rests_without_a_message(constant):
    leaf = constant("a")
    insist_on_status(leaf)
    LiveTree(own("ReactiveSequence")("root", [leaf])).tick()
    assert (leaf.status, leaf.feedback_message) == (Status.INVALID, "")
