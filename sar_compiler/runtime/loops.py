"""Loops over the items of a queue, one item a tick.

Stock py_trees' ForEach ticks its child once even if there is no item, and takes no literal queue.
"""

from collections import deque
from collections.abc import Iterable
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.chosen_outcome import Outcome
from sar_compiler.runtime.entry_types import value_of
from sar_compiler.runtime.parents import Ticking, Wrapper
from sar_compiler.runtime.ports import Input, Output
from sar_compiler.runtime.tokens import excerpt
from sar_compiler.runtime.variables import RefusedValueError, ScriptValue, fit

_SEPARATOR = ";"


class QueueError(SarError):
    """The value that a loop should iterate over is no queue, or an item of it has the wrong type."""


class Loop(Wrapper):
    """Ticks its child once for each item."""

    _kind: type
    _label: str

    def __init__(
        self,
        name: str,
        child: Behaviour,
        queue: Input[object],
        value: Output[Any] | None,
        if_empty: Input[Outcome] | None,
    ) -> None:
        super().__init__(name, child)
        self._port = queue
        self._value = value or Output()
        self._if_empty = if_empty or Input(Outcome.SUCCESS)
        self._literal = self._read(queue.get()) if queue.entry is None else None
        self._queue: deque[Any] | None = None
        self._child_runs = False

    def _work(self) -> Ticking:
        if self._starts():
            self._queue = None if self._literal is None else deque(self._literal)
            self._child_runs = False
        if not self._child_runs and not self._next_item():
            self.feedback_message = "no item left"
            return self._if_empty.get().value
        self.status = Status.RUNNING
        outcome = yield from self._tick_child()
        self._child_runs = outcome == Status.RUNNING
        return Status.FAILURE if outcome == Status.FAILURE else Status.RUNNING

    def _next_item(self) -> bool:
        """Write the next item to the output, if there is one."""
        queue = self._current()
        if not queue:
            return False
        (item,) = self._read([queue.popleft()])
        self._value.set(item)
        self.feedback_message = f"item {excerpt(str(item))}, {len(queue)} left"
        return True

    def _current(self) -> deque[Any]:
        if self._literal is None:
            held = self._port.get()
            if isinstance(held, deque):
                # It is shared: whoever fills it may go on, and what is taken is gone.
                self._queue = held
            elif self._queue is None:
                self._queue = deque(self._read(held))
        return self._queue or deque()

    def _read(self, held: object) -> list[Any]:
        try:
            return self.items(held)
        except QueueError as error:
            message = f"'{self.name}': queue: {error}"
            raise QueueError(message) from None

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
        return fit(value, cls._kind)

    def _halt(self) -> None:
        self._child_runs = False
        super()._halt()


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

    _kind, _label = int, "a whole number"

    def __init__(
        self,
        name: str,
        child: Behaviour,
        queue: Input[object],
        value: Output[int] | None = None,
        if_empty: Input[Outcome] | None = None,
    ) -> None:
        super().__init__(name, child, queue, value, if_empty)


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

    _kind, _label = float, "a number"

    def __init__(
        self,
        name: str,
        child: Behaviour,
        queue: Input[object],
        value: Output[float] | None = None,
        if_empty: Input[Outcome] | None = None,
    ) -> None:
        super().__init__(name, child, queue, value, if_empty)


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

    _kind, _label = bool, "true or false"

    def __init__(
        self,
        name: str,
        child: Behaviour,
        queue: Input[object],
        value: Output[bool] | None = None,
        if_empty: Input[Outcome] | None = None,
    ) -> None:
        super().__init__(name, child, queue, value, if_empty)

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

    _kind, _label = str, "a text"

    def __init__(
        self,
        name: str,
        child: Behaviour,
        queue: Input[object],
        value: Output[str] | None = None,
        if_empty: Input[Outcome] | None = None,
    ) -> None:
        super().__init__(name, child, queue, value, if_empty)

    @classmethod
    def _converted(cls, value: ScriptValue) -> object:
        return fit(value, str)
