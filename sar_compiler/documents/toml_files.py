"""TOML files with the location of every key and value: tomllib parses them, and a scanner finds the locations."""

import re
import sys
from pathlib import Path
from typing import Any

from sar_compiler.documents.located import Document, Value
from sar_compiler.opener import SETTINGS, read_file
from sar_compiler.tree.content import make_source
from sar_compiler.tree.diagnostic import Diagnostic, Source, TreeError
from sar_compiler.tree.model import NO_SPANS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_LINE_AND_COLUMN = re.compile(r" \(at line (\d+), column (\d+)\)")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_STRING = re.compile(r'"""(?:\\.|[^\\])*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'', re.DOTALL)
# A value that is neither string, list nor table, to the end of its line.
_BARE_TEXT = re.compile(r"""\s*[\w.-]+\s*=\s*([^\s"'\[{#][^"'\[{#=]*?)\s*(?:#.*)?$""")
_BARE_KEY = re.compile(r"[\w-]+")
# At least one character, so that the scan always advances.
_BARE_VALUE = re.compile(r"[^,\]}#\r\n]*[^,\]}#\s]|.", re.DOTALL)

_KeyPath = tuple[int | str, ...]
_Offsets = tuple[int, int]


def read_toml(path: Path, shown: str) -> Document:
    """Read a TOML file. Findings about the file contain the path *shown*.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        TreeError: If the content is not TOML, not text, or too large.
    """
    file = read_file(path, SETTINGS)
    data = file.data
    source = (
        make_source(data, shown, NO_SPANS, None, "", SETTINGS)
        if data.strip()
        else Source(shown, "", NO_SPANS)
    )
    document = Document(source, file.real_path.parent)
    try:
        content = tomllib.loads(source.text)
        document.root = _value(content, (), _TomlLocations(source.text), (0, len(source.text)), document)
    except RecursionError:
        message = "lists and tables are nested too deeply"
        raise TreeError([Diagnostic("too-deep", message, source, source.span(0, 1))]) from None
    except ValueError as error:
        match = _LINE_AND_COLUMN.search(str(error))
        start = source.offset(int(match[1]), int(match[2])) if match else len(source.text.rstrip())
        message = f"not valid TOML: {_LINE_AND_COLUMN.sub('', str(error))}"
        bare = _BARE_TEXT.match(source.line(source.span(start, start).line))
        hint = f'write strings in quotes: "{bare[1]}"' if bare else None
        finding = Diagnostic("malformed-toml", message, source, source.span(start, start + 1), hint=hint)
        raise TreeError([finding]) from None
    return document


def _value(
    data: Any, path: _KeyPath, places: "_TomlLocations", around: _Offsets, document: Document
) -> Value:
    """Add a location to TOML data. If the location is unknown, use the location of the enclosing value."""
    document.count_value()
    start, end = place = places.values.get(path, around)
    if isinstance(data, dict):
        pairs = [(name, (*path, name), inner) for name, inner in data.items()]
        return Value.from_entries(
            start,
            end,
            (
                (
                    Value(*places.keys.get(at, place), name, text=name),
                    _value(inner, at, places, place, document),
                )
                for name, at, inner in pairs
            ),
        )
    if isinstance(data, list):
        return Value.from_items(
            start,
            end,
            (_value(item, (*path, index), places, place, document) for index, item in enumerate(data)),
        )
    plain = data if isinstance(data, (bool, int, float, str)) else None  # JSON has no dates
    return Value(start, end, plain, text=data if isinstance(data, str) else places.text_of(path, data))


class _TomlLocations:
    """The offsets of keys and values, by key path. No offsets are stored for arrays of tables (`[[name]]`)."""

    def __init__(self, text: str) -> None:
        self.keys: dict[_KeyPath, _Offsets] = {}
        self.values: dict[_KeyPath, _Offsets] = {}
        self._text = text
        self._at = 0
        table: _KeyPath = ()
        while self._skip() < len(text):
            if self._consume("["):
                listed = self._consume("[")
                table = self._key(())
                for _ in range(1 + listed):
                    self._consume("]")
            else:
                self._pair(table)

    def text_of(self, path: _KeyPath, data: object) -> str:
        """Return the source text of a value that is not a string, to distinguish `4.10` from `4.1`."""
        if path in self.values:
            return self._text[slice(*self.values[path])]
        return str(data).lower() if isinstance(data, bool) else str(data)

    def _skip_pattern(self, pattern: re.Pattern[str]) -> str:
        """Skip and return the text that matches a pattern here. Return an empty string if nothing matches."""
        match = pattern.match(self._text, self._at)
        self._at = match.end() if match else self._at
        return match[0] if match else ""

    def _skip(self) -> int:
        """Skip whitespace and comments, and return the start of the next token."""
        self._skip_pattern(_BLANK)
        return self._at

    def _consume(self, sign: str) -> bool:
        is_next = self._text.startswith(sign, self._skip())
        self._at += len(sign) if is_next else 0
        return is_next

    def _key(self, path: _KeyPath) -> _KeyPath:
        """Skip a key, with all its dotted parts, in the table at *path*. Return the path of the key."""
        while True:
            start = self._skip()
            quoted = self._skip_pattern(_STRING)
            path = (
                *path,
                tomllib.loads(f"key = {quoted}")["key"] if quoted else self._skip_pattern(_BARE_KEY),
            )
            self.keys.setdefault(path, (start, self._at))
            self.values.setdefault(path, (start, self._at))
            if not self._consume("."):
                return path

    def _pair(self, table: _KeyPath) -> None:
        path = self._key(table)
        self._consume("=")
        self._item(path)

    def _item(self, path: _KeyPath) -> None:
        start = self._skip()
        if self._consume("["):
            count = 0
            while not self._consume("]") and self._at < len(self._text):
                self._item((*path, count))
                self._consume(",")
                count += 1
        elif self._consume("{"):
            while not self._consume("}") and self._at < len(self._text):
                self._pair(path)
                self._consume(",")
        elif not self._skip_pattern(_STRING):
            self._skip_pattern(_BARE_VALUE)
        self.values[path] = (start, self._at)
