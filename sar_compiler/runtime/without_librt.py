"""What stands in for librt, and mypy's names of native numbers, where they are not installed: a robot that has apt's packages only.

The kernel as Python works with lists as it does with librt's vectors, only slower. The compiled kernel needs librt.
"""

import importlib.util
import sys
from collections.abc import Iterable
from types import ModuleType
from typing import Any


class Vector(list[Any]):
    """A list in place of a `librt.vecs.vec`."""

    def __init__(self, items: Iterable[Any] = (), *, capacity: int = 0) -> None:  # noqa: ARG002 - as there
        super().__init__(items)

    def __class_getitem__(cls, item: Any) -> Any:
        """Return the class, whatever its items are."""
        return cls

    def __getitem__(self, at: Any) -> Any:
        """Return an item, or a vector of some of them."""
        found = super().__getitem__(at)
        return Vector(found) if isinstance(at, slice) else found


def append(vector: Vector, item: Any) -> Vector:
    """Return a vector with an item more."""
    vector.append(item)
    return vector


def extend(vector: Vector, items: Iterable[Any]) -> Vector:
    """Return a vector with more items."""
    vector.extend(items)
    return vector


def stand_in() -> None:
    """Have these be imported by librt's names, unless it is there."""
    if importlib.util.find_spec("librt") is None:
        _offer("librt", vecs=_offer("librt.vecs", vec=Vector, append=append, extend=extend))
    if importlib.util.find_spec("mypy_extensions") is None:
        numbers = dict.fromkeys(("i16", "i32", "i64", "u8"), int)
        _offer("mypy_extensions", **numbers, mypyc_attr=lambda **_: lambda cls: cls)


def _offer(name: str, **content: Any) -> ModuleType:
    module = sys.modules[name] = ModuleType(name)
    vars(module).update(content)
    return module
