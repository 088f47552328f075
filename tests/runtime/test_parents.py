"""Tests of the behaviour that all nodes with children share."""

import itertools
from collections.abc import Iterator

import pytest
from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status

from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.kernel.cells import RUNNING
from sar_compiler.runtime.kernel.table import NotFlatError, flatten
from sar_compiler.runtime.kernel.times import ClockTimes
from sar_compiler.runtime.kernel.turning import SubTreeNode, TurningNode
from sar_compiler.runtime.kernel.user_nodes import Tick
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.skipping import SKIPPED
from sar_compiler.runtime.stock import Fallback, Sequence, SequenceWithMemory
from sar_compiler.runtime.ticking import Control, Decorator, OwnDecorator, behaviour_class
from tests.conformance.leaves import ScriptedError
from tests.runtime.kernel.flat import cells_of, tick
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

Parallel = own("Parallel")
TryCatch = own("TryCatch")
Inverter = own("Inverter")
SubTree = own("SubTree")


def test_halted_node_halts_running_descendants():
    stage = Stage()
    root = Sequence("s", memory=True, children=[stage.leaf("a"), Inverter("i", stage.leaf("b", "R"))])
    assert stage.tick(root) == "R: a=S b=R"
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt b"
    assert {node.status for node in root.iterate()} == {Status.INVALID}


