"""The mission context: objects that a mission passes to leaf constructors. Parameter types select the objects."""

from collections.abc import Callable
from typing import TypeVar, overload

from sar_compiler.errors import SarError

T = TypeVar("T")

_MARK = "__mission_context__"


class PreviewError(SarError):
    """Raised if the placeholder for an object of the mission context cannot be created."""


@overload
def mission_context(cls: type[T], /) -> type[T]: ...
@overload
def mission_context(*, preview: Callable[[], object] | None = None) -> Callable[[type[T]], type[T]]: ...
def mission_context(
    cls: type[T] | None = None, /, *, preview: Callable[[], object] | None = None
) -> type[T] | Callable[[type[T]], type[T]]:
    """Mark a class whose objects the mission provides: `@mission_context` or `@mission_context(preview=make)`.

    A constructor parameter of a leaf that is annotated with such a class is not an attribute of the leaf's tag. The
    mission that compiles the tree provides the object.

    Args:
        cls: The class.
        preview: Function that creates a placeholder for trees that are only displayed or tested; by default the class.

    Returns:
        The class; a decorator that marks a class if *cls* is not given.
    """

    def mark(marked: type[T]) -> type[T]:
        setattr(marked, _MARK, preview or marked)
        return marked

    return mark if cls is None else mark(cls)


def is_mission_context(cls: type) -> bool:
    """Return whether the mission, and not an attribute in the tree file, provides objects of a class."""
    return hasattr(cls, _MARK)


def preview_of(cls: type) -> object:
    """Create the placeholder for an object of the mission context.

    Raises:
        PreviewError: If the placeholder cannot be created.
    """
    factory: Callable[[], object] = getattr(cls, _MARK)
    try:
        return factory()
    except Exception as error:
        raise PreviewError(
            f"a placeholder for the context object {cls.__name__} cannot be created ({type(error).__name__}: {error}). "
            "Mark the class with a function that creates a placeholder: @mission_context(preview=make)"
        ) from error
