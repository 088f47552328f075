"""Tests that the kernel ticks a tree exactly as py_trees does, live, at breakpoints and in flat form."""

import pytest

from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.kernel.table import STOCK
from sar_compiler.runtime.parents import EngineBehaviour
from tests.random_inputs import rounds
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


def play_beats(stage: Stage, seed: int):
    return [stage.play(beat) for beat in random_beats(seed, TICKS)]


@pytest.mark.parametrize("raises", [False, True], ids=["", "leaves that raise"])
@pytest.mark.parametrize("skips", [False, True], ids=["stock nodes", "nodes that skip"])
def test_random_trees_behave_as_in_py_trees_in_every_tick(skips, raises):
    for seed, binding in random_bindings(TREES, skips=skips):
        stages = (
            cls(binding, seed, raises=raises) for cls in (PyTreesStage, FlatStage, LiveStage, HeldStage)
        )
        for tick, (expected, *others) in enumerate(
            zip(*(play_beats(stage, seed) for stage in stages), strict=True)
        ):
            for other in others:
                assert other == expected, f"seed {seed}, tick {tick}"


def classes_of(spec):
    """Return the class of a node, and the class that replaces it if a child can be skipped."""
    replacement = spec.skipping.replacement
    return class_of(spec), class_of(replacement) if replacement else None


def known_classes():
    """Return the classes of py_trees and of this package for which the kernel has nodes."""
    ours = {
        cls
        for spec in default_registry()
        for cls in classes_of(spec)
        if cls is not None and issubclass(cls, EngineBehaviour)
    }
    return ours | set(STOCK)


def test_every_control_and_decorator_has_kernel_node():
    classes = {
        cls
        for spec in default_registry()
        if not spec.kind.is_leaf
        for cls in classes_of(spec)
        if cls is not None
    }
    assert classes - known_classes() == set()


def test_random_trees_contain_every_known_class():
    used = {
        type(node.behaviour)
        for skips in (False, True)
        for seed, binding in random_bindings(max(TREES, 250), skips=skips)
        for node in FlatStage(binding, seed).flat.nodes
    }
    assert known_classes() - used == set()
