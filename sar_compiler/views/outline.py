"""A compiled tree as plain data: what `show --format json` prints and golden tests compare."""

from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.compiler import CompiledTree
from sar_compiler.views.plain import plain

# These are keys of their own in the outline, where readers expect them.
_OWN_KEYS = ("memory", "policy")


def outline(tree: CompiledTree) -> dict[str, Any]:
    """Return a compiled tree as nested dictionaries of JSON values.

    Each node has its `class`, `name`, `attributes` (values and references as resolved), `children`, and
    its `file` and `line`; `memory` and `policy` only if its class has them.
    """
    return _outline(tree, tree.root)


def _outline(tree: CompiledTree, behaviour: Behaviour) -> dict[str, Any]:
    origin = tree.origins[behaviour.id]
    element = origin.bound.element
    cls = type(behaviour)
    node: dict[str, Any] = {"class": f"{cls.__module__}.{cls.__qualname__}", "name": behaviour.name}
    node.update({key: plain(origin.attributes[key]) for key in _OWN_KEYS if key in origin.attributes})
    node["attributes"] = {
        key: plain(value) for key, value in origin.attributes.items() if key not in _OWN_KEYS
    }
    node["children"] = [_outline(tree, child) for child in behaviour.children]
    node["file"] = element.source.path
    node["line"] = element.line
    return node
