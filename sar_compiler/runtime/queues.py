"""Read the items of the queue over which a loop node iterates."""

from collections.abc import Iterable
from typing import Any

from sar_compiler.errors import NodeError
from sar_compiler.runtime.entry_types import read_as, value_of
from sar_compiler.runtime.variables import RefusedValueError, fit

_SEPARATOR = ";"
_LABELS = {int: "an integer", float: "a number", bool: "true or false", str: "a string"}


class QueueError(NodeError):
    """Raised if the queue of a loop node is not a list or string of items, or an item has the wrong type."""


def queue_items(queue: object, kind: type) -> list[Any]:
    """Return the items of a queue.

    Args:
        queue: A string with items separated by semicolons, or a list.
        kind: The type of the items: `bool`, `int`, `float` or `str`.

    Raises:
        QueueError: If the value is neither a string nor a list, or an item has the wrong type.
    """
    if isinstance(queue, str):
        texts = queue.split(_SEPARATOR)
        parts: Iterable[object] = texts if texts[-1] else texts[:-1]
    elif isinstance(queue, (list, tuple)):
        parts = queue
    else:
        raise QueueError(
            f"a value of type {type(queue).__name__} is not a queue. "
            "Write a list, or a string with items separated by semicolons"
        )
    return [_item(part, kind) for part in parts]


def _item(part: object, kind: type) -> object:
    try:
        value = value_of(part)
        if value is not None:
            return read_as(value, kind) if kind is bool and isinstance(value, str) else fit(value, kind)
    except RefusedValueError:
        pass
    raise QueueError(f"{part!r} is not {_LABELS[kind]}") from None
