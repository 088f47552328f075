"""How deep a tree may be for Python to tick and to stop it."""

import sys

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError

# Stopping takes two frames a level; the rest is for the program around the tree.
_FRAMES_PER_LEVEL = 2
_FRAMES_AROUND = 200


class TreeTooDeepError(SarError):
    """A tree is nested more deeply than Python can follow.

    Attributes:
        depth: Its number of levels.
        limit: How many there may be.
    """

    def __init__(self, depth: int, limit: int) -> None:
        self.depth = depth
        self.limit = limit
        super().__init__(f"the tree is nested {depth} levels deep; at most {limit} can be ticked")


def require_tickable_depth(root: Behaviour) -> None:
    """See that a tree can be ticked and stopped without running out of stack.

    Raises:
        TreeTooDeepError: If it cannot.
    """
    limit = (sys.getrecursionlimit() - _FRAMES_AROUND) // _FRAMES_PER_LEVEL
    depth, level = 0, [root]
    while level:
        depth += 1
        level = [child for behaviour in level for child in behaviour.children]
    if depth > limit:
        raise TreeTooDeepError(depth, limit)
