"""A node of ours in flat form by itself, for whoever ticks it by its own methods, as py_trees does.

Its builder is the same as in a flat tree. Its cells are its own: the first ones are the statuses of the behaviours
themselves, so that whoever sets one of these changes the cell, and the other way round.
"""

from collections import deque
from collections.abc import Hashable
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.flat.cells import SKIPPED, STATUSES, Cells, Tick, number_of
from sar_compiler.runtime.flat.parts import Child, Part
from sar_compiler.runtime.flat.table import inherited_builder_of
from sar_compiler.runtime.flat.times import ClockTimes, Times
from sar_compiler.runtime.parents import Built
from sar_compiler.runtime.skipping import was_skipped


class Visit(NamedTuple):
    """A node that was ticked, as it was at the end of its tick."""

    node: Behaviour
    status: Status
    message: str


Visits = list[Visit] | deque[Visit]
_UNSEEN: deque[Visit] = deque(maxlen=0)
"""Where the visits of a tick go that nobody is shown."""


class SingleNode:
    """A node in flat form by itself; its children are any behaviours, ticked by their own methods.

    Args:
        node: The node.
    """

    def __init__(self, node: Built) -> None:
        self._node = node
        self._children = list(node.children)
        self._cells = _LiveCells([node, *node.children])
        self._times = ClockTimes(node.clock)
        self._visits: Visits = _UNSEEN
        children = [self._child(child, at) for at, child in enumerate(self._children, 1)]
        part = Part(0, 0, node, children, self._cells.add, lambda _entry, _cell: None)
        self._tick, self._stop = inherited_builder_of(node)(part)

    def is_of(self, children: list[Behaviour]) -> bool:
        """Return whether the node still has the children that it had."""
        return self._children == children

    def tick(self, visits: Visits) -> int:
        """Tick the node once.

        Args:
            visits: Where the nodes below it go that are ticked, in order.

        Returns:
            RUNNING, SUCCESS, FAILURE or SKIPPED, as numbers of `flat.cells`.
        """
        self._node.skipped = False
        self._visits = visits
        try:
            outcome = self._tick(self._cells, self._times)
        finally:
            self._visits = _UNSEEN
        self._node.skipped = outcome == SKIPPED
        return outcome

    def halt(self) -> None:
        """Halt the node."""
        self._stop(self._cells, self._times)

    def _child(self, child: Behaviour, at: int) -> Child:
        def stop(cells: Cells, times: Times) -> None:  # noqa: ARG001
            child.stop(Status.INVALID)

        if isinstance(child, Built) and type(child).tick is Built.tick:
            return Child(child, self._ticks_built(child), stop, at)
        return Child(child, self._ticks(child), stop, at)

    def _ticks(self, child: Behaviour) -> Tick:
        def tick(cells: Cells, times: Times) -> int:  # noqa: ARG001
            for node in child.tick():
                self._visits.append(Visit(node, node.status, node.feedback_message))
            return SKIPPED if was_skipped(child) else number_of(child.status)

        return tick

    def _ticks_built(self, child: Built) -> Tick:
        """Return what ticks a child without a generator."""

        def tick(cells: Cells, times: Times) -> int:  # noqa: ARG001
            outcome = child.work(self._visits)
            self._visits.append(Visit(child, child.status, child.feedback_message))
            return outcome

        return tick


_held, _hold = list.__getitem__, list.__setitem__


class _LiveCells(list[Any]):
    """Cells of which the first ones are the statuses of behaviours."""

    def __init__(self, nodes: list[Behaviour]) -> None:
        super().__init__(nodes)
        self._count = len(nodes)

    def add(self, first: Hashable) -> int:
        """Add a cell; return its number."""
        self.append(first)
        return len(self) - 1

    def __getitem__(self, number: Any) -> Any:
        held = _held(self, number)
        return number_of(held.status) if number < self._count else held

    def __setitem__(self, number: Any, value: Any) -> None:
        if number < self._count:
            _held(self, number).status = STATUSES[value]
        else:
            _hold(self, number, value)
