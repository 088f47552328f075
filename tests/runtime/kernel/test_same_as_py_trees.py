"""The kernel does what py_trees does with the same tree, where it is ticked for real and where states are put back."""

import pytest

from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.kernel.table import STOCK
from sar_compiler.runtime.parents import EngineBehaviour
from tests.chance import rounds
from tests.runtime.kernel.stage import (
    FlatStage,
    HeldStage,
    LiveStage,
    PyTreesStage,
    Stage,
    random_beats,
    random_bindings,
)
from tests.trees import class_of

pytestmark = pytest.mark.unmeasured

TREES = rounds(80)
TICKS = 14


def seen(stage: Stage, seed: int):
    return [stage.play(beat) for beat in random_beats(seed, TICKS)]


@pytest.mark.parametrize("raises", [False, True], ids=["", "leaves that raise"])
@pytest.mark.parametrize("skips", [False, True], ids=["stock nodes", "nodes that skip"])
def test_random_trees_show_the_same_statuses_calls_messages_and_entries_in_every_tick(skips, raises):
    for seed, binding in random_bindings(TREES, skips=skips):
        stages = (
            cls(binding, seed, raises=raises) for cls in (PyTreesStage, FlatStage, LiveStage, HeldStage)
        )
        for tick, (expected, *others) in enumerate(
            zip(*(seen(stage, seed) for stage in stages), strict=True)
        ):
            for other in others:
                assert other == expected, f"seed {seed}, tick {tick}"


def classes_of(spec):
    """Return the class of a node, and the one in its place where a child may be skipped."""
    replacement = spec.skipping.replacement
    return class_of(spec), class_of(replacement) if replacement else None


def known_classes():
    """Return the classes of py_trees and of ours that the kernel has nodes for."""
    ours = {
        cls
        for spec in default_registry()
        for cls in classes_of(spec)
        if cls is not None and issubclass(cls, EngineBehaviour)
    }
    return ours | set(STOCK)


def test_every_control_and_decorator_of_the_library_has_a_node():
    classes = {
        cls
        for spec in default_registry()
        if not spec.kind.is_leaf
        for cls in classes_of(spec)
        if cls is not None
    }
    assert classes - known_classes() == set()


def test_the_random_trees_have_every_known_class_in_them():
    used = {
        type(node.behaviour)
        for skips in (False, True)
        for seed, binding in random_bindings(max(TREES, 250), skips=skips)
        for node in FlatStage(binding, seed).flat.nodes
    }
    assert known_classes() - used == set()
