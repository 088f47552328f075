"""Loops over the items of a queue, one item a tick.

Stock py_trees' ForEach ticks its child once even if there is no item, and takes no literal queue.
"""

from collections.abc import Iterable
from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.entry_types import value_of
from sar_compiler.runtime.kernel.repeating import LoopNode
from sar_compiler.runtime.parents import Wrapper
from sar_compiler.runtime.ports import Input, Output
from sar_compiler.runtime.tokens import excerpt
from sar_compiler.runtime.variables import RefusedValueError, ScriptValue, fit

_SEPARATOR = ";"


class QueueError(SarError):
    """The value that a loop should iterate over is no queue, or an item of it has the wrong type."""


class Loop(Wrapper):
    """Ticks its child once for each item."""

    node_class = LoopNode
    kind: type
    _label: str

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
            return self.items(held)
        except QueueError as error:
            message = f"'{self.name}': queue: {error}"
            raise QueueError(message) from None

    def write(self, raw: object, left: int) -> None:
        """Write an item to the output, and tell how many are left."""
        (item,) = self._read([raw])
        self._value.set(item)
        self.feedback_message = f"item {excerpt(str(item))}, {left} left"

    @classmethod
    def items(cls, held: object) -> list[Any]:
        """Return the items of a queue.

        Args:
            held: A text with items between semicolons, or a list.

        Raises:
            QueueError: If it is neither, or one of them has the wrong type.
        """
        if isinstance(held, str):
            texts = held.split(_SEPARATOR)
            parts: Iterable[object] = texts if texts[-1] else texts[:-1]
        elif isinstance(held, (list, tuple)):
            parts = held
        else:
            message = (
                f"a value of type {type(held).__name__} is no queue; "
                "write a list, or a text with items between semicolons"
            )
            raise QueueError(message)
        return [cls._item(part) for part in parts]

    @classmethod
    def _item(cls, held: object) -> object:
        try:
            value = value_of(held)
            if value is not None:
                return cls._converted(value)
        except RefusedValueError:
            pass
        message = f"{held!r} is not {cls._label}"
        raise QueueError(message) from None

    @classmethod
    def _converted(cls, value: ScriptValue) -> object:
        return fit(value, cls.kind)


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

    kind, _label = int, "a whole number"


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

    kind, _label = float, "a number"


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

    kind, _label = bool, "true or false"

    @classmethod
    def _converted(cls, value: ScriptValue) -> object:
        # As everywhere in tree files: true, True and TRUE.
        spelt = isinstance(value, str) and value in {"True", "TRUE", "False", "FALSE"}
        return super()._converted(str(value).lower() if spelt else value)


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

    kind, _label = str, "a text"

    @classmethod
    def _converted(cls, value: ScriptValue) -> object:
        return fit(value, str)
