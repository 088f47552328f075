"""Loops over the items of a queue, one item a tick.

Stock py_trees' ForEach ticks its child once even if there is no item, and takes no literal queue.
"""

from collections import deque
from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.flat.cells import FAILURE, INVALID, RUNNING, SKIPPED, Cells, Stop, Tick, number_of
from sar_compiler.runtime.flat.parts import Part, builds, halted_with_child, is_reset, ticked
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.frozen import freeze, thaw
from sar_compiler.runtime.parents import Wrapper
from sar_compiler.runtime.ports import Input, Output
from sar_compiler.runtime.queues import QueueError, queue_items
from sar_compiler.runtime.tokens import excerpt


class Loop(Wrapper):
    """Ticks its child once for each item."""

    kind: type

    def __init__(
        self,
        name: str,
        child: Behaviour,
        queue: Input[object],
        value: Output[Any] | None = None,
        if_empty: Input[Outcome] | None = None,
    ) -> None:
        super().__init__(name, child)
        self._port = queue
        self._value = value or Output()
        self._if_empty = if_empty or Input(Outcome.SUCCESS)
        self._literal = self._read(queue.get()) if queue.entry is None else None

    def _read(self, held: object) -> list[Any]:
        try:
            return queue_items(held, self.kind)
        except QueueError as error:
            message = f"'{self.name}': queue: {error}"
            raise QueueError(message) from None


class LoopInt(Loop):
    """Ticks its child once for each whole number of a queue.

    Args:
        name: The node's name.
        child: The child; if it fails, the loop does.
        queue: The numbers: `1;2;3`, or an entry with such a text, a list, or a `collections.deque`, of which
            the items are taken away.
        value: Where each number is written.
        if_empty: What to answer when none is left.
    """

    kind = int


class LoopDouble(Loop):
    """Ticks its child once for each real number of a queue.

    Args:
        name: The node's name.
        child: The child; if it fails, the loop does.
        queue: The numbers: `1.5;2;3`, or an entry with such a text, a list, or a `collections.deque`, of which
            the items are taken away.
        value: Where each number is written.
        if_empty: What to answer when none is left.
    """

    kind = float


class LoopBool(Loop):
    """Ticks its child once for each truth value of a queue.

    Args:
        name: The node's name.
        child: The child; if it fails, the loop does.
        queue: The values: `true;false`, or an entry with such a text, a list, or a `collections.deque`, of which
            the items are taken away.
        value: Where each value is written.
        if_empty: What to answer when none is left.
    """

    kind = bool


class LoopString(Loop):
    """Ticks its child once for each text of a queue.

    Args:
        name: The node's name.
        child: The child; if it fails, the loop does.
        queue: The texts: `red;green`, or an entry with such a text, a list, or a `collections.deque`, of which
            the items are taken away.
        value: Where each text is written.
        if_empty: What to answer when none is left.
    """

    kind = str


_UNSEEN = 0
"""In place of a queue that was not read yet."""


@builds(LoopInt, LoopDouble, LoopBool, LoopString)
def loop(part: Part) -> tuple[Tick, Stop]:
    """Build a loop; what it makes of the items is said by the node itself."""
    node = _Loop(part)
    return node.tick, halted_with_child(part, node.left, node.child_runs)


class _Loop:
    def __init__(self, part: Part) -> None:
        self.part = part
        self.tick_child = ticked(part)
        literal = part.behaviour._literal
        self.literal = _UNSEEN if literal is None else _frozen(literal)
        # What is left of the queue.
        self.left, self.child_runs = part.cell(_UNSEEN), part.cell(0)
        self.is_reset = is_reset(part.behaviour)

    def tick(self, cells: Cells, times: Times) -> int:
        at = self.part.at
        if cells[at] == INVALID or (cells[at] != RUNNING and not self.is_reset):
            cells[self.left], cells[self.child_runs] = self.literal, 0
        if not cells[self.child_runs] and not self.next_item(cells):
            return self.end(cells)
        cells[at] = RUNNING
        outcome = self.tick_child(cells, times)
        cells[self.child_runs] = int(outcome == RUNNING)
        cells[at] = FAILURE if outcome == FAILURE else RUNNING
        return int(cells[at])

    def end(self, cells: Cells) -> int:
        behaviour = self.part.behaviour
        behaviour.feedback_message = "no item left"
        outcome = number_of(behaviour._if_empty.get().status) or SKIPPED
        if outcome != SKIPPED:
            cells[self.part.at] = outcome
        return outcome

    def next_item(self, cells: Cells) -> bool:
        """Write the next item to the output, if there is one."""
        behaviour = self.part.behaviour
        shared = self.shared(cells)
        if not (cells[self.left] if shared is None else shared):
            return False
        if shared is None:
            first, *others = cells[self.left]
            raw, cells[self.left] = thaw(first), tuple(others)
        else:
            raw = shared.popleft()
            cells[self.left] = _frozen(shared)
        (item,) = behaviour._read([raw])
        behaviour._value.set(item)
        behaviour.feedback_message = f"item {excerpt(str(item))}, {len(cells[self.left])} left"
        return True

    def shared(self, cells: Cells) -> deque[Any] | None:
        """Look at the queue; return it if others take from it, too, else note what is left of it."""
        if self.literal != _UNSEEN:
            return None
        held = self.part.behaviour._port.get()
        if isinstance(held, deque):
            return held
        if cells[self.left] == _UNSEEN:
            cells[self.left] = _frozen(self.part.behaviour._read(held))
        return None


def _frozen(items: Any) -> tuple[Any, ...]:
    return tuple(freeze(item) for item in items)
