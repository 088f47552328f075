"""Texts of files as people can be shown them: not too long, and without what a terminal would obey."""

import re

_LONGEST = 400
_ENDING = 100
# What moves the cursor, changes colours, turns the direction of writing, or cannot be seen at all.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ud800-\udfff]"
)


def shortened(text: str) -> str:
    """Return a text without its middle, if it is a very long one."""
    if len(text) <= _LONGEST:
        return text
    return f"{text[: _LONGEST - _ENDING]} [...] {text[-_ENDING:]}"


def visible(text: str) -> str:
    r"""Return a text with control characters, and those that turn the direction of writing, as `\x1b`, `\u202e`."""
    return _UNSEEN.sub(_code, text)


def _code(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"  # noqa: PLR2004 - a byte
