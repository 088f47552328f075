"""The limit of a tree's depth for Python's stack."""

import sys

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.parents import Parent

# How many of Python's frames halting takes for a level: a node of the project's, and a stock one. The rest is
# for the program around the tree.
_FRAMES_OF_OURS, _FRAMES_OF_STOCK = 5, 2
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


def require_tickable_depth(root: Behaviour) -> None:
    """Check that a tree can be ticked and stopped without a stack overflow.

    Raises:
        TreeTooDeepError: If it is too deep.
    """
    limit = sys.getrecursionlimit() - _FRAMES_AROUND
    depth, deepest, level = 0, 0, [(root, 0)]
    while level:
        depth += 1
        below = [(behaviour, frames + _frames(behaviour)) for behaviour, frames in level]
        deepest = max(deepest, *(frames for _, frames in below))
        level = [(child, frames) for behaviour, frames in below for child in behaviour.children]
    if deepest > limit:
        raise TreeTooDeepError(depth)


def _frames(behaviour: Behaviour) -> int:
    return _FRAMES_OF_OURS if isinstance(behaviour, Parent) else _FRAMES_OF_STOCK
