"""Parse JSON files so that errors can name the line and column of a value."""

import json
import re
from collections.abc import Iterator
from typing import Any

from sar_compiler.errors import SarError
from sar_compiler.tree.diagnostic import Source
from sar_compiler.tree.model import NO_SPANS

_BLANK = " \t\r\n"
_TEXT_OR_BRACKET = re.compile(r'("(?:[^"\\]|\\.)*")(\s*:)?|[{}\[\]]')


class MalformedJsonError(SarError):
    """The text of a file is not valid JSON.

    Attributes:
        place: File, line and column of the error, separated by colons.
    """

    def __init__(self, message: str, place: str) -> None:
        self.place = place
        super().__init__(message)


class JsonFile:
    """A parsed JSON file.

    Args:
        text: The content of the file.
        path: The file's path, as shown in messages.

    Attributes:
        data: The parsed value. If a mapping contains a key twice, the last value of the key is used.
        has_duplicates: Whether a mapping contains a key twice.

    Raises:
        MalformedJsonError: If the text is not valid JSON.
    """

    def __init__(self, text: str, path: str) -> None:
        self._source = Source(path, text, NO_SPANS)
        try:
            self.has_duplicates = False
            self.data: Any = json.loads(text, object_pairs_hook=self._mapping)
        except json.JSONDecodeError as error:
            raise MalformedJsonError(error.msg, self._location(error.pos)) from None
        except (ValueError, RecursionError) as error:  # a number with thousands of digits, or deep nesting
            raise MalformedJsonError(f"{error}", self._location(0)) from None
        self._read = json.JSONDecoder().raw_decode

    def _mapping(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        mapping = dict(pairs)
        self.has_duplicates |= len(mapping) < len(pairs)
        return mapping

    def duplicates(self) -> Iterator[tuple[str, str]]:
        """Yield each repeated key of a mapping, and the file, line and column of the repetition."""
        enclosing_keys: list[set[str]] = []
        for match in _TEXT_OR_BRACKET.finditer(self._source.text if self.has_duplicates else ""):
            if match[0] in {"{", "["}:
                enclosing_keys.append(set())
            elif match[0] in {"}", "]"}:
                enclosing_keys.pop()
            elif match[2]:
                key = json.loads(match[1])
                if key in enclosing_keys[-1]:
                    yield key, self._location(match.start())
                enclosing_keys[-1].add(key)

    def location_of(self, *path: str | int) -> str:
        """Return the file, line and column of the value at a path of keys and indices.

        If the file has no such value, return the location of the last value on the path that exists.
        """
        text, at = self._source.text, self._next(0)
        for step in path:
            inner = self._find(text, at, step)
            if inner is None:
                break
            at = inner
        return self._location(at)

    def _find(self, text: str, start: int, step: str | int) -> int | None:
        """Return the offset of an entry in the mapping or list that begins at *start*; None if there is no such entry."""
        found = None
        if text[start : start + 1] != ("{" if isinstance(step, str) else "["):
            return None
        at, index = self._next(start + 1), 0
        while text[at] not in "]}":
            key: str | int = index
            if isinstance(step, str):
                key, at = self._read(text, at)
                at = self._next(self._next(at) + 1)  # after the colon
            if key == step:
                found = at  # if a key is repeated, its last value is used
                if isinstance(step, int):
                    break
            _, at = self._read(text, at)
            at, index = self._next(at), index + 1
            at = self._next(at + 1) if text[at] == "," else at
        return found

    def _next(self, at: int) -> int:
        """Return the offset of the next non-blank character at or after an offset."""
        text = self._source.text
        while text[at : at + 1] and text[at] in _BLANK:
            at += 1
        return at

    def _location(self, offset: int) -> str:
        line, column = self._source.position_of(offset)
        return f"{self._source.path}:{line}:{column}"
