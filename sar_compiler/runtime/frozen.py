"""Values that can be compared and kept: what an entry of the blackboard holds, whatever happens to it afterwards."""

import math
from collections import deque
from collections.abc import Hashable
from typing import Any

from sar_compiler.errors import UndecidableError

PLAIN = (bool, int, str, bytes, type(None))
"""The types of values that are kept as they are, with their type before them."""
# What is copied item by item; dictionaries are, too.
_COLLECTIONS = (list, tuple, deque, set, frozenset)
_NAN = "nan"


class FrozenValueError(UndecidableError):
    """A value can neither be copied nor kept as it is."""


def freeze(value: object) -> Hashable:
    """Return a copy of a value that can be hashed, and is equal to that of an equal value of the same type.

    Lists, tuples, sets, dictionaries and double-ended queues are copied with all that is in them. Anything else is
    taken as it is, so whoever compares states must not change it in place.

    Raises:
        FrozenValueError: If it cannot be hashed.
    """
    kind = type(value)
    # With its type: 1, 1.0 and True are equal to Python.
    if kind in PLAIN:
        return kind, value
    if kind is float:
        return kind, _NAN if math.isnan(value) else value, math.copysign(1.0, value)  # type: ignore[arg-type]
    if kind is dict:
        return kind, tuple((freeze(key), freeze(held)) for key, held in value.items())  # type: ignore[attr-defined]
    if kind in _COLLECTIONS:
        items = (freeze(item) for item in value)  # type: ignore[attr-defined]
        return (
            kind,
            frozenset(items) if kind in {set, frozenset} else tuple(items),
            getattr(value, "maxlen", None),
        )
    try:
        hash(value)
    except TypeError:
        raise FrozenValueError(
            f"a value of type {kind.__name__}, which can neither be copied nor hashed; "
            "keep lists, dictionaries, numbers and texts on the blackboard, or give its class a __hash__"
        ) from None
    return kind, value


def thaw(frozen: Any) -> Any:
    """Return the value that was frozen, or a copy of it where it can be changed in place."""
    kind, held, *others = frozen
    if kind is float:
        return math.nan if held == _NAN else held
    if kind is dict:
        return {thaw(key): thaw(value) for key, value in held}
    if kind is deque:
        return deque(map(thaw, held), *others)
    if kind in _COLLECTIONS:
        return kind(map(thaw, held))
    return held


def can_change(value: object) -> bool:
    """Return whether a value of the kinds that are copied can be changed in place."""
    kind = type(value)
    return kind is dict or (kind in _COLLECTIONS and kind is not frozenset)
