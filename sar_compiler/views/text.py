"""A tree as text, in the notation that py_trees users know."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any
from uuid import UUID

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree


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


def with_tags(drawing: str, tree: "CompiledTree") -> str:
    """Add to the drawing of a tree what its leaves and decorators are, where their names do not say it."""
    lines, waiting = drawing.rstrip("\n").split("\n"), [tree.root]
    behaviours: list[Behaviour] = []
    while waiting:
        behaviours.append(waiting.pop())
        waiting += reversed(behaviours[-1].children)
    if len(behaviours) != len(lines):  # a constructor has given a name of several lines
        return drawing
    return "".join(f"{line}{_tag(each, tree)}\n" for line, each in zip(lines, behaviours, strict=True))


def _tag(behaviour: Behaviour, tree: "CompiledTree") -> str:
    bound = tree.origins[behaviour.id].bound
    tag = bound.spec.tag
    # A wrapper that an attribute asks for has a name of its own; a composite has its sign.
    is_other = behaviour.name != bound.name or isinstance(behaviour, Composite)
    if is_other or behaviour.name in (tag, f"{tag}?"):
        return ""
    called = bound.element.attributes["ID"] if bound.subtree is not None else behaviour.name
    return f"  <{tag}>" if called == behaviour.name else f'  <{tag} ID="{called}">'


def _drawn(draw: Callable[..., str], root: Behaviour, *, statuses: bool = False) -> str:
    visited: Mapping[UUID, Status] = {}
    if statuses:
        visited = {behaviour.id: behaviour.status for behaviour in root.iterate()}
    arguments: dict[str, Any] = {"show_status": statuses, "visited": visited, "previously_visited": {}}
    return draw(root, **arguments).rstrip("\n") + "\n"
