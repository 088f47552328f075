"""Values as JSON can hold them."""

from enum import Enum


def plain(value: object) -> object:
    """Return a value that JSON can hold: an enum's name, numbers and texts as they are."""
    if isinstance(value, Enum):
        return value.name
    return value if isinstance(value, (bool, int, float, str, type(None))) else str(value)
