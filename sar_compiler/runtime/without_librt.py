"""Replacements of librt and mypy's native number types, for robots with only apt packages.

The uncompiled kernel uses lists in place of librt's vectors, only slower. The compiled kernel requires librt.
"""

import importlib.util
import sys
from collections.abc import Iterable
from types import ModuleType
from typing import Any


class Vector(list[Any]):
    """A list that replaces a `librt.vecs.vec`."""

    def __init__(self, items: Iterable[Any] = (), *, capacity: int = 0) -> None:  # noqa: ARG002 - the signature of librt
        super().__init__(items)

    def __class_getitem__(cls, item: Any) -> Any:
        """Return the class, for any type of items."""
        return cls

    def __getitem__(self, at: Any) -> Any:
        """Return an item, or a vector of a slice."""
        found = super().__getitem__(at)
        return Vector(found) if isinstance(at, slice) else found


def append(vector: Vector, item: Any) -> Vector:
    """Return the vector with one more item."""
    vector.append(item)
    return vector


def extend(vector: Vector, items: Iterable[Any]) -> Vector:
    """Return the vector with more items."""
    vector.extend(items)
    return vector


def stand_in() -> None:
    """Register the replacements under librt's names, unless librt is installed."""
    if importlib.util.find_spec("librt") is None:
        _offer("librt", vecs=_offer("librt.vecs", vec=Vector, append=append, extend=extend))
    if importlib.util.find_spec("mypy_extensions") is None:
        numbers = dict.fromkeys(("i16", "i32", "i64", "u8"), int)
        _offer("mypy_extensions", **numbers, mypyc_attr=lambda **_: lambda cls: cls)


def _offer(name: str, **content: Any) -> ModuleType:
    module = sys.modules[name] = ModuleType(name)
    vars(module).update(content)
    return module
