"""A tree that is ticked for real is that of py_trees, whoever touches it between two ticks."""

from py_trees import composites, decorators
from py_trees.behaviours import StatusQueue, Success
from py_trees.common import OneShotPolicy, Status

from sar_compiler.runtime.kernel.cells import FAILURE, RUNNING, SUCCESS
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
