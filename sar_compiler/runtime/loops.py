"""Loops over the items of a queue, one item a tick.

Stock py_trees' ForEach ticks its child once even if there is no item, and takes no literal queue.
"""

from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.kernel.repeating import LoopNode
from sar_compiler.runtime.parents import Decorator
from sar_compiler.runtime.ports import Input, Output
from sar_compiler.runtime.queues import QueueError, queue_items
from sar_compiler.runtime.tokens import excerpt


class Loop(Decorator):
    """Ticks its child once for each item."""

    node_class = LoopNode
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

    def write(self, raw: object, left: int) -> None:
        """Write an item to the output, and tell how many are left."""
        (item,) = self._read([raw])
        self._value.set(item)
        self.feedback_message = f"item {excerpt(str(item))}, {left} left"


class LoopInt(Loop):
    """Ticks its child once for each whole number of a queue.

    Args:
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
        child: The child; if it fails, the loop does.
        queue: The texts: `red;green`, or an entry with such a text, a list, or a `collections.deque`, of which
            the items are taken away.
        value: Where each text is written.
        if_empty: What to answer when none is left.
    """

    kind = str