def test_halting_ended_node_halts_no_child():
    stage = Stage()
    root = Sequence("s", memory=True, children=stage.leaves(a="S", b="F"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == ""


def test_skipped_tick_keeps_status_and_sets_skipped_flag():
    stage = Stage()
    root = Inverter("i", stage.leaf("a", "K,S"))
    assert stage.tick(root) == "K: a=K"
    assert (root.status, root.skipped) == (Status.RUNNING, True)
    assert stage.tick(root) == "F: a=S"
    assert not root.skipped


def test_exception_in_leaf_propagates_and_tree_can_be_halted():
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
    stage.new_events()
    for node in root.iterate():
        if node.status == Status.RUNNING:
            node.stop(Status.INVALID)
    assert stage.new_events() == "halt a"
    assert {node.status for node in root.iterate()} == {Status.INVALID}


def test_tip_is_running_leaf_or_ended_node():
    stage = Stage()
    first = Inverter("i", stage.leaf("a", "R,F"))
    root = Sequence("s", memory=True, children=[first])
    stage.tick(root)
    assert root.tip() is first.decorated
    stage.tick(root)
    assert root.tip() is root
    root.stop(Status.INVALID)
    assert root.tip() is None


def test_py_trees_composite_restarts_own_node_without_reset():
    stage = Stage()
    root = composites.Selector(
        "stock", memory=False, children=[Fallback("f", memory=True, children=stage.leaves(a="F", b="F,S"))]
    )
    assert stage.ticks(root, 2) == ["F: a=F b=F", "S: a=F b=S"]


def test_ticked_nodes_are_yielded_children_first():
    stage = Stage()
    root = Sequence(
        "s", memory=True, children=[Inverter("i", stage.leaf("a", "F")), SubTree("t", stage.leaf("b"))]
    )
    assert [node.name for node in root.tick()] == ["a", "i", "b", "t", "s"]


def test_stopping_node_with_final_status_sets_it_and_halts_no_child():
    stage = Stage()
    root = Inverter("i", stage.leaf("a", "R"))
    stage.tick(root)
    root.stop(Status.SUCCESS)
    assert (root.status, root.update(), stage.new_events()) == (Status.SUCCESS, Status.SUCCESS, "")


class MessageLeaf(Behaviour):
    """Sets a message, and replaces it when it is halted."""

    def __init__(self, name: str, answer: Status = Status.SUCCESS) -> None:
        super().__init__(name)
        self.answer = answer

    def update(self) -> Status:
        self.feedback_message = f"{self.name} is at work"
        return self.answer

    def terminate(self, new_status: Status) -> None:
        if new_status == Status.INVALID:
            self.feedback_message = "halted"


def test_visitor_sees_each_node_as_after_its_own_tick():
    stage = Stage()
    ended, halted = MessageLeaf("a"), MessageLeaf("b", Status.RUNNING)
    root = Parallel(
        "p", [Inverter("i", ended), SubTree("t", halted), stage.leaf("c", "F")], Input(2), Input(2)
    )
    seen = [(node.name, node.status.name, node.feedback_message) for node in root.tick()]
    assert seen == [
        ("a", "SUCCESS", "a is at work"),
        ("i", "FAILURE", ""),
        ("b", "RUNNING", "b is at work"),
        ("t", "RUNNING", ""),
        ("c", "FAILURE", ""),
        ("p", "FAILURE", "0 succeeded, 2 failed"),
    ]
    assert [(node.status.name, node.feedback_message) for node in (ended, halted)] == [
        ("INVALID", "a is at work"),
        ("INVALID", "halted"),
    ]


def test_tree_stopped_by_visitor_stays_stopped():
    leaf = MessageLeaf("a", Status.RUNNING)
    root = Sequence("s", memory=True, children=[SubTree("t", leaf)])
    for node in root.tick():
        if node is leaf:
            root.stop(Status.INVALID)
    assert {node.status for node in root.iterate()} == {Status.INVALID}


def test_nodes_ticked_before_exception_are_yielded():
    stage = Stage()
    root = Sequence("s", memory=True, children=[Inverter("i", stage.leaf("a", "F")), stage.leaf("b", "X")])
    ticked = root.tick()
    seen = [(node.name, node.status.name) for node in itertools.islice(ticked, 2)]
    with pytest.raises(ScriptedError):
        next(ticked)
    assert seen == [("a", "FAILURE"), ("i", "SUCCESS")]


def test_added_children_are_ticked_and_removed_ones_are_not():
    stage = Stage()
    root = Sequence("s", memory=True, children=[stage.leaf("a")])
    assert stage.tick(root) == "S: a=S"
    root.add_child(stage.leaf("b"))
    assert stage.tick(root) == "S: a=S b=S"
    root.remove_child(root.children[0])
    assert stage.tick(root) == "S: b=S"


def test_node_and_its_flat_tree_keep_separate_states():
    stage = Stage()
    root = SequenceWithMemory("s", children=stage.leaves(a="S", b="R"))
    flat, times = flatten(root), ClockTimes(lambda _: ManualClock())
    ticker = flat.ticker(times)
    assert stage.ticks(root, 2) == ["R: a=S", "R: b=R"]
    before = cells_of(ticker)
    assert tick(flat, ticker) == RUNNING
    assert (stage.new_events(), before) == ("a=S", cells_of(flat.ticker(times)))
    assert stage.tick(root) == "R: b=R"


class OwnSubclass(behaviour_class(OwnDecorator, TurningNode)):  # type: ignore[misc]
    """A subclass without its own builder."""

    turned = "FAILURE", "SUCCESS", "SKIPPED"


def test_subclass_ticks_like_its_base():
    stage = Stage()
    assert stage.tick(OwnSubclass("o", stage.leaf("a"))) == "F: a=S"


class Unknown(Control):
    """A control without a builder."""


def test_control_without_builder_is_rejected_with_class():
    with pytest.raises(NotFlatError, match=r"'u' is a .*test_parents.Unknown"):
        Unknown("u", [MessageLeaf("a")]).tick_once()


def test_nodes_ticked_during_halt_are_not_yielded():
    stage = Stage()
    tried = TryCatch("t", stage.leaves(b="R", catch="S"), Input(source=True))
    root = Parallel("p", [tried, stage.leaf("d", "F")])
    assert [node.name for node in root.tick()] == ["b", "t", "d", "p"]
    assert stage.new_events() == "b=R d=F halt b catch=S"


class DecoratorWithOwnTick(behaviour_class(OwnDecorator, SubTreeNode)):  # type: ignore[misc]
    """Overrides `tick`, and always fails."""

    def tick(self) -> Iterator[Behaviour]:
        self.status = Status.FAILURE
        yield self


def test_overridden_tick_of_child_is_called():
    stage = Stage()
    assert stage.tick(Inverter("i", DecoratorWithOwnTick("r", stage.leaf("a")))) == "S:"


class RoundRobinControl(Control):
    """Ticks one child in each activation, in turn, for half a second at most."""

    def __init__(self, name: str, children: list[Behaviour], clock: Clock) -> None:
        super().__init__(name, children)
        self.clock = clock
        self.turn, self.ticks = self.cell(keeps=True), self.cell()

    def begin(self, tick: Tick) -> Behaviour | Status:
        tick[self.ticks] += 1
        if tick[self.ticks] == 1:
            tick.start_timer(0.5)
        elif tick.time_is_up():
            return Status.FAILURE
        turn: int = tick[self.turn]
        return self.children[turn]

    def resume(self, tick: Tick, outcome: Status) -> Behaviour | Status:
        if outcome is SKIPPED:
            return SKIPPED
        if outcome is not Status.RUNNING:
            tick[self.turn] = (tick[self.turn] + 1) % len(self.children)
        self.feedback_message = f"tick {tick[self.ticks]}"
        return outcome


def test_user_control_resumes_from_cells_and_keeps_persistent_ones():
    stage, clock = Stage(), ManualClock()
    root = RoundRobinControl("t", stage.leaves(a="R,S", b="F,K,S"), clock)
    assert stage.ticks(root, 5) == ["R: a=R", "S: a=S", "F: b=F", "S: a=S", "K: b=K"]
    assert root.feedback_message == "tick 1"


def test_timed_out_user_control_halts_child_and_starts_over():
    stage, clock = Stage(), ManualClock()
    root = RoundRobinControl("t", stage.leaves(a="R", b="S"), clock)
    assert stage.ticks(root, 2) == ["R: a=R", "R: a=R"]
    clock.advance(0.5)
    assert stage.ticks(root, 2) == ["F: halt a", "R: a=R"]
    root.stop(Status.INVALID)
    clock.advance(0.4)
    assert [stage.new_events(), *stage.ticks(root, 2)] == ["halt a", "R: a=R", "R: a=R"]


def test_user_decorator_returns_outcome_of_child():
    stage = Stage()
    assert stage.ticks(Decorator("d", stage.leaf("a", "R,F,K,S")), 4) == [
        "R: a=R",
        "F: a=F",
        "K: a=K",
        "S: a=S",
    ]
    assert (
        stage.tick(composites.Sequence("s", memory=True, children=[Decorator("d", stage.leaf("b"))]))
        == "S: b=S"
    )


@pytest.mark.parametrize("value", [[1], {"a": 1}])
def test_cell_rejects_mutable_value(value):
    class Listing(Decorator):
        def begin(self, tick: Tick) -> Behaviour | Status:
            tick[self.cells[0]] = value
            return super().begin(tick)

    listing = Listing("l", MessageLeaf("a"))
    listing.cell()
    with pytest.raises(TypeError, match="unhashable"):
        listing.tick_once()
