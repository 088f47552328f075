"""`sar-compile validate`: report mistakes in tree files, and fix obvious ones."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import FINDINGS, OK, USAGE
from sar_compiler.cli.loading import FILE_HELP, add_project_options, workspace

if TYPE_CHECKING:
    from sar_compiler.checks.fixing import Fix
    from sar_compiler.project import LoadedTree, Workspace
    from sar_compiler.tree.diagnostic import Diagnostic

_TEXT, _JSON, _SARIF, _GITHUB = FORMATS = ("text", "json", "sarif", "github")
_ROUNDS = 20
"""The largest number of passes: a fix may reveal another mistake."""


def add_validate(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `validate`."""
    parser.add_argument("files", nargs="+", metavar="FILE", help=FILE_HELP)
    add_project_options(parser)
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
    """Print the findings about files, and return the exit status.

    Raises:
        UnreadableFileError: If a palette cannot be read, so that the files cannot be checked.
        WriteError: If a fixed file cannot be written.
    """
    from sar_compiler.tree.diagnostic import Severity

    validation = _Validation(arguments, workspace(arguments))
    for name in arguments.files:
        validation.look_at(name)
    validation.print_for_tools()
    counted = (Severity.ERROR, Severity.WARNING) if arguments.strict else (Severity.ERROR,)
    if validation.unreadable:
        return USAGE
    return FINDINGS if any(each.severity in counted for each in validation.findings) else OK


class _Validation:
    def __init__(self, arguments: argparse.Namespace, workspace: "Workspace") -> None:
        self.arguments = arguments
        self.workspace = workspace
        self.findings: list[Diagnostic] = []
        self.said: set[str] = set()
        self.unreadable = 0
        self.files = set(map(_resolved, arguments.files))

    def look_at(self, name: str) -> None:
        """Check a file, after fixing it if requested."""
        from sar_compiler.tree.diagnostic import TreeError, UnreadableFileError

        try:
            tree = self.workspace.load(name)
        except UnreadableFileError as error:
            self.unreadable += 1
            print(f"sar-compile: {error}", file=sys.stderr)
            return
        except TreeError as error:
            self._report_once(error.findings)
            return
        try:
            # A palette that is among the files is spoken of as such.
            palettes = tree.project.findings
            self._report_once([each for each in palettes if _resolved(each.source.path) not in self.files])
        except TreeError as error:
            self._report_once(error.findings)
            return
        for _ in range(_ROUNDS if self.arguments.fix else 0):
            if not self._mended(tree):
                break
            tree = self.workspace.load(name)
        self.findings += tree.findings
        if self.arguments.format == _TEXT:
            print("\n".join([finding.render() for finding in tree.findings] or [f"{name}: no findings"]))

    def print_for_tools(self) -> None:
        """Print everything at once, in the machine-readable formats."""
        form = self.arguments.format
        if form == _JSON:
            from sar_compiler.views.findings import findings_as_json

            print(findings_as_json(self.findings))
        elif form == _SARIF:
            from sar_compiler.views.sarif import findings_as_sarif

            print(findings_as_sarif(self.findings))
        elif form == _GITHUB and self.findings:
            from sar_compiler.views.findings import findings_as_github

            print(findings_as_github(self.findings))

    def _report_once(self, findings: "Sequence[Diagnostic]") -> None:
        """Report the findings about a file that is shared by several tree files."""
        for finding in findings:
            text = finding.render()
            if text not in self.said:
                self.said.add(text)
                self.findings.append(finding)
                if self.arguments.format == _TEXT:
                    print(text)

    def _mended(self, tree: "LoadedTree") -> bool:
        """Apply all possible fixes to a file; return whether there were any."""
        from sar_compiler.checks.fixing import fixes

        chosen = fixes(tree.source, tree.tree_file, tree.findings)
        if chosen:
            _write(tree, chosen)
        output = sys.stdout if self.arguments.format == _TEXT else sys.stderr
        for fix in chosen:
            print(fix.describe(), file=output)
        return bool(chosen)


def _resolved(path: str) -> Path:
    return Path(path).resolve()


def _write(tree: "LoadedTree", chosen: "Sequence[Fix]") -> None:
    """Apply fixes to a file; all other bytes are unchanged."""
    from sar_compiler.checks.fixing import fixed
    from sar_compiler.cli.writing import WriteError, write_bytes
    from sar_compiler.tree.content import bytes_of, read_bytes

    path, source = tree.path, tree.source
    if bytes_of(source, source.text) != read_bytes(path):
        message = f"{path} is not mended: it has changed meanwhile, or its encoding has no way back"
        raise WriteError(message)
    write_bytes(path, bytes_of(source, fixed(source.text, chosen)))
