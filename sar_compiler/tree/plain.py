"""Conversion of values to JSON and to the notation of scripts."""

import re
from enum import Enum

from sar_compiler.json_values import json_text
from sar_compiler.tree.display_text import UNSEEN, UNSPEAKABLE


def as_json(data: object, indent: int | None = 2) -> str:
    """Return data as JSON, with terminal control characters escaped.

    Each level is indented by *indent* spaces; with None, the text is on one line. Numbers that are not finite become null.
    """
    return re.sub(UNSEEN, _escape, json_text(data, indent=indent, ensure_ascii=False))


def _escape(match: re.Match[str]) -> str:
    digits = match[0].encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{digits[start : start + 4]}" for start in range(0, len(digits), 4))


def to_json_value(value: object) -> object:
    """Convert a value for JSON.

    Members of enumerations become names, numbers and strings stay unchanged, and other values become strings.
    """
    if isinstance(value, Enum):
        return value.name
    return value if isinstance(value, (bool, int, float, str, type(None))) else str(value)


def value_as_script(value: object) -> str:
    """Return a value in the notation of scripts.

    None becomes `nothing`, the value of a key without a value.
    """
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"'{value}'" if isinstance(value, str) else str(value)


def count_with_noun(number: int, what: str) -> str:
    """Return a number with a noun in the singular or plural, such as `1 file` and `1,000 files`."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def speakable(text: str) -> str:
    """Replace the characters that XML cannot represent by U+FFFD."""
    return re.sub(UNSPEAKABLE, "\ufffd", text)
