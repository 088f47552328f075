"""The mission context: objects handed to leaves by their type."""

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

_MARK = "__mission_context__"


def mission_context(preview: Callable[[], object] | None = None) -> Callable[[type[T]], type[T]]:
    """Mark a class as part of the mission context.

    A leaf's constructor parameter that is annotated with such a class is not an attribute of its tag:
    whoever compiles the tree for a mission hands the object over.

    Args:
        preview: Makes a stand-in, for a tree that is compiled only to be looked at or tested; by default the class
            does.

    Returns:
        A decorator that marks the class and returns it.
    """

    def mark(cls: type[T]) -> type[T]:
        setattr(cls, _MARK, preview or cls)
        return cls

    return mark


def is_mission_context(cls: type) -> bool:
    """Return whether a class is injected rather than written in a tree file."""
    return hasattr(cls, _MARK)


def preview_of(cls: type) -> object:
    """Make the stand-in that the class was marked with."""
    factory: Callable[[], object] = getattr(cls, _MARK)
    return factory()
