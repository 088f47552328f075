"""Traverse the nodes of a tree."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour


def pre_order(root: Behaviour) -> Iterator[Behaviour]:
    """Yield the nodes of a tree in pre-order: each node comes before its descendants."""
    waiting = [root]
    while waiting:
        behaviour = waiting.pop()
        yield behaviour
        waiting.extend(reversed(behaviour.children))
