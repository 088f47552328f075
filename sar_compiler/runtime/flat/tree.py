"""A compiled tree in flat form: functions that call each other, and a list of cells."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.blackboard import Board, Entry
from sar_compiler.runtime.flat.cells import INVALID, STATUSES, Cells
from sar_compiler.runtime.flat.parts import Build, Child, Part
from sar_compiler.runtime.flat.table import builder_of, shares_status
from sar_compiler.runtime.flat.times import Times

Watched = Mapping[tuple[Board, str], list[int]]
"""The entries whose writes are counted, with the cells that hold a count."""

_MANY = 2
"""A count of writes that represents all larger ones. After 1 an entry may be removed, and written once more."""
_LONG_AGO = -1
"""A count of writes that does not come again."""


@dataclass(frozen=True)
class FlatNode:
    """A node of a flat tree.

    Attributes:
        index: Its number in pre-order; the cell of that number holds its status.
        behaviour: The behaviour.
        parent: The index of the node around it; None for the root.
        children: The indexes of its children.
    """

    index: int
    behaviour: Behaviour
    parent: int | None
    children: tuple[int, ...]


class FlatTree:
    """A tree that ticks without generators, and whose whole state is in cells that can be copied.

    It calls the leaves as the tree of py_trees that it is made of does, in the same order. That tree and its
    leaves are the same objects, so only one of the two forms may be ticked.

    Attributes:
        nodes: The nodes, in pre-order.
    """

    def __init__(
        self,
        nodes: tuple[FlatNode, ...],
        initial: list[Hashable],
        made: Sequence[Child],
        watched: Watched,
    ) -> None:
        self.nodes = nodes
        self._initial = initial
        self._made = made
        self._tick = made[0].tick
        # The nodes whose status is another node's, with that one's cell.
        self._shared = [(index, child.at) for index, child in enumerate(made) if index != child.at]
        self._watched = watched

    def initial(self) -> Cells:
        """Return the cells of a tree that was never ticked."""
        return list(self._initial)

    def tick(self, cells: Cells, times: Times) -> int:
        """Tick the root once; what a leaf raises is raised here.

        Args:
            cells: The state, which is changed.
            times: The timers.

        Returns:
            RUNNING, SUCCESS, FAILURE or SKIPPED, as numbers of `flat.cells`.
        """
        if not self._shared:
            return self._tick(cells, times)
        try:
            return self._tick(cells, times)
        finally:
            self._share(cells)

    def stop(self, cells: Cells, times: Times, index: int = 0) -> None:
        """Stop a node as `Behaviour.stop(Status.INVALID)` does, whatever its status is.

        Args:
            cells: The state, which is changed.
            times: The timers, for a TryCatch that tidies up.
            index: The node; by default the root.
        """
        try:
            self._made[index].stop(cells, times)
        finally:
            self._share(cells)

    def forget(self, cells: Cells, index: int = 0) -> None:
        """Forget how a node has ended, as `parts.reset` does with one that is not running.

        Args:
            cells: The state, which is changed.
            index: The node; by default the root.
        """
        cells[self._made[index].at] = INVALID
        self._share(cells)

    def show(self, cells: Cells) -> None:
        """Write the statuses back to the behaviours, for the views that look at these."""
        for node in self.nodes:
            node.behaviour.status = STATUSES[cells[node.index]]

    def renumber(self, cells: Cells) -> None:
        """Keep the counts of writes to entries small, so that equal states compare equal.

        A node that waits for news of an entry compares how often it was written. Both numbers grow for ever, and
        only whether they differ counts.

        Args:
            cells: The state, after a tick, which is changed; so are the counts on the board.
        """
        for (board, name), numbers in self._watched.items():
            now = board.stamp(name)
            stamp = min(now, _MANY)
            for number in numbers:
                seen = cells[number]
                if seen == now:
                    cells[number] = stamp
                elif seen >= _MANY:
                    cells[number] = _LONG_AGO
            board.restamp(name, stamp)

    def _share(self, cells: Cells) -> None:
        for index, cell in self._shared:
            cells[index] = cells[cell]


def flatten(root: Behaviour, builder: Callable[[Behaviour], Build] = builder_of) -> FlatTree:
    """Bring a tree into flat form.

    Args:
        root: Its root, set up.
        builder: Returns what brings a behaviour into flat form.

    Raises:
        NotFlatError: If it has a composite or a decorator whose rules are not known.
    """
    nodes = tuple(_pre_order(root))
    cells: list[Hashable] = [INVALID] * len(nodes)
    watched: dict[tuple[Board, str], list[int]] = {}

    def cell(first: Hashable) -> int:
        cells.append(first)
        return len(cells) - 1

    def watch(entry: Entry, number: int) -> None:
        entry.board.watch(entry.name)
        watched.setdefault((entry.board, entry.name), []).append(number)

    made: dict[int, Child] = {}
    # Backwards, so that children come before their parents, however deep the tree is.
    for node in reversed(nodes):
        index, behaviour = node.index, node.behaviour
        children = [made[child] for child in node.children]
        build = builder(behaviour)
        at = children[0].at if shares_status(behaviour) else index
        tick, stop = build(Part(index, at, behaviour, children, cell, watch))
        made[index] = Child(behaviour, tick, stop, at)
    return FlatTree(nodes, cells, [made[index] for index in range(len(nodes))], watched)


def _pre_order(root: Behaviour) -> Iterator[FlatNode]:
    waiting: list[tuple[Behaviour, int | None]] = [(root, None)]
    found: list[tuple[Behaviour, int | None]] = []
    inner: list[list[int]] = []
    while waiting:
        behaviour, parent = waiting.pop()
        index = len(found)
        found.append((behaviour, parent))
        inner.append([])
        if parent is not None:
            inner[parent].append(index)
        waiting.extend((child, index) for child in reversed(behaviour.children))
    for index, (behaviour, parent) in enumerate(found):
        yield FlatNode(index, behaviour, parent, tuple(inner[index]))
