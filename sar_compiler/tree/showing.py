"""Texts of files as people can be shown them: not too long, and without what a terminal would obey."""

import re

_LONGEST = 400
_ENDING = 100
# What moves the cursor, changes colours, turns the direction of writing, or cannot be seen at all.
UNSEEN = (
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff"
    "\U000e0000-\U000e007f]"
)
"""What people are not shown as it is."""
UNSPEAKABLE = "[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]"
"""What no XML can say, not even by a reference."""


def shortened(text: str) -> str:
    """Return a text without its middle, if it is a very long one."""
    if len(text) <= _LONGEST:
        return text
    return f"{text[: _LONGEST - _ENDING]} [...] {text[-_ENDING:]}"


def visible(text: str) -> str:
    r"""Return a text with control characters, and those that turn the direction of writing, as `\x1b`, `\u202e`."""
    return re.sub(UNSEEN, _code, text)


def in_one_line(text: str) -> str:
    r"""Return a text as `visible` does, with its line breaks as `\n`: nothing in it can pass for a line of its own."""
    return visible(text).replace("\n", "\\n")


def short_line(text: str) -> str:
    """Return a text of somebody else's as a log may have it: in one line, without its middle if it is a very long one."""
    return in_one_line(shortened(text))


def _code(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else match[0].encode("ascii", "backslashreplace").decode()  # noqa: PLR2004
