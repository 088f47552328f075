"""Leaves of BehaviorTree.CPP that treat their conditions and scripts unlike other leaves.

The model of a leaf does not say from which class of BehaviorTree.CPP it derives, and neither does the log of a run. So a recorded run is compared
with the tree under each assumption until one fits.
"""

from collections.abc import Iterator, Mapping
from enum import Enum

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.nodes.registry import language_variants
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.runtime.walking import pre_order


class LeafClass(Enum):
    """A class of leaves."""

    THREADED = "a ThreadedAction, which ignores its conditions and scripts"
    COROUTINE = "a CoroActionNode, which evaluates _while only at its start"


LeafClasses = Mapping[str, LeafClass]
"""The assumed classes of leaves, by their tags."""


def possible_classes(simulated: SimulatedTree) -> Iterator[LeafClasses]:
    """Yield the assumptions about the leaves with conditions or scripts: each alone, and then all together."""
    repeating: dict[str, bool] = {}
    for each in pre_order(simulated.root):
        leaf = each.decorated if isinstance(each, Conditions) else None
        if isinstance(each, Conditions) and isinstance(leaf, StubLeaf) and not language_variants(leaf.tag):
            repeating[leaf.tag] = repeating.get(leaf.tag, False) or each.has_while
    tags = sorted(repeating)
    yield from ({tag: LeafClass.THREADED} for tag in tags)
    yield from ({tag: LeafClass.COROUTINE} for tag in tags if repeating[tag])
    if len(tags) > 1:
        yield dict.fromkeys(tags, LeafClass.THREADED)


def adopt_cpp_scripts(simulated: SimulatedTree, classes: LeafClasses) -> None:
    """Let the nodes of a tree run their scripts as BehaviorTree.CPP does.

    Args:
        simulated: The tree, before its first tick.
        classes: The assumed classes of its leaves.
    """
    for each in pre_order(simulated.root):
        if isinstance(each, Conditions):
            each.omit_post_after_halts()
            leaf = each.decorated
            assumed = classes.get(leaf.tag) if isinstance(leaf, StubLeaf) else None
            if assumed is LeafClass.THREADED:
                each.ignore()
            elif assumed is LeafClass.COROUTINE:
                each.evaluate_while_at_start()


def describe_classes(classes: LeafClasses) -> tuple[str, ...]:
    """Describe assumptions, a sentence for each leaf."""
    return tuple(f"{tag} is {each.value}" for tag, each in classes.items())
