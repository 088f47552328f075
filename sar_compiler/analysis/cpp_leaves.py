"""Leaves of BehaviorTree.CPP that handle conditions and scripts differently from other leaves.

Neither the model of a leaf nor the log of a run contains the BehaviorTree.CPP class from which the leaf derives. So a
recorded run is compared with the tree under each possible assumption, until the run is possible.
"""

from collections.abc import Iterator, Mapping
from enum import Enum

from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.nodes.registry import language_variants
from sar_compiler.runtime.language_nodes import Conditions
from sar_compiler.runtime.walking import pre_order


class LeafClass(Enum):
    """The BehaviorTree.CPP class from which a leaf is assumed to derive."""

    THREADED = "a ThreadedAction, which ignores its conditions and scripts"
    COROUTINE = "a CoroActionNode, which evaluates _while only at its start"


LeafClasses = Mapping[str, LeafClass]
"""The assumed leaf classes, by tag. Leaves with other tags run their scripts in the usual way."""


def possible_classes(simulated: SimulatedTree) -> Iterator[LeafClasses]:
    """Yield assumptions about the classes of leaves with scripts: one tag is special, or all tags are `THREADED`."""
    has_while: dict[str, bool] = {}
    for each in pre_order(simulated.root):
        leaf = each.decorated if isinstance(each, Conditions) else None
        if isinstance(each, Conditions) and isinstance(leaf, StubLeaf) and not language_variants(leaf.tag):
            has_while[leaf.tag] = has_while.get(leaf.tag, False) or each.has_while
    tags = sorted(has_while)
    yield from ({tag: LeafClass.THREADED} for tag in tags)
    yield from ({tag: LeafClass.COROUTINE} for tag in tags if has_while[tag])
    if len(tags) > 1:
        yield dict.fromkeys(tags, LeafClass.THREADED)


def adopt_cpp_scripts(simulated: SimulatedTree, classes: LeafClasses) -> None:
    """Make the nodes of a tree run their scripts as in BehaviorTree.CPP.

    Args:
        simulated: The tree, before its first tick.
        classes: The assumed leaf classes.
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
    """Return a sentence for each leaf with an assumed class."""
    return tuple(f"{tag} is {each.value}" for tag, each in classes.items())
