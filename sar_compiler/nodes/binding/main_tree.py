"""Choice of the tree to execute."""

from shlex import quote

from sar_compiler.nodes.values import listed
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import Element, is_groot2_project


def find_main_tree(forest: Forest, tree_id: str | None = None) -> Element:
    """Return the tree to execute.

    Raises:
        TreeError: If there is no such tree, or the file does not name one of several.
    """
    tree = forest.main_tree(tree_id)
    if tree is not None:
        return tree
    raise TreeError([_missing(forest, tree_id)])


def _missing(forest: Forest, tree_id: str | None) -> Diagnostic:
    root = forest.main.root
    ids = list(forest.trees)
    there = f"the file has {listed(ids)}" if ids else "the file has no tree with an ID"
    named = forest.main.main_tree_name
    if tree_id is not None:
        message = f"there is no tree '{tree_id}'; {there}"
        return root.finding("missing-main-tree", message)
    if named is not None:
        message = f"main_tree_to_execute names the tree '{named}', which is not there; {there}"
        near = nearest(named, ids)
        return root.finding("missing-main-tree", message, value="main_tree_to_execute", suggestion=near)
    count = sum(1 for _ in forest.iterate())
    if not count:
        hint = 'write a <BehaviorTree ID="..."> in it'
        return root.finding("no-tree", "the file has no tree", hint=hint)
    what = "this Groot2 project" if is_groot2_project(forest.main) else "the file"
    message = f"{what} has {count} trees and does not say which one to execute: {listed(ids)}"
    first = ids[0] if ids else "..."
    hint = f'name one, --tree {quote(first)}, or write main_tree_to_execute="{first}"'
    return root.finding("no-main-tree", message, hint=hint)
