"""Selection of trees by ID, and limits of nesting: recursion, depth and size."""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.registry import Registry, is_library_tag
from sar_compiler.nodes.values import join_with_commas
from sar_compiler.tree.diagnostic import Cause, Diagnostic, TreeError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import SUBTREE_TAG, Element, is_groot2_project

MAX_NODES = 300_000
"""The maximum number of nodes in a tree with its subtrees expanded."""

MAX_LEVELS = 600
"""The maximum depth, in levels, of a tree with its subtrees expanded.

Each condition and each `oneshot` adds a level. A file with 200 nested elements has this depth. Python allows
1,000 stack frames, and py_trees needs one for each level.
"""

_LONGEST_CIRCLE = 8
"""The maximum number of trees of a cycle that a message shows. The middle of a longer cycle is left out."""


def cut_cycles(trees: Iterable[BoundTree], collector: FindingCollector) -> None:
    """Report every `SubTree` that refers to an enclosing tree, and remove the reference."""
    done: set[BoundTree] = set()
    for tree in trees:
        if tree not in done:
            _follow(tree, done, collector)


def check_size_limits(main: BoundTree, collector: FindingCollector, others: int = 0) -> int | None:
    """Check that a tree with its subtrees expanded is neither too large nor too deep.

    Args:
        main: The tree.
        collector: The collector of findings.
        others: The number of nodes in other trees of the file, which is added to the size.

    Returns:
        The number of nodes in the tree; None if there is a finding.
    """
    sizes: dict[BoundTree, int] = {}
    bounds: dict[BoundTree, int] = {}
    trees = trees_in(main)
    for tree in trees:
        inner = [node.subtree for node in tree.subtrees() if node.subtree is not None]
        sizes[tree] = len(tree.nodes) + sum(sizes[each] for each in inner)
        bounds[tree] = tree.nesting + tree.wrappers + max((bounds[each] for each in inner), default=0)
    if sizes[main] + others > MAX_NODES:
        what = "the tree has" if sizes[main] > MAX_NODES else "this tree and the trees before it have"
        message = f"with subtrees expanded, {what} more than {MAX_NODES:,} nodes"
        collector.add("too-many-nodes", message, main.element)
        return None
    # The exact depth matters only if it may be too large.
    heights = _heights(trees) if bounds[main] > MAX_LEVELS else bounds
    if heights[main] > MAX_LEVELS:
        node = _first_too_deep(main, heights)
        message = (
            f"with subtrees expanded, the tree '{main.name}' is {heights[main]} levels deep at this node"
        )
        hint = f"reduce the depth to {MAX_LEVELS} levels; deeper trees cannot be ticked and halted"
        collector.add("too-deep", message, node.element, hint=hint)
        return None
    return sizes[main]


def _heights(trees: Iterable[BoundTree]) -> dict[BoundTree, int]:
    """Return the depth of each tree in levels. Inner trees must precede the trees that use them."""
    heights: dict[BoundTree, int] = {}
    for tree in trees:
        heights[tree] = max((level + _depth(node, heights) for node, level in _levels(tree, 0)), default=0)
    return heights


def _follow(start: BoundTree, done: set[BoundTree], collector: FindingCollector) -> None:
    path: dict[BoundTree, Iterator[BoundNode]] = {start: iter(list(start.subtrees()))}
    while path:
        tree = next(reversed(path))
        node = next(path[tree], None)
        if node is None:
            done.add(tree)
            del path[tree]
        elif node.subtree in path:
            _detach(node, list(path), collector)
        elif node.subtree is not None and node.subtree not in done:
            path[node.subtree] = iter(list(node.subtree.subtrees()))


