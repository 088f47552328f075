"""The mission context: objects handed to leaves by their type."""

from collections.abc import Callable
from typing import TypeVar, overload

from sar_compiler.errors import SarError

T = TypeVar("T")

_MARK = "__mission_context__"


class PreviewError(SarError):
    """A stand-in for an object of the mission context cannot be made."""


@overload
def mission_context(cls: type[T], /) -> type[T]: ...
@overload
def mission_context(*, preview: Callable[[], object] | None = None) -> Callable[[type[T]], type[T]]: ...
def mission_context(
    cls: type[T] | None = None, /, *, preview: Callable[[], object] | None = None
) -> type[T] | Callable[[type[T]], type[T]]:
    """Mark a class as part of the mission context: `@mission_context`, or `@mission_context(preview=make)`.

    A leaf's constructor parameter that is annotated with such a class is not an attribute of its tag:
    whoever compiles the tree for a mission hands the object over.

    Args:
        cls: The class.
        preview: Makes a stand-in, for a tree that is compiled only to be looked at or tested; by default the class
            does.

    Returns:
        The class; without it, a decorator that marks one.
    """

    def mark(marked: type[T]) -> type[T]:
        setattr(marked, _MARK, preview or marked)
        return marked

    return mark if cls is None else mark(cls)


def is_mission_context(cls: type) -> bool:
    """Return whether a class is injected rather than written in a tree file."""
    return hasattr(cls, _MARK)


def preview_of(cls: type) -> object:
    """Make the stand-in that the class was marked with.

    Raises:
        PreviewError: If that fails.
    """
    factory: Callable[[], object] = getattr(cls, _MARK)
    try:
        return factory()
    except Exception as error:
        raise PreviewError(
            f"no stand-in for the context object {cls.__name__} can be made ({type(error).__name__}: {error}); "
            "mark its class with a function that makes one: @mission_context(preview=make)"
        ) from error
