"""A tree as text, in the notation that py_trees users know."""

from collections.abc import Callable, Mapping
from typing import Any
from uuid import UUID

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.common import Status


def unicode_tree(root: Behaviour, *, statuses: bool = False) -> str:
    """Draw a tree.

    Args:
        root: Its root.
        statuses: Whether to show each node's current status and feedback message.
    """
    return _drawn(py_trees.display.unicode_tree, root, statuses=statuses)


def ascii_tree(root: Behaviour) -> str:
    """Draw a tree with ASCII characters only; see `unicode_tree`."""
    return _drawn(py_trees.display.ascii_tree, root)


def _drawn(draw: Callable[..., str], root: Behaviour, *, statuses: bool = False) -> str:
    visited: Mapping[UUID, Status] = {}
    if statuses:
        visited = {behaviour.id: behaviour.status for behaviour in root.iterate()}
    arguments: dict[str, Any] = {"show_status": statuses, "visited": visited, "previously_visited": {}}
    return draw(root, **arguments).rstrip("\n") + "\n"