def _detach(node: BoundNode, path: list[BoundTree], collector: FindingCollector) -> None:
    assert node.subtree is not None  # noqa: S101 - checked by the caller
    names = [tree.name for tree in path[path.index(node.subtree) :]] + [node.subtree.name]
    if len(names) > _LONGEST_CIRCLE:
        names[_LONGEST_CIRCLE // 2 : -_LONGEST_CIRCLE // 2] = ["..."]
    message = f"these trees contain each other: {' -> '.join(names)}"
    collector.add("recursive-tree", message, node.element, value="ID")
    node.subtree = None


def trees_in(main: BoundTree) -> list[BoundTree]:
    """Return a tree and the trees that it uses, each tree after its own subtrees."""
    order: dict[BoundTree, None] = {}
    waiting = [main]
    while waiting:
        tree = waiting[-1]
        inner = {} if tree in order else {each.subtree: None for each in tree.subtrees() if each.subtree}
        missing = [each for each in inner if each not in order]
        if not missing:
            order[waiting.pop()] = None
        waiting.extend(missing)
    return list(order)


def _levels(tree: BoundTree, above: int) -> Iterator[tuple[BoundNode, int]]:
    """Yield the nodes of a tree in file order, each with its level."""
    waiting = [(tree.root, above)] if tree.root is not None else []
    while waiting:
        node, above = waiting.pop()
        level = above + 1 + bool(node.conditions) + (node.oneshot is not None)
        yield node, level
        waiting.extend((child, level) for child in reversed(node.children))


def _depth(node: BoundNode, heights: dict[BoundTree, int]) -> int:
    return heights[node.subtree] if node.subtree is not None else 0


def _first_too_deep(main: BoundTree, heights: dict[BoundTree, int]) -> BoundNode:
    tree, above = main, 0
    while True:
        for node, level in _levels(tree, above):
            if level > MAX_LEVELS:
                return node
            if node.subtree is not None and level + heights[node.subtree] > MAX_LEVELS:
                tree, above = node.subtree, level
                break


_REFUSED = r"""[\s<>&"'/\\:*?|.\x00-\x1f]"""
RESERVED = ("Root", "root")
"""The tree IDs that BehaviorTree.CPP reserves."""


def invalid_id_part(name: str) -> str | None:
    """Describe the invalid character in the ID of a tree or a node; return None if the ID is valid."""
    found = re.search(_REFUSED, name)
    if found is None:
        return None
    character = found.group()
    return f"'{character}'" if character.isprintable() and character != " " else "spaces"


def is_btcpp_node_id(tree_id: str, registry: Registry) -> bool:
    """Return whether BehaviorTree.CPP rejects a tree ID because a node has this ID, too."""
    return tree_id == SUBTREE_TAG or (tree_id in registry and not is_library_tag(tree_id))


class TreeIdFault(NamedTuple):
    """An error in a tree ID that BehaviorTree.CPP reports since 4.8.4.

    Attributes:
        message: The description of the error.
        hint: The remedy.
        cause: The common cause of the errors in several IDs.
    """

    message: str
    hint: str
    cause: Cause


def tree_id_fault(tree_id: str) -> TreeIdFault | None:
    """Return the error that BehaviorTree.CPP reports for a tree ID since 4.8.4; None if the ID is valid."""
    refused = invalid_id_part(tree_id)
    if refused is not None:
        message, cause = (
            f"the tree ID '{tree_id}' contains {refused}",
            f"tree IDs contain {refused}",
        )
        return TreeIdFault(message, f"remove {refused}", Cause(cause, tree_id))
    if tree_id in RESERVED:
        message = f"a tree has the reserved ID '{tree_id}'"
        return TreeIdFault(message, "choose another ID", Cause(message, tree_id))
    return None


class UnknownTreeError(TreeError):
    """A requested tree is not in the file. The file itself may be correct."""


def find_main_tree(forest: Forest, tree_id: str | None = None) -> Element:
    """Return the tree to execute.

    Raises:
        UnknownTreeError: If there is no such tree.
        TreeError: If the file has several trees and does not name the main tree.
    """
    tree = forest.main_tree(tree_id)
    if tree is not None:
        return tree
    raise (TreeError if tree_id is None else UnknownTreeError)([_missing_tree(forest, tree_id)])


def _missing_tree(forest: Forest, tree_id: str | None) -> Diagnostic:
    root = forest.main.root
    ids = list(forest.trees)
    known = f" (known: {join_with_commas(ids)})" if ids else ", because the file has no tree with an ID"
    named = forest.main.main_tree_name
    if tree_id is not None:
        message = f"there is no tree '{tree_id}'{known}"
        return root.finding("missing-main-tree", message)
    if named is not None:
        message = f"main_tree_to_execute: there is no tree '{named}'{known}"
        near = nearest(named, ids)
        return root.finding("missing-main-tree", message, value="main_tree_to_execute", suggestion=near)
    count = sum(1 for _ in forest.iterate())
    if not count:
        hint = 'add a <BehaviorTree ID="...">'
        return root.finding("no-tree", "the file has no tree", hint=hint)
    what = "this Groot2 project" if is_groot2_project(forest.main) else "the file"
    message = f"{what} has {count} trees ({join_with_commas(ids)}), but does not say which is the main tree"
    first = ids[0] if ids else "..."
    from shlex import quote

    hint = f'select the main tree with --tree {quote(first)}, or write main_tree_to_execute="{first}"'
    return root.finding("no-main-tree", message, hint=hint)
