"""What a project decides for all its trees, in `sar.toml` or under `[tool.sar]` in `pyproject.toml`.

The file is looked for from a tree file's folder upwards; the nearest counts, and it alone.
"""

import dataclasses
import functools
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sar_compiler.checks.kinds import KINDS, is_firm
from sar_compiler.nodes.values import nearest
from sar_compiler.tree.content import read_bytes
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError, UnreadableFileError
from sar_compiler.tree.source import Source
from sar_compiler.tree.synthetic import NO_SPANS

OWN_FILE = "sar.toml"
SHARED_FILE = "pyproject.toml"
_SHARED_TABLE = ("tool", "sar")
_NODES, _MODELS, _INCLUDE_PATH, _FINDINGS = "nodes", "models", "include-path", "findings"
_SETTINGS = (_NODES, _MODELS, _INCLUDE_PATH, _FINDINGS)
_OFF = "off"
_LEVELS = (_OFF, *(each.value for each in Severity))
# A file in which this word never stands by itself has no such table, and need not be understood.
_OWN_WORD = re.compile(rb"(?<![\w-])sar(?![\w-])")
_LINE_AND_COLUMN = re.compile(r" \(at line (\d+), column (\d+)\)")


@dataclass(frozen=True)
class Configuration:
    """What a project decides.

    Attributes:
        nodes: Modules of leaves, as `--nodes` names them.
        models: Palettes, as `--model` names them.
        include_path: Further folders that may be included from.
        severities: How bad some kinds of findings are, by their code; None where they are not to be reported.
    """

    nodes: tuple[str, ...] = ()
    models: tuple[Path, ...] = ()
    include_path: tuple[Path, ...] = ()
    severities: Mapping[str, Severity | None] = field(default_factory=dict)

    def decide(self, findings: Iterable[Diagnostic]) -> list[Diagnostic]:
        """Return findings with the severities that are decided on, without those that are not to be reported."""
        decided = []
        for finding in findings:
            severity = self.severities.get(finding.code, finding.severity)
            if severity is finding.severity or finding.severity is Severity.ERROR:
                decided.append(finding)
            elif severity is not None:
                decided.append(dataclasses.replace(finding, severity=severity))
        return decided


NOTHING_DECIDED = Configuration()


def configuration_for(tree_file: Path) -> Configuration:
    """Return what counts for a tree file; where there is no configuration, nothing is decided.

    Raises:
        TreeError: If the configuration that counts has mistakes.
        UnreadableFileError: If it cannot be read.
    """
    return _of_folder(tree_file.resolve().parent)


@functools.cache
def _of_folder(folder: Path) -> Configuration:
    own, shared = folder / OWN_FILE, folder / SHARED_FILE
    if own.is_file():
        return _SettingsReader(own, ()).read()
    if shared.is_file() and _OWN_WORD.search(read_bytes(shared)):
        reader = _SettingsReader(shared, _SHARED_TABLE)
        if reader.is_there:
            return reader.read()
    return NOTHING_DECIDED if folder == folder.parent else _of_folder(folder.parent)


class _SettingsReader:
    """Understands one file; goes on behind what is wrong, so that everything is found.

    Args:
        path: The file.
        table: The keys of the table that is the configuration.
    """

    def __init__(self, path: Path, table: tuple[str, ...]) -> None:
        self._folder = path.parent
        self._table = table
        self._findings: list[Diagnostic] = []
        self._source, content = _content(path)
        for key in table:
            content = content.get(key, {}) if isinstance(content, dict) else {}
        self._content = content
        self.is_there = bool(content)

    def read(self) -> Configuration:
        content = self._content
        if not isinstance(content, dict):
            self._report("wrong-setting", f"'{'.'.join(self._table)}' is a table", ())
            raise TreeError(self._findings)
        for name in content:
            if name not in _SETTINGS:
                message = f"there is no setting '{name}'; there are {', '.join(_SETTINGS)}"
                self._report("unknown-setting", message, (name,), nearest(name, _SETTINGS))
        configuration = Configuration(
            tuple(self._texts(_NODES)),
            tuple(self._folder / text for text in self._texts(_MODELS)),
            tuple(self._folder / text for text in self._texts(_INCLUDE_PATH)),
            self._severities(content.get(_FINDINGS, {})),
        )
        if self._findings:
            raise TreeError(self._findings)
        return configuration

    def _texts(self, name: str) -> list[str]:
        written = self._content.get(name, [])
        if isinstance(written, list) and all(isinstance(text, str) for text in written):
            return written
        self._report("wrong-setting", f'{name} is a list of texts: {name} = ["..."]', (name,))
        return []

    def _severities(self, written: object) -> dict[str, Severity | None]:
        if not isinstance(written, dict):
            self._report("wrong-setting", f'{_FINDINGS} is a table: some-code = "off"', (_FINDINGS,))
            return {}
        decided: dict[str, Severity | None] = {}
        for code, level in written.items():
            place = (_FINDINGS, code)
            if code not in KINDS:
                self._report("unknown-setting", f"no finding is called '{code}'", place, nearest(code, KINDS))
            elif not isinstance(level, str) or level not in _LEVELS:
                message = f"{code} is one of {', '.join(_LEVELS)}, and this is {level!r}"
                near = nearest(level, _LEVELS) if isinstance(level, str) else None
                self._report("wrong-setting", message, (*place, str(level)), near)
            elif is_firm(code) and level != Severity.ERROR.value:
                message = f"{code} stays an error: a tree with it cannot be run"
                self._report("wrong-setting", message, place, hint="delete the line")
            else:
                decided[code] = None if level == _OFF else Severity(level)
        return decided

    def _report(
        self,
        code: str,
        message: str,
        words: tuple[str, ...],
        suggestion: str | None = None,
        hint: str | None = None,
    ) -> None:
        """Note a finding at the last of some words that follow each other in the file."""
        start = end = 0
        for word in (*self._table, *words):
            match = re.compile(rf"(?<![\w-]){re.escape(word)}(?![\w-])").search(self._source.text, end)
            start, end = match.span() if match else (start, end)
        span = self._source.span(start, end)
        self._findings.append(Diagnostic(code, message, self._source, span, suggestion, hint))


def _content(path: Path) -> tuple[Source, Any]:
    """Return a file as text and as what it says."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    data = read_bytes(path)
    source = Source(_as_written(path), data.decode("utf-8", "replace"), NO_SPANS)
    try:
        return source, tomllib.loads(data.decode())
    except UnicodeDecodeError as error:
        message = f"cannot read {path}: it is not UTF-8 ({error})"
        raise UnreadableFileError(message) from error
    except tomllib.TOMLDecodeError as error:
        match = _LINE_AND_COLUMN.search(str(error))
        start = source.offset(int(match[1]), int(match[2])) if match else len(source.text.rstrip())
        message = f"not TOML: {_LINE_AND_COLUMN.sub('', str(error))}"
        raise TreeError(
            [Diagnostic("malformed-toml", message, source, source.span(start, start + 1))]
        ) from None


def _as_written(path: Path) -> str:
    """Return a path as a user would write it: relative to where the command was started, if it lies there."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
