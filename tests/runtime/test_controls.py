"""Tests of sequences and fallbacks."""

from collections.abc import Callable
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees import composites
from py_trees import decorators as stock
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.stock import AsyncFallback, AsyncSequence, Fallback, Sequence, SequenceWithMemory
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage


def test_sequence_ignores_skipped_child_unlike_py_trees():
    stage = Stage()
    assert stage.tick(Sequence("s", memory=True, children=stage.leaves(a="K", b="S"))) == "S: a=K b=S"
    assert stage.tick(composites.Sequence("s", memory=True, children=stage.leaves(a="K", b="S"))) == "K: a=K"


def test_fallback_of_skipped_children_is_skipped_unlike_py_trees():
    stage = Stage()
    assert stage.tick(Fallback("f", memory=True, children=stage.leaves(a="K", b="K"))) == "K: a=K b=K"
    assert (
        stage.tick(composites.Selector("f", memory=True, children=stage.leaves(a="K", b="K"))) == "F: a=K b=K"
    )


@pytest.mark.parametrize("memory", [True, False])
def test_skipped_child_does_not_affect_next_activation(memory):
    stage = Stage()
    root = Sequence("s", memory=memory, children=stage.leaves(a="K,S", b="F,K"))
    assert stage.ticks(root, 2) == ["F: a=K b=F", "S: a=S b=K"]


def test_sequence_without_memory_ticks_earlier_children_again():
    stage = Stage()
    root = Sequence("s", memory=False, children=stage.leaves(a="S,S,F", b="R"))
    assert stage.ticks(root, 3) == ["R: a=S b=R", "R: a=S b=R", "F: a=F halt b"]


def test_halted_sequence_with_memory_starts_with_first_child():
    stage = Stage()
    root = Sequence("s", memory=True, children=stage.leaves(a="S", b="R"))
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt b"
    assert stage.tick(root) == "R: a=S b=R"


@pytest.mark.parametrize("memory", [True, False])
def test_failed_child_is_reported_until_next_start(memory):
    stage = Stage()
    root = Sequence("s", memory=memory, children=stage.leaves(a="S", b="F,S"))
    stage.tick(root)
    assert root.feedback_message == "b failed"
    stage.tick(root)
    assert root.feedback_message == ""


@pytest.mark.parametrize(("cls", "ends"), [(AsyncSequence, "S"), (AsyncFallback, "F")])
def test_async_control_pauses_after_each_child_but_last(cls, ends):
    stage = Stage()
    root = stage.ready(cls("s", stage.leaves(a=ends, b=ends, c=ends)))
    assert stage.ticks(root, 3) == [f"R: a={ends}", f"R: b={ends}", f"{ends}: c={ends}"]
    assert stage.woken == 2


def test_async_control_does_not_pause_after_child_that_was_running():
    stage = Stage()
    root = stage.ready(AsyncSequence("s", stage.leaves(a="R,S", b="S")))
    assert stage.ticks(root, 2) == ["R: a=R", "S: a=S b=S"]
    assert stage.woken == 0


def test_async_control_does_not_pause_after_skipped_child():
    stage = Stage()
    root = stage.ready(AsyncSequence("s", stage.leaves(a="K", b="S")))
    assert stage.tick(root) == "S: a=K b=S"


def test_async_control_can_be_ticked_without_wake_callback():
    stage = Stage()
    root = AsyncSequence("s", stage.leaves(a="S", b="S"))
    root.setup()
    assert stage.ticks(root, 2) == ["R: a=S", "S: b=S"]


def test_sequence_with_memory_continues_with_failed_child():
    stage = Stage()
    root = SequenceWithMemory("s", stage.leaves(a="R,S", b="R,F,R,S", c="S"))
    assert stage.ticks(root, 5) == ["R: a=R", "R: a=S b=R", "F: b=F", "R: b=R", "S: b=S c=S"]
    assert stage.tick(root) == "R: a=S"


def test_sequence_with_memory_continues_with_halted_child():
    stage = Stage()
    root = SequenceWithMemory("s", stage.leaves(a="R,S", b="R"))
    stage.ticks(root, 2)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt b"
    assert stage.tick(root) == "R: b=R"


