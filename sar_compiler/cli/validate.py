"""`sar-compile validate`: say what is wrong with tree files, and mend what is plainly a slip."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import FINDINGS, OK, USAGE
from sar_compiler.cli.loading import FILE_HELP, add_include_path, add_model
from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from sar_compiler.checks.configuration import Configuration
    from sar_compiler.checks.fixing import Fix
    from sar_compiler.nodes.registry import Registry
    from sar_compiler.tree.diagnostic import Diagnostic
    from sar_compiler.tree.model import TreeFile
    from sar_compiler.tree.source import Source

_TEXT, _JSON, _SARIF, _GITHUB = FORMATS = ("text", "json", "sarif", "github")
_ROUNDS = 20
"""What is mended may bring another slip to light, but not so often."""


class PaletteError(SarError):
    """A palette is not there or cannot be read, so that nothing can be said of the files."""


def add_validate(parser: argparse.ArgumentParser) -> None:
    """Add what `validate` takes."""
    parser.add_argument("files", nargs="+", metavar="FILE", help=FILE_HELP)
    add_model(parser)
    add_include_path(parser)
    parser.add_argument("--strict", action="store_true", help="count warnings as errors")
    parser.add_argument(
        "--fix", action="store_true", help="first mend, in the files, what can be nothing but a slip"
    )
    parser.add_argument(
        "--format",
        choices=FORMATS,
        default=_TEXT,
        help="for people, for scripts, for code scanning, or as annotations of GitHub Actions",
    )
    parser.set_defaults(run=validate_files)


def validate_files(arguments: argparse.Namespace) -> int:
    """Print what is wrong with files, and return the exit status.

    Raises:
        PaletteError: If a palette cannot be read.
        WriteError: If a file that is to be mended cannot be written.
    """
    from sar_compiler.tree.diagnostic import Severity

    validation = _Validation(arguments)
    for name in arguments.files:
        validation.look_at(name)
    validation.print_for_tools()
    counted = (Severity.ERROR, Severity.WARNING) if arguments.strict else (Severity.ERROR,)
    if validation.unreadable:
        return USAGE
    return FINDINGS if any(each.severity in counted for each in validation.findings) else OK


@dataclass(frozen=True)
class _Setting:
    """What files of one configuration are looked at with.

    Attributes:
        configuration: What the project decides.
        registry: What tags mean.
        palettes: What describes nodes that are not installed.
        include_path: Further folders that may be included from.
    """

    configuration: "Configuration"
    registry: "Registry"
    palettes: "tuple[TreeFile, ...]"
    include_path: tuple[Path, ...]


@dataclass(frozen=True)
class _Looked:
    """What was seen in a file; the file itself is None if it could not be understood."""

    source: "Source"
    tree_file: "TreeFile | None"
    findings: "list[Diagnostic]"


@dataclass
class _Validation:
    arguments: argparse.Namespace
    findings: "list[Diagnostic]" = field(default_factory=list)
    # By the configuration's identity: it is read once.
    settings: "dict[int, _Setting | None]" = field(default_factory=dict)
    said: set[str] = field(default_factory=set)
    unreadable: int = 0

    def look_at(self, name: str) -> None:
        """Find what is wrong with a file, after mending it if that is wanted."""
        from sar_compiler.tree.diagnostic import UnreadableFileError
        from sar_compiler.tree.shipped import find_tree

        try:
            path = find_tree(name)
            setting = self._setting_of(path)
            found = self._found_in(path, setting) if setting is not None else None
        except UnreadableFileError as error:
            self.unreadable += 1
            print(f"sar-compile: {error}", file=sys.stderr)
            return
        if found is None:
            return
        self.findings += found
        if self.arguments.format == _TEXT:
            print("\n".join([finding.render() for finding in found] or [f"{name}: no findings"]))

    def _found_in(self, path: Path, setting: _Setting) -> "list[Diagnostic]":
        looked = _look(path, setting)
        for _ in range(_ROUNDS if self.arguments.fix else 0):
            if not self._mended(path, looked):
                break
            looked = _look(path, setting)
        return looked.findings

    def print_for_tools(self) -> None:
        """Print everything at once, in the forms that are not for people."""
        form = self.arguments.format
        if form == _JSON:
            from sar_compiler.views.findings import findings_as_json

            print(findings_as_json(self.findings))
        elif form == _SARIF:
            from sar_compiler.views.sarif import findings_as_sarif

            print(findings_as_sarif(self.findings))
        elif form == _GITHUB and self.findings:
            from sar_compiler.views.github import findings_as_github

            print(findings_as_github(self.findings))

    def _setting_of(self, path: Path) -> _Setting | None:
        """Return what a file is looked at with; None, after findings, where that cannot be understood."""
        from sar_compiler.checks.configuration import configuration_for
        from sar_compiler.tree.diagnostic import TreeError

        try:
            configuration = configuration_for(path)
        except TreeError as error:
            self._report_once(error.findings)
            return None
        if id(configuration) not in self.settings:
            self.settings[id(configuration)] = self._new_setting(configuration)
        return self.settings[id(configuration)]

    def _new_setting(self, configuration: "Configuration") -> _Setting | None:
        from sar_compiler.checks import check_palettes
        from sar_compiler.nodes.registry import load_registry
        from sar_compiler.tree.diagnostic import TreeError, UnreadableFileError
        from sar_compiler.tree.reading import read_tree_file

        registry = load_registry([*self.arguments.nodes, *configuration.nodes])
        include_path = (*self.arguments.include_path, *configuration.include_path)
        try:
            palettes = tuple(read_tree_file(path) for path in (*self.arguments.model, *configuration.models))
        except UnreadableFileError as error:
            raise PaletteError(str(error)) from error
        except TreeError as error:
            self._report_once(error.findings)
            return None
        self._report_once(configuration.decide(check_palettes(palettes, registry)))
        return _Setting(configuration, registry, palettes, include_path)

    def _report_once(self, findings: "Sequence[Diagnostic]") -> None:
        """Report what is wrong with a file that several tree files are looked at with."""
        for finding in findings:
            text = finding.render()
            if text not in self.said:
                self.said.add(text)
                self.findings.append(finding)
                if self.arguments.format == _TEXT:
                    print(text)

    def _mended(self, path: Path, looked: _Looked) -> bool:
        """Mend what can be mended in a file; return whether there was anything."""
        from sar_compiler.checks.fixing import fixes

        chosen = fixes(looked.source, looked.tree_file, looked.findings)
        if chosen:
            _write(path, looked.source, chosen)
        output = sys.stdout if self.arguments.format == _TEXT else sys.stderr
        for fix in chosen:
            print(fix.describe(), file=output)
        return bool(chosen)


def _look(path: Path, setting: _Setting) -> _Looked:
    from sar_compiler.checks import check
    from sar_compiler.tree.diagnostic import TreeError
    from sar_compiler.tree.forest import load_forest
    from sar_compiler.tree.reading import read_tree_file

    try:
        forest = load_forest(path, read_tree_file, setting.include_path)
    except TreeError as error:
        return _Looked(error.findings[0].source, None, list(error.findings))
    findings = setting.configuration.decide(check(forest, setting.registry, setting.palettes))
    return _Looked(forest.main.source, forest.main, findings)


def _write(path: Path, source: "Source", chosen: "Sequence[Fix]") -> None:
    """Put fixes into a file; every byte elsewhere stays as it is."""
    from sar_compiler.checks.fixing import fixed
    from sar_compiler.cli.writing import WriteError, write_bytes
    from sar_compiler.tree.content import bytes_of, read_bytes

    if bytes_of(source, source.text) != read_bytes(path):
        message = f"{path} is not mended: it has changed meanwhile, or its encoding has no way back"
        raise WriteError(message)
    write_bytes(path, bytes_of(source, fixed(source.text, chosen)))
