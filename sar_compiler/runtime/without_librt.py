"""Python replacements for librt and for mypy's native number types, for robots with only apt packages.

With these replacements, the kernel's Python source uses lists instead of librt's vectors. The compiled kernel requires librt.
"""

import importlib.util
import sys
from collections.abc import Iterable
from types import ModuleType
from typing import Any


class Vector(list[Any]):
    """A list with the interface of `librt.vecs.vec`."""

    def __init__(self, items: Iterable[Any] = (), *, capacity: int = 0) -> None:  # noqa: ARG002 - the signature of librt
        super().__init__(items)

    def __class_getitem__(cls, item: Any) -> Any:
        """Return the class, because a list may have items of any type."""
        return cls

    def __getitem__(self, at: Any) -> Any:
        """Return the item at an index, or a slice as a vector."""
        found = super().__getitem__(at)
        return Vector(found) if isinstance(at, slice) else found


def append(vector: Vector, item: Any) -> Vector:
    """Append an item, and return the vector, as the librt function does."""
    vector.append(item)
    return vector


def extend(vector: Vector, items: Iterable[Any]) -> Vector:
    """Append items, and return the vector, as the librt function does."""
    vector.extend(items)
    return vector


def register_replacements() -> None:
    """If the modules `librt` and `mypy_extensions` are not installed, register replacements for them."""
    if importlib.util.find_spec("librt") is None:
        _add_module("librt", vecs=_add_module("librt.vecs", vec=Vector, append=append, extend=extend))
    if importlib.util.find_spec("mypy_extensions") is None:
        numbers = dict.fromkeys(("i16", "i32", "i64", "u8"), int)
        _add_module("mypy_extensions", **numbers, mypyc_attr=lambda **_: lambda cls: cls)


def _add_module(name: str, **content: Any) -> ModuleType:
    module = sys.modules[name] = ModuleType(name)
    vars(module).update(content)
    return module
