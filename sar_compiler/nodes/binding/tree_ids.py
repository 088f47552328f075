"""Valid IDs of trees, by BehaviorTree.CPP's rules, and the tree that is executed."""

import re
from shlex import quote
from typing import NamedTuple

from sar_compiler.nodes.registry import Registry, is_library_tag
from sar_compiler.nodes.values import join_words
from sar_compiler.tree.diagnostic import Cause, Diagnostic, TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import SUBTREE_TAG, Element, is_groot2_project

_REFUSED = re.compile(r"""[\s<>&"'/\\:*?|.\x00-\x1f]""")
RESERVED = ("Root", "root")
"""IDs that BehaviorTree.CPP reserves."""


def refused_in(name: str) -> str | None:
    """Return the part of a tree's or node's ID that is not allowed; None if the ID is valid."""
    found = _REFUSED.search(name)
    if found is None:
        return None
    character = found.group()
    return f"'{character}'" if character.isprintable() and character != " " else "blanks"


def is_node(tree_id: str, registry: Registry) -> bool:
    """Return whether a tree has the ID of a node that BehaviorTree.CPP knows, which it rejects."""
    return tree_id == SUBTREE_TAG or (tree_id in registry and not is_library_tag(tree_id))


class NameFault(NamedTuple):
    """An error in the ID of a tree that BehaviorTree.CPP reports since 4.8.4.

    Attributes:
        message: The error.
        hint: The remedy.
        cause: The cause that it shares with other IDs.
    """

    message: str
    hint: str
    cause: Cause


def fault_of(tree_id: str) -> NameFault | None:
    """Return the error in the ID of a tree for BehaviorTree.CPP since 4.8.4; None if it is valid."""
    refused = refused_in(tree_id)
    if refused is not None:
        message, cause = (
            f"the tree ID '{tree_id}' contains {refused}",
            f"tree IDs contain {refused}",
        )
        return NameFault(message, f"remove {refused}", Cause(cause, tree_id))
    if tree_id in RESERVED:
        message = f"a tree has the reserved ID '{tree_id}'"
        return NameFault(message, "choose another ID", Cause(message, tree_id))
    return None


class UnknownTreeError(TreeError):
    """The file has no tree of the requested name; the file itself may be correct."""


def find_main_tree(forest: Forest, tree_id: str | None = None) -> Element:
    """Return the tree to execute.

    Raises:
        UnknownTreeError: If there is no such tree.
        TreeError: If the file does not name one of several.
    """
    tree = forest.main_tree(tree_id)
    if tree is not None:
        return tree
    raise (TreeError if tree_id is None else UnknownTreeError)([_missing(forest, tree_id)])


def _missing(forest: Forest, tree_id: str | None) -> Diagnostic:
    root = forest.main.root
    ids = list(forest.trees)
    there = f"the file has {join_words(ids)}" if ids else "the file has no tree with an ID"
    named = forest.main.main_tree_name
    if tree_id is not None:
        message = f"there is no tree '{tree_id}'; {there}"
        return root.finding("missing-main-tree", message)
    if named is not None:
        message = f"main_tree_to_execute names the tree '{named}', which does not exist; {there}"
        near = nearest(named, ids)
        return root.finding("missing-main-tree", message, value="main_tree_to_execute", suggestion=near)
    count = sum(1 for _ in forest.iterate())
    if not count:
        hint = 'add a <BehaviorTree ID="...">'
        return root.finding("no-tree", "the file has no tree", hint=hint)
    what = "this Groot2 project" if is_groot2_project(forest.main) else "the file"
    message = f"{what} has {count} trees, but does not define which one to execute: {join_words(ids)}"
    first = ids[0] if ids else "..."
    hint = f'choose one by --tree {quote(first)}, or write main_tree_to_execute="{first}"'
    return root.finding("no-main-tree", message, hint=hint)
