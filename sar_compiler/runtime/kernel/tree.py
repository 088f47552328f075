"""Trees in flat form: a list of nodes, and cells that store the state of the nodes."""

from collections.abc import Callable
from typing import Any, Final

from librt.vecs import vec
from mypy_extensions import i32

from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.tree_nodes import CellLayout, NodeBuilder, Ticker, TreeNode

_MANY: Final = 2
"""The maximum stored number of writes, which replaces all larger numbers. It must not be 1, because an entry that was
removed and written again has been written once."""
_LONG_AGO: Final = -1
"""This number replaces outdated numbers of writes. It differs from the current number of every entry."""


class FlatTree:
    """A tree whose complete state is stored in cells. The cells can be copied.

    The flat tree is made from a tree of py_trees. It uses the same behaviours, and calls the leaves in the same order.

    Attributes:
        nodes: The nodes, in pre-order.
    """

    def __init__(self, nodes: list[TreeNode], layout: CellLayout) -> None:
        self.nodes = nodes
        self._layout = layout
        # The nodes that share the status cell of another node.
        self._shared: list[TreeNode] = [node for node in nodes if node.index != node.status_cell]
        watched: dict[tuple[Any, str], list[int]] = {}
        for entry, cell in layout.watched:
            entry.board.watch_entry(entry.name)
            watched.setdefault((entry.board, entry.name), []).append(cell)
        self._watched = watched

    def ticker(self, times: Times) -> Ticker:
        """Create a ticker with the initial state of the tree."""
        return Ticker(vec[i32](self._layout.cells), list(self._layout.values), times)

    def renumber(self, ticker: Ticker) -> None:
        """Replace the stored numbers of writes by small numbers, so that equivalent states become equal.

        A node that waits for a write compares the entry's number of writes with a stored number. Both grow without
        limit, but only their equality matters.

        Args:
            ticker: The ticker of the tree, after a tick. Its cells and the numbers on the board are changed.
        """
        cells = ticker.cells
        for (board, name), numbers in self._watched.items():
            now: int = board.stamp(name)
            stamp = min(now, _MANY)
            for number in numbers:
                seen = cells[number]
                if seen == now:
                    cells[number] = stamp
                elif seen >= _MANY:
                    cells[number] = _LONG_AGO
            board.restamp(name, stamp)

    def copy_shared_statuses(self, ticker: Ticker) -> None:
        """For each node that shares the status cell of another node, copy the status to its own cell."""
        cells = ticker.cells
        for node in self._shared:
            cells[node.index] = cells[node.status_cell]


def children_of(behaviour: Any) -> list[Any]:
    """Return the children of a behaviour."""
    children: list[Any] = behaviour.children
    return children


def flat_tree(
    root: Any, node_of: Callable[[NodeBuilder], TreeNode], below: Callable[[Any], list[Any]] = children_of
) -> FlatTree:
    """Convert a tree of behaviours to a `FlatTree`.

    Args:
        root: The root of the tree, after its setup.
        node_of: Function that creates the node of a behaviour.
        below: Function that returns the children of a behaviour, if the kernel ticks them.
    """
    behaviours: list[Any] = []
    parents: list[int] = []
    waiting: list[tuple[Any, int]] = [(root, -1)]
    while waiting:
        behaviour, parent = waiting.pop()
        parents.append(parent)
        inside: list[Any] = below(behaviour)
        waiting.extend([(inside[place], len(behaviours)) for place in range(len(inside) - 1, -1, -1)])
        behaviours.append(behaviour)
    layout = CellLayout(len(behaviours))
    children: list[list[TreeNode]] = [[] for _ in behaviours]
    nodes: list[TreeNode] = []
    # Nodes are created backwards, so that children precede their parents without recursion.
    for index in range(len(behaviours) - 1, -1, -1):
        behaviour, inner = behaviours[index], children[index]
        inner.reverse()
        at = inner[0].status_cell if inner and getattr(behaviour, "is_its_child", False) else index
        cells, values = len(layout.cells), len(layout.values)
        node = node_of(NodeBuilder(index, at, behaviour, inner, layout))
        node.first_cell, node.last_cell = cells, len(layout.cells)
        node.first_value, node.last_value = values, len(layout.values)
        nodes.append(node)
        if parents[index] >= 0:
            children[parents[index]].append(node)
    nodes.reverse()
    return FlatTree(nodes, layout)
