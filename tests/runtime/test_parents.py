"""What all nodes with children have in common."""

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
from tests.runtime.own import own
from tests.runtime.stage import Stage

Parallel = own("Parallel")
TryCatch = own("TryCatch")
Inverter = own("Inverter")
SubTree = own("SubTree")


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


class Telling(Behaviour):
    """Succeeds, and forgets what it has told when it is halted."""

    def __init__(self, name: str, answer: Status = Status.SUCCESS) -> None:
        super().__init__(name)
        self.answer = answer

    def update(self) -> Status:
        self.feedback_message = f"{self.name} is at work"
        return self.answer

    def terminate(self, new_status: Status) -> None:
        if new_status == Status.INVALID:
            self.feedback_message = "halted"


def test_a_visitor_sees_each_node_as_it_was_after_its_own_tick():
    stage = Stage()
    ended, halted = Telling("a"), Telling("b", Status.RUNNING)
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


def test_a_visitor_that_stops_the_tree_leaves_it_stopped():
    leaf = Telling("a", Status.RUNNING)
    root = Sequence("s", memory=True, children=[SubTree("t", leaf)])
    for node in root.tick():
        if node is leaf:
            root.stop(Status.INVALID)
    assert {node.status for node in root.iterate()} == {Status.INVALID}


def test_the_nodes_ticked_before_a_leaf_raised_are_shown():
    stage = Stage()
    root = Sequence("s", memory=True, children=[Inverter("i", stage.leaf("a", "F")), stage.leaf("b", "X")])
    ticked = root.tick()
    seen = [(node.name, node.status.name) for node in itertools.islice(ticked, 2)]
    with pytest.raises(ScriptedError):
        next(ticked)
    assert seen == [("a", "FAILURE"), ("i", "SUCCESS")]


def test_children_that_come_later_are_ticked_as_well():
    stage = Stage()
    root = Sequence("s", memory=True, children=[stage.leaf("a")])
    assert stage.tick(root) == "S: a=S"
    root.add_child(stage.leaf("b"))
    assert stage.tick(root) == "S: a=S b=S"
    root.remove_child(root.children[0])
    assert stage.tick(root) == "S: b=S"


def test_a_node_ticked_by_itself_and_in_a_flat_tree_remembers_each_for_itself():
    stage = Stage()
    root = SequenceWithMemory("s", children=stage.leaves(a="S", b="R"))
    flat, times = flatten(root), ClockTimes(lambda _: ManualClock())
    ticker = flat.ticker(times)
    assert stage.ticks(root, 2) == ["R: a=S", "R: b=R"]
    before = cells_of(ticker)
    assert tick(flat, ticker) == RUNNING
    assert (stage.told(), before) == ("a=S", cells_of(flat.ticker(times)))
    assert stage.tick(root) == "R: b=R"


class Own(behaviour_class(OwnDecorator, TurningNode)):  # type: ignore[misc]
    """A subclass without a builder of its own."""

    turned = "FAILURE", "SUCCESS", "SKIPPED"


def test_a_subclass_ticks_as_its_base_does():
    stage = Stage()
    assert stage.tick(Own("o", stage.leaf("a"))) == "F: a=S"


class Unknown(Control):
    """A control that nobody has said anything of."""


def test_a_control_without_a_builder_is_refused_with_its_class():
    with pytest.raises(NotFlatError, match=r"'u' is a .*test_parents.Unknown"):
        Unknown("u", [Telling("a")]).tick_once()


def test_what_is_ticked_because_of_a_halt_is_not_shown():
    stage = Stage()
    tried = TryCatch("t", stage.leaves(b="R", catch="S"), Input(source=True))
    root = Parallel("p", [tried, stage.leaf("d", "F")])
    assert [node.name for node in root.tick()] == ["b", "t", "d", "p"]
    assert stage.told() == "b=R d=F halt b catch=S"


class Refusing(behaviour_class(OwnDecorator, SubTreeNode)):  # type: ignore[misc]
    """Ticks as it likes."""

    def tick(self) -> Iterator[Behaviour]:
        self.status = Status.FAILURE
        yield self


def test_a_child_with_a_tick_of_its_own_is_ticked_by_it():
    stage = Stage()
    assert stage.tick(Inverter("i", Refusing("r", stage.leaf("a")))) == "S:"


class InTurn(Control):
    """Ticks one child in each activation, whoever's turn it is, for half a second at most."""

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


def test_a_control_of_a_users_goes_on_from_its_cells_and_keeps_those_that_outlast_an_end():
    stage, clock = Stage(), ManualClock()
    root = InTurn("t", stage.leaves(a="R,S", b="F,K,S"), clock)
    assert stage.ticks(root, 5) == ["R: a=R", "S: a=S", "F: b=F", "S: a=S", "K: b=K"]
    assert root.feedback_message == "tick 1"


def test_a_control_of_a_users_that_fails_for_its_time_halts_its_child_and_begins_again():
    stage, clock = Stage(), ManualClock()
    root = InTurn("t", stage.leaves(a="R", b="S"), clock)
    assert stage.ticks(root, 2) == ["R: a=R", "R: a=R"]
    clock.advance(0.5)
    assert stage.ticks(root, 2) == ["F: halt a", "R: a=R"]
    root.stop(Status.INVALID)
    clock.advance(0.4)
    assert [stage.told(), *stage.ticks(root, 2)] == ["halt a", "R: a=R", "R: a=R"]


def test_a_decorator_of_a_users_passes_on_what_its_child_answers():
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
def test_a_cell_holds_nothing_that_could_change_in_it(value):
    class Listing(Decorator):
        def begin(self, tick: Tick) -> Behaviour | Status:
            tick[self.cells[0]] = value
            return super().begin(tick)

    listing = Listing("l", Telling("a"))
    listing.cell()
    with pytest.raises(TypeError, match="unhashable"):
        listing.tick_once()
