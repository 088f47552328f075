"""Traversal of a tree's nodes."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour


def pre_order(root: Behaviour) -> Iterator[Behaviour]:
    """Yield the nodes of a tree, each before its descendants."""
    waiting = [root]
    while waiting:
        behaviour = waiting.pop()
        yield behaviour
        waiting.extend(reversed(behaviour.children))