@dataclass(frozen=True)
class Shape:
    """A tree that can be build from py_trees' classes or from this package's."""

    kind: str
    children: tuple["Shape", ...] = ()
    outcomes: str = ""

    def build(self, stage: Stage, forms: dict[str, Callable[..., Behaviour]]) -> Behaviour:
        counter = iter(range(1000))

        def make(shape: "Shape") -> Behaviour:
            if shape.kind == "leaf":
                return stage.leaf(f"leaf{next(counter)}", shape.outcomes)
            children = [make(child) for child in shape.children]
            return forms[shape.kind](shape.kind, children)

        return make(self)


STOCK: dict[str, Callable[..., Behaviour]] = {
    "Sequence": lambda name, children: composites.Sequence(name, memory=True, children=children),
    "ReactiveSequence": lambda name, children: composites.Sequence(name, memory=False, children=children),
    "Fallback": lambda name, children: composites.Selector(name, memory=True, children=children),
    "ReactiveFallback": lambda name, children: composites.Selector(name, memory=False, children=children),
    "Inverter": lambda name, children: stock.Inverter(name, children[0]),
    "ForceSuccess": lambda name, children: stock.FailureIsSuccess(name, children[0]),
    "ForceFailure": lambda name, children: stock.SuccessIsFailure(name, children[0]),
    "KeepRunningUntilFailure": lambda name, children: stock.SuccessIsRunning(name, children[0]),
    "SubTree": lambda name, children: stock.PassThrough(name, children[0]),
}
OURS: dict[str, Callable[..., Behaviour]] = {
    "Sequence": lambda name, children: Sequence(name, memory=True, children=children),
    "ReactiveSequence": lambda name, children: Sequence(name, memory=False, children=children),
    "Fallback": lambda name, children: Fallback(name, memory=True, children=children),
    "ReactiveFallback": lambda name, children: Fallback(name, memory=False, children=children),
    "Inverter": lambda name, children: own("Inverter")(name, children[0]),
    "ForceSuccess": lambda name, children: own("ForceSuccess")(name, children[0]),
    "ForceFailure": lambda name, children: own("ForceFailure")(name, children[0]),
    "KeepRunningUntilFailure": lambda name, children: own("KeepRunningUntilFailure")(name, children[0]),
    "SubTree": lambda name, children: own("SubTree")(name, children[0]),
}
CONTROLS = ["Sequence", "ReactiveSequence", "Fallback", "ReactiveFallback"]
DECORATORS = ["Inverter", "ForceSuccess", "ForceFailure", "KeepRunningUntilFailure", "SubTree"]

leaves = st.lists(st.sampled_from("SFR"), min_size=1, max_size=6).map(
    lambda answers: Shape("leaf", outcomes=",".join(answers))
)
shapes = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(Shape, st.sampled_from(CONTROLS), st.lists(inner, min_size=1, max_size=4).map(tuple)),
        st.builds(Shape, st.sampled_from(DECORATORS), st.tuples(inner)),
    ),
    max_leaves=12,
)


@given(shape=shapes, halted=st.sets(st.integers(0, 7), max_size=2))
def test_own_and_py_trees_nodes_tick_identically_without_skips(shape, halted):
    histories = []
    for forms in (STOCK, OURS):
        stage = Stage()
        root = shape.build(stage, forms)
        history = []
        for tick in range(8):
            if tick in halted:
                root.stop(Status.INVALID)
            history.append(stage.tick(root))
        histories.append(history)
    assert histories[0] == histories[1]


@given(shape=shapes, mixed=st.lists(st.booleans(), min_size=40, max_size=40))
def test_own_and_py_trees_nodes_can_be_mixed(shape, mixed):
    choices = iter(mixed * 10)
    either = {
        kind: lambda name, children, kind=kind: (STOCK if next(choices) else OURS)[kind](name, children)
        for kind in STOCK
    }
    histories = []
    for forms in (STOCK, either):
        stage = Stage()
        root = shape.build(stage, forms)
        histories.append(stage.ticks(root, 8))
    assert histories[0] == histories[1]
