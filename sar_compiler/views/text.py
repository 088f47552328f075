"""A tree as text, in the notation that py_trees users know."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.composites import Composite

from sar_compiler.runtime.walking import pre_order

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree


def unicode_tree(root: Behaviour) -> str:
    """Draw a tree."""
    return _drawn(py_trees.display.unicode_tree, root)


def ascii_tree(root: Behaviour) -> str:
    """Draw a tree with ASCII characters only; see `unicode_tree`."""
    return _drawn(py_trees.display.ascii_tree, root)


def with_tags(drawing: str, tree: "CompiledTree") -> str:
    """Add to the drawing of a tree what its leaves and decorators are, where their names do not say it."""
    lines, behaviours = drawing.rstrip("\n").split("\n"), list(pre_order(tree.root))
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


def _drawn(draw: Callable[[Behaviour], str], root: Behaviour) -> str:
    return draw(root).rstrip("\n") + "\n"
