"""The items of a loop's queue."""

from collections.abc import Iterable
from typing import Any

from sar_compiler.errors import NodeError
from sar_compiler.runtime.entry_types import read_as, value_of
from sar_compiler.runtime.variables import RefusedValueError, fit

_SEPARATOR = ";"
_LABELS = {int: "an integer", float: "a number", bool: "true or false", str: "a string"}


class QueueError(NodeError):
    """The value that a loop iterates over is not a queue, or an item has the wrong type."""


def queue_items(held: object, kind: type) -> list[Any]:
    """Return the items of a queue.

    Args:
        held: A string with items separated by semicolons, or a list.
        kind: The type of the items: `bool`, `int`, `float` or `str`.

    Raises:
        QueueError: If it is neither, or one of them has the wrong type.
    """
    if isinstance(held, str):
        texts = held.split(_SEPARATOR)
        parts: Iterable[object] = texts if texts[-1] else texts[:-1]
    elif isinstance(held, (list, tuple)):
        parts = held
    else:
        raise QueueError(
            f"a value of type {type(held).__name__} is not a queue: "
            "write a list, or a string with items separated by semicolons"
        )
    return [_item(part, kind) for part in parts]


def _item(held: object, kind: type) -> object:
    try:
        value = value_of(held)
        if value is not None:
            return read_as(value, kind) if kind is bool and isinstance(value, str) else fit(value, kind)
    except RefusedValueError:
        pass
    raise QueueError(f"{held!r} is not {_LABELS[kind]}") from None
