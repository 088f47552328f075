"""Shortening of texts from files for display, and escaping of the texts' control characters."""

import re

_LONGEST = 400
_ENDING = 100
# Characters that move the cursor, change colours, change the direction of writing, or are invisible.
UNSEEN = (
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff"
    "\U000e0000-\U000e007f]"
)
"""The characters that are escaped for display."""
UNSPEAKABLE = "[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]"
"""The characters that XML cannot represent, not even by a character reference."""


def shorten(text: str) -> str:
    """Replace the middle of a very long text by `[...]`."""
    if len(text) <= _LONGEST:
        return text
    return f"{text[: _LONGEST - _ENDING]} [...] {text[-_ENDING:]}"


def visible(text: str) -> str:
    r"""Escape characters that are invisible or control a terminal, for example as `\x1b` or `\u202e`."""
    if text.isascii() and text.replace("\n", "").isprintable():  # nearly every text
        return text
    return re.sub(UNSEEN, _code, text)


def escape_to_one_line(text: str) -> str:
    r"""Escape a text as `visible` does, and escape the line breaks in the text as `\n`."""
    return visible(text).replace("\n", "\\n")


def shorten_to_line(text: str) -> str:
    """Shorten a text of unknown content to a single log line, and escape its control characters."""
    return escape_to_one_line(shorten(text))


def _code(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else match[0].encode("ascii", "backslashreplace").decode()  # noqa: PLR2004
