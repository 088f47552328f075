"""Replacements of parts of a string, and the lines that such a replacement consists of."""

import itertools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.tree.diagnostic import LINE_END


class EditError(SarError):
    """An operation is impossible on this text."""


class TextEdit(NamedTuple):
    """The replacement of one part of a string.

    Attributes:
        start: The offset of the first character to replace.
        end: The offset after the last one.
        text: The replacement.
    """

    start: int
    end: int
    text: str


def apply_edits(text: str, edits: Iterable[TextEdit]) -> str:
    """Return a string with edits applied; their offsets are those of the original, and no two overlap."""
    parts, done = [], 0
    for edit in sorted(edits):
        parts += [text[done : edit.start], edit.text]
        done = edit.end
    return "".join([*parts, text[done:]])


def inverse_edits(text: str, edits: Iterable[TextEdit]) -> list[TextEdit]:
    """Return the edits that restore the original text from the edited one."""
    inverse, growth = [], 0
    for edit in sorted(edits):
        start = edit.start + growth
        inverse.append(TextEdit(start, start + len(edit.text), text[edit.start : edit.end]))
        growth += len(edit.text) - (edit.end - edit.start)
    return inverse


def edit_between(old: str, new: str) -> list[TextEdit]:
    """Return the smallest single edit from one text to another; none if they are equal."""
    if old == new:
        return []
    most = min(len(old), len(new))
    start = next((index for index in range(most) if old[index] != new[index]), most)
    rest = most - start
    behind = next((index for index in range(rest) if old[-1 - index] != new[-1 - index]), rest)
    return [TextEdit(start, len(old) - behind, new[start : len(new) - behind])]


class SnippetLine(NamedTuple):
    """A line of a snippet.

    Attributes:
        text: The line, without its end and without the indentation that all lines share.
        is_fixed: Whether its indentation is part of an attribute's value, and stays.
    """

    text: str
    is_fixed: bool = False


Snippet = Sequence[SnippetLine]
"""Lines that can be written with any indentation."""


def indent_lines(lines: Snippet, indent: str) -> list[SnippetLine]:
    """Return lines with further indentation."""
    return [each if each.is_fixed or not each.text else SnippetLine(indent + each.text) for each in lines]


def cut_lines(text: str, indent: str, fixed: Iterable[int] = ()) -> list[SnippetLine]:
    """Return a part of a string as lines.

    Args:
        text: The part, whose first line begins with its indentation.
        indent: The indentation of the first line, which is removed from the others too.
        fixed: The offsets of line starts whose indentation stays.
    """
    lines, kept = [], set(fixed)
    ends = [each.end() for each in LINE_END.finditer(text)]
    for begin, end in itertools.pairwise([0, *ends, len(text)]):
        if begin == end:
            continue
        line = text[begin:end]
        body = line.rstrip("\r\n")
        if begin in kept:
            lines.append(SnippetLine(body, is_fixed=True))
        else:
            lines.append(
                SnippetLine(body.removeprefix(indent) if body.startswith(indent) else body.lstrip(" \t"))
            )
    return lines


def join_lines(lines: Snippet, end: str) -> str:
    """Return lines as text, with a line end after each of them except the last one."""
    return end.join(each.text for each in lines)
