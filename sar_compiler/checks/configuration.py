"""What a project decides for all its trees, in `sar.toml` or under `[tool.sar]` in `pyproject.toml`.

The file is looked for from a tree file's folder upwards; the nearest counts, and it alone.
"""

import dataclasses
import functools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.tree.content import read_bytes
from sar_compiler.tree.diagnostic import Diagnostic, Severity

if TYPE_CHECKING:
    from sar_compiler.documents.located import Value

OWN_FILE = "sar.toml"
SHARED_FILE = "pyproject.toml"
_SHARED_TABLE = ("tool", "sar")
_OFF = "off"
# A file in which this word never stands by itself has no such table, and need not be understood.
_OWN_WORD = re.compile(rb"(?<![\w-])sar(?![\w-])")


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
        return _decided(own, ()) or NOTHING_DECIDED
    if shared.is_file() and _OWN_WORD.search(read_bytes(shared)):
        found = _decided(shared, _SHARED_TABLE)
        if found is not None:
            return found
    return NOTHING_DECIDED if folder == folder.parent else _of_folder(folder.parent)


def _decided(path: Path, table: tuple[str, ...]) -> Configuration | None:
    """Return what a table of a file decides; None if the file has none.

    Raises:
        TreeError: If it has mistakes; carries all findings.
        UnreadableFileError: If the file cannot be read.
    """
    from sar_compiler.documents.toml_files import read_toml

    document = read_toml(path, _as_written(path))
    found: Value | None = document.root
    for key in table:
        found = found.mapping.get(key) if found else None
    if found is None or not found.data:
        return None
    folder = path.parent
    said = document.hold("settings", found).data
    document.raise_findings()
    return Configuration(
        tuple(said.get("nodes", ())),
        tuple(folder / text for text in said.get("models", ())),
        tuple(folder / text for text in said.get("include-path", ())),
        {
            code: None if level == _OFF else Severity(level)
            for code, level in said.get("findings", {}).items()
        },
    )


def _as_written(path: Path) -> str:
    """Return a path as a user would write it: relative to where the command was started, if it lies there."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
