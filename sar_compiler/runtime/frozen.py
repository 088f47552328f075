"""Immutable, comparable copies of blackboard values."""

import math
from collections import deque
from collections.abc import Hashable
from typing import Any

from sar_compiler.errors import UndecidableError

PLAIN = (bool, int, str, bytes, type(None))
"""The types of immutable values. A frozen copy contains the value itself, together with its type."""
# The types other than dictionaries that are copied item by item.
_COLLECTIONS = (list, tuple, deque, set, frozenset)
_NAN = "nan"


class FrozenValueError(UndecidableError):
    """Raised if a value can neither be copied nor hashed."""


def freeze(value: object) -> Hashable:
    """Return a hashable copy of a value. Equal values of the same type have equal copies.

    Lists, tuples, sets, dictionaries and deques are copied with their content. Other values are not copied, and must not be changed in
    place while states are compared.

    Raises:
        FrozenValueError: If the value cannot be hashed.
    """
    kind = type(value)
    # The copy contains the type, because 1, 1.0 and True are equal in Python.
    if kind in PLAIN:
        return kind, value
    if kind is float:
        return kind, _NAN if math.isnan(value) else value, math.copysign(1.0, value)  # type: ignore[arg-type]
    if kind is dict:
        return kind, tuple((freeze(key), freeze(item)) for key, item in value.items())  # type: ignore[attr-defined]
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
            f"a value of type {kind.__name__}, which can neither be copied nor hashed. Store lists, dictionaries, numbers and strings on "
            f"the blackboard, or add a __hash__ method to the class of the value"
        ) from None
    return kind, value


def thaw(frozen: Any) -> Any:
    """Convert a frozen copy back to a value. Lists and other collections are created as new objects."""
    kind, content, *others = frozen
    if kind is float:
        return math.nan if content == _NAN else content
    if kind is dict:
        return {thaw(key): thaw(value) for key, value in content}
    if kind is deque:
        return deque(map(thaw, content), *others)
    if kind in _COLLECTIONS:
        return kind(map(thaw, content))
    return content


def can_change(value: object) -> bool:
    """Return whether a value can be changed in place, so that `freeze` must copy it."""
    kind = type(value)
    return kind is dict or (kind in _COLLECTIONS and kind is not frozenset)
