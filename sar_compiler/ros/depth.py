"""The limit of a tree's depth for Python's stack."""

import sys

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError

# Python has a thousand frames; these are for the program around the tree.
_FRAMES_AROUND = 200


class TreeTooDeepError(SarError):
    """A tree is nested too deeply for Python's stack.

    Attributes:
        depth: Its number of levels.
    """

    def __init__(self, depth: int) -> None:
        self.depth = depth
        super().__init__(
            f"the tree is nested {depth} levels deep, which is more than can be ticked and stopped"
        )


def require_tickable_depth(root: Behaviour, frames_per_level: int = 1) -> None:
    """Check that py_trees can go through a tree without a stack overflow.

    Args:
        root: The root.
        frames_per_level: How many of Python's frames it needs for a level: `iterate` one, its own ticks two.

    Raises:
        TreeTooDeepError: If it is too deep.
    """
    depth, level = 0, [root]
    while level:
        depth += 1
        level = [child for behaviour in level for child in behaviour.children]
    if depth * frames_per_level > sys.getrecursionlimit() - _FRAMES_AROUND:
        raise TreeTooDeepError(depth)
