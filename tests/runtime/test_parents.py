"""What all nodes with children have in common."""

import pytest
from py_trees import composites
from py_trees.common import ParallelPolicy, Status

from sar_compiler.runtime.controls import Fallback, Sequence
from sar_compiler.runtime.decorators import Inverter, SubTree
from tests.conformance.leaves import ScriptedError
from tests.runtime.stage import Stage


def test_a_node_that_is_halted_halts_its_running_children_in_order():
    stage = Stage()
    root = Sequence("s", memory=True, children=[stage.leaf("a"), Inverter("i", stage.leaf("b", "R"))])
    assert stage.tick(root) == "R: a=S b=R"
    root.stop(Status.INVALID)
    assert stage.told() == "halt b"
    assert {node.status for node in root.iterate()} == {Status.INVALID}


def test_a_node_that_does_not_run_is_halted_without_a_word():
    stage = Stage()
    root = Sequence("s", memory=True, children=stage.leaves(a="S", b="F"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == ""


def test_a_skipped_tick_leaves_the_status_and_says_so():
    stage = Stage()
    root = Inverter("i", stage.leaf("a", "K,S"))
    assert stage.tick(root) == "K: a=K"
    assert (root.status, root.skipped) == (Status.RUNNING, True)
    assert stage.tick(root) == "F: a=S"
    assert not root.skipped


def test_what_a_leaf_raises_goes_through_and_the_tree_can_be_halted_afterwards():
    stage = Stage()
    root = composites.Parallel(
        "p",
        ParallelPolicy.SuccessOnAll(synchronise=False),
        [
            Sequence("s", memory=True, children=[stage.leaf("a", "R")]),
            Sequence("t", memory=True, children=[stage.leaf("b", "X")]),
        ],
    )
    with pytest.raises(ScriptedError):
        root.tick_once()
    stage.told()
    for node in root.iterate():
        if node.status == Status.RUNNING:
            node.stop(Status.INVALID)
    assert stage.told() == "halt a"
    assert {node.status for node in root.iterate()} == {Status.INVALID}


def test_the_tip_is_the_leaf_that_runs_or_the_node_that_has_ended():
    stage = Stage()
    first = Inverter("i", stage.leaf("a", "R,F"))
    root = Sequence("s", memory=True, children=[first])
    stage.tick(root)
    assert root.tip() is first.decorated
    stage.tick(root)
    assert root.tip() is root
    root.stop(Status.INVALID)
    assert root.tip() is None


def test_a_stock_composite_restarts_a_node_of_ours_that_it_has_not_reset():
    stage = Stage()
    root = composites.Selector(
        "stock", memory=False, children=[Fallback("f", memory=True, children=stage.leaves(a="F", b="F,S"))]
    )
    assert stage.ticks(root, 2) == ["F: a=F b=F", "S: a=F b=S"]


def test_every_node_that_is_ticked_is_yielded_children_first():
    stage = Stage()
    root = Sequence(
        "s", memory=True, children=[Inverter("i", stage.leaf("a", "F")), SubTree("t", stage.leaf("b"))]
    )
    assert [node.name for node in root.tick()] == ["a", "i", "b", "t", "s"]


def test_to_stop_a_node_with_an_end_says_how_it_ended_and_halts_nobody():
    stage = Stage()
    root = Inverter("i", stage.leaf("a", "R"))
    stage.tick(root)
    root.stop(Status.SUCCESS)
    assert (root.status, root.update(), stage.told()) == (Status.SUCCESS, Status.SUCCESS, "")
