"""Valid IDs of trees, by BehaviorTree.CPP's rules."""

import re

from sar_compiler.nodes.registry import Registry

_REFUSED = re.compile(r"""[\s<>&"'/\\:*?|.\x00-\x1f]""")
_TAKEN = "root"


def refused_in(name: str) -> str | None:
    """Describe the part of a tree's or node's ID that is not allowed; None if the ID is valid."""
    found = _REFUSED.search(name)
    if found is None:
        return None
    character = found.group()
    return f"'{character}'" if character.isprintable() and character != " " else "blanks"


def fault_of(tree_id: str, registry: Registry) -> tuple[str, str] | None:
    """Return why an ID is not allowed for a tree, and the remedy; None if it is allowed."""
    refused = refused_in(tree_id)
    if refused is not None:
        return f"the ID of a tree cannot have {refused} in it, as '{tree_id}' has", f"leave {refused} out"
    if tree_id.lower() == _TAKEN:
        return f"a tree cannot have the ID '{tree_id}'", "give it another one"
    if tree_id in registry:
        return f"'{tree_id}' is a node, and cannot be the ID of a tree as well", "give the tree another one"
    return None
