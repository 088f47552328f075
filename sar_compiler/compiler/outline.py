"""Converts a tree to text or plain data.

`show --format json` prints this data, and golden tests compare it.
"""

from collections.abc import Callable
from typing import Any

import py_trees
from py_trees.behaviour import Behaviour

from sar_compiler.compiler.sketch import Drawable, class_of, is_unknown
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.display_text import visible
from sar_compiler.tree.plain import as_json, to_json_value

# Attributes of composites that are keys of a node in the outline, beside `attributes`.
_OWN_KEYS = ("memory", "policy")


def outline(tree: Drawable) -> dict[str, Any]:
    """Return a tree as nested dictionaries of JSON values.

    Each node has its `class`, `name`, `attributes` (values and references as resolved), `children`, and
    its `file` and `line`; `memory` and `policy` only if its class has them. The class of an unknown node is None.
    """
    return _outline(tree, tree.root)


def _outline(tree: Drawable, behaviour: Behaviour) -> dict[str, Any]:
    origin = tree.origins[behaviour.id]
    element = origin.bound.element
    node: dict[str, Any] = {"class": class_of(behaviour), "name": behaviour.name}
    node.update({key: to_json_value(origin.attributes[key]) for key in _OWN_KEYS if key in origin.attributes})
    node["attributes"] = {
        key: to_json_value(value) for key, value in origin.attributes.items() if key not in _OWN_KEYS
    }
    node["children"] = [_outline(tree, child) for child in behaviour.children]
    node["file"] = element.source.path
    node["line"] = element.line
    return node


# The drawings use the notation of py_trees.


def unicode_tree(root: Behaviour) -> str:
    """Draw a tree with Unicode characters, as py_trees does."""
    return _draw(py_trees.display.unicode_tree, root)


def ascii_tree(root: Behaviour) -> str:
    """Draw a tree like `unicode_tree`, but only with ASCII characters."""
    return _draw(py_trees.display.ascii_tree, root)


def outline_text(tree: Drawable, form: str) -> str:
    """Return a tree as text in one of the formats of `show`: `json`, `ascii` or `unicode`."""
    if form == "json":
        return f"{as_json(outline(tree))}\n"
    return visible(add_tags((ascii_tree if form == "ascii" else unicode_tree)(tree.root), tree))


def add_tags(drawing: str, tree: Drawable) -> str:
    """Add the tags of leaves and decorators to the drawing of a tree, where the name differs from the tag."""
    lines, behaviours = drawing.rstrip("\n").split("\n"), list(pre_order(tree.root))
    if len(behaviours) != len(lines):  # a constructor has set a name of several lines
        return drawing
    return "".join(f"{line}{_tag(each, tree)}\n" for line, each in zip(lines, behaviours, strict=True))


def _tag(behaviour: Behaviour, tree: Drawable) -> str:
    bound = tree.origins[behaviour.id].bound
    tag = bound.spec.tag
    # No tag is added to wrappers, whose names differ from the element's, and to composites, whose symbols show the kind.
    sign = " ?" if is_unknown(bound) else ""
    is_other = behaviour.name != bound.name or bound.spec.kind is Kind.CONTROL
    if is_other or behaviour.name in (tag, f"{tag}?"):
        return f" {sign}" if sign else ""
    called = bound.element.attributes["ID"] if bound.subtree is not None else behaviour.name
    return f"  <{tag}>{sign}" if called == behaviour.name else f'  <{tag} ID="{called}">{sign}'


def _draw(draw: Callable[[Behaviour], str], root: Behaviour) -> str:
    return draw(root).rstrip("\n") + "\n"
