"""Edits of a string, and snippets of lines that edits insert."""

import itertools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.tree.diagnostic import LINE_END


class EditError(SarError):
    """An operation on a tree file is impossible."""


class TextEdit(NamedTuple):
    """The replacement of one part of a string.

    Attributes:
        start: The offset of the first character to replace.
        end: The offset after the last character to replace.
        text: The replacement.
    """

    start: int
    end: int
    text: str


def apply_edits(text: str, edits: Iterable[TextEdit]) -> str:
    """Return a string with edits applied.

    The edits' offsets refer to the original string, and edits never overlap.
    """
    parts, done = [], 0
    for edit in sorted(edits):
        parts += [text[done : edit.start], edit.text]
        done = edit.end
    return "".join([*parts, text[done:]])


def edit_between(old: str, new: str) -> list[TextEdit]:
    """Return the smallest edit that changes one text into another; no edit if both are equal."""
    if old == new:
        return []
    most = min(len(old), len(new))
    start = next((index for index in range(most) if old[index] != new[index]), most)
    rest = most - start
    tail = next((index for index in range(rest) if old[-1 - index] != new[-1 - index]), rest)
    return [TextEdit(start, len(old) - tail, new[start : len(new) - tail])]


class SnippetLine(NamedTuple):
    """A line of a snippet.

    Attributes:
        text: The text of the line, without the line end and without the indentation that all lines share.
        is_fixed: Whether the indentation is part of an attribute's value, and must not be changed.
    """

    text: str
    is_fixed: bool = False


Snippet = Sequence[SnippetLine]
"""Lines that can be written with any indentation."""


def indent_lines(lines: Snippet, indent: str) -> list[SnippetLine]:
    """Return lines with additional indentation."""
    return [each if each.is_fixed or not each.text else SnippetLine(indent + each.text) for each in lines]


def cut_lines(text: str, indent: str, fixed: Iterable[int] = ()) -> list[SnippetLine]:
    """Split a text into the lines of a snippet.

    Args:
        text: The text.
        indent: The indentation of the first line, which is removed from all lines.
        fixed: The offsets of the starts of lines whose indentation must not be changed.
    """
    lines, unchanged = [], set(fixed)
    ends = [each.end() for each in LINE_END.finditer(text)]
    for begin, end in itertools.pairwise([0, *ends, len(text)]):
        if begin == end:
            continue
        line = text[begin:end]
        body = line.rstrip("\r\n")
        if begin in unchanged:
            lines.append(SnippetLine(body, is_fixed=True))
        else:
            lines.append(
                SnippetLine(body.removeprefix(indent) if body.startswith(indent) else body.lstrip(" \t"))
            )
    return lines


def join_lines(lines: Snippet, end: str) -> str:
    """Join lines into a text, with a line end after each line except the last."""
    return end.join(each.text for each in lines)
