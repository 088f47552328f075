"""Limits of nesting: trees must not contain themselves, and must not be too deep or too large."""

from collections.abc import Iterable, Iterator

from sar_compiler.nodes.binding.bound import BoundNode, BoundTree
from sar_compiler.nodes.collector import FindingCollector

MAX_NODES = 300_000
"""The largest number of nodes in a tree with its subtrees expanded."""

MAX_LEVELS = 600
"""The maximum depth of a tree with its subtrees expanded, in levels; each condition and `oneshot` adds a level.

This is the depth of a file with 200 nested elements. py_trees needs a stack frame for each level, and Python allows 1,000.
"""

_LONGEST_CIRCLE = 8
"""The longest cycle that is reported in full; of a longer one only both ends are shown."""


def cut_circles(trees: Iterable[BoundTree], collector: FindingCollector) -> None:
    """Report every `SubTree` inside the tree that it refers to, and detach that tree."""
    done: set[BoundTree] = set()
    for tree in trees:
        if tree not in done:
            _follow(tree, done, collector)


def count_within_limits(main: BoundTree, collector: FindingCollector, others: int = 0) -> int | None:
    """Check that a tree with its subtrees expanded is neither too large nor too deep.

    Args:
        main: The tree.
        collector: Collects the findings.
        others: The number of nodes in other trees of the file, which is added.

    Returns:
        Its number of nodes; None if there is a finding.
    """
    sizes: dict[BoundTree, int] = {}
    bounds: dict[BoundTree, int] = {}
    trees = trees_in(main)
    for tree in trees:
        inner = [node.subtree for node in tree.subtrees() if node.subtree is not None]
        sizes[tree] = len(tree.nodes) + sum(sizes[each] for each in inner)
        bounds[tree] = tree.nesting + tree.wrappers + max((bounds[each] for each in inner), default=0)
    if sizes[main] + others > MAX_NODES:
        what = "the tree has" if sizes[main] > MAX_NODES else "the trees up to this one have"
        message = f"with subtrees expanded, {what} more than {MAX_NODES:,} nodes"
        collector.add("too-many-nodes", message, main.element)
        return None
    # The exact depth matters only if it may be too large.
    heights = _heights(trees) if bounds[main] > MAX_LEVELS else bounds
    if heights[main] > MAX_LEVELS:
        node = _first_too_deep(main, heights)
        message = f"with its subtrees expanded, the tree '{main.name}' is {heights[main]} levels deep here"
        hint = f"reduce it to {MAX_LEVELS} levels, the maximum that can be ticked and halted"
        collector.add("too-deep", message, node.element, hint=hint)
        return None
    return sizes[main]


def _heights(trees: Iterable[BoundTree]) -> dict[BoundTree, int]:
    """Return the depth of each tree in levels; inner trees come before enclosing ones."""
    heights: dict[BoundTree, int] = {}
    for tree in trees:
        heights[tree] = max((level + _below(node, heights) for node, level in _levels(tree, 0)), default=0)
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
            _cut(node, list(path), collector)
        elif node.subtree is not None and node.subtree not in done:
            path[node.subtree] = iter(list(node.subtree.subtrees()))


def _cut(node: BoundNode, path: list[BoundTree], collector: FindingCollector) -> None:
    assert node.subtree is not None  # noqa: S101 - checked by the caller
    names = [tree.name for tree in path[path.index(node.subtree) :]] + [node.subtree.name]
    if len(names) > _LONGEST_CIRCLE:
        names[_LONGEST_CIRCLE // 2 : -_LONGEST_CIRCLE // 2] = ["..."]
    message = f"the trees contain each other: {' -> '.join(names)}"
    collector.add("recursive-tree", message, node.element, value="ID")
    node.subtree = None


def trees_in(main: BoundTree) -> list[BoundTree]:
    """Return a tree and the trees that it uses, each after its subtrees."""
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
    """Yield the nodes of a tree in the order of the file, with the deepest level that each reaches."""
    waiting = [(tree.root, above)] if tree.root is not None else []
    while waiting:
        node, above = waiting.pop()
        level = above + 1 + bool(node.conditions) + (node.oneshot is not None)
        yield node, level
        waiting.extend((child, level) for child in reversed(node.children))


def _below(node: BoundNode, heights: dict[BoundTree, int]) -> int:
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
