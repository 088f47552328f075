"""Valid IDs of trees, by BehaviorTree.CPP's rules."""

import re
from typing import NamedTuple

from sar_compiler.nodes.registry import Registry, is_own_word
from sar_compiler.tree.diagnostic import Cause
from sar_compiler.tree.model import SUBTREE_TAG

_REFUSED = re.compile(r"""[\s<>&"'/\\:*?|.\x00-\x1f]""")
RESERVED = ("Root", "root")
"""IDs that BehaviorTree.CPP keeps for itself."""


def refused_in(name: str) -> str | None:
    """Describe the part of a tree's or node's ID that is not allowed; None if the ID is valid."""
    found = _REFUSED.search(name)
    if found is None:
        return None
    character = found.group()
    return f"'{character}'" if character.isprintable() and character != " " else "blanks"


def is_node(tree_id: str, registry: Registry) -> bool:
    """Return whether an ID of a tree is that of a node that BehaviorTree.CPP knows as well: then it refuses the tree."""
    return tree_id == SUBTREE_TAG or (tree_id in registry and not is_own_word(tree_id))


class NameFault(NamedTuple):
    """What BehaviorTree.CPP refuses in the ID of a tree since 4.8.4.

    Attributes:
        message: What is wrong.
        hint: The remedy.
        cause: What other IDs have in common with it.
    """

    message: str
    hint: str
    cause: Cause


def fault_of(tree_id: str) -> NameFault | None:
    """Return what BehaviorTree.CPP refuses in the ID of a tree since 4.8.4; None if it is allowed."""
    refused = refused_in(tree_id)
    if refused is not None:
        message, cause = (
            f"the ID '{tree_id}' of a tree has {refused} in it",
            f"IDs of trees have {refused} in them",
        )
        return NameFault(message, f"leave {refused} out", Cause(cause, tree_id))
    if tree_id in RESERVED:
        message = f"a tree has the ID '{tree_id}'"
        return NameFault(message, "give it another one", Cause(message, tree_id))
    return None
