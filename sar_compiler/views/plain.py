"""Values in the notations of JSON and of scripts."""

from enum import Enum


def plain(value: object) -> object:
    """Return a value for JSON: an enum's name, numbers and texts unchanged."""
    if isinstance(value, Enum):
        return value.name
    return value if isinstance(value, (bool, int, float, str, type(None))) else str(value)


def value_as_script(value: object) -> str:
    """Write a value in a script's notation; None is an empty key."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"'{value}'" if isinstance(value, str) else str(value)
