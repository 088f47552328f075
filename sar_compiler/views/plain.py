"""Values as JSON can hold them, and as scripts have them."""

from enum import Enum


def plain(value: object) -> object:
    """Return a value that JSON can hold: an enum's name, numbers and texts as they are."""
    if isinstance(value, Enum):
        return value.name
    return value if isinstance(value, (bool, int, float, str, type(None))) else str(value)


def value_as_script(value: object) -> str:
    """Write a value as a script would; None is a key that holds nothing."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"'{value}'" if isinstance(value, str) else str(value)
