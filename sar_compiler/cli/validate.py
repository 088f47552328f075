"""`sar-compile validate`: report mistakes in tree files, and fix obvious ones."""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler import resources
from sar_compiler.budget import BudgetSpentError
from sar_compiler.cli.arguments import TREE_INPUT, add_budget, budget_of, seconds
from sar_compiler.cli.loading import (
    INPUT_HELP,
    add_mission,
    add_project_options,
    additions,
    further_checks,
    workspace,
)
from sar_compiler.commands import FINDINGS, OK, RULE_FAILED, USAGE, print_error, print_text, tell_note
from sar_compiler.errors import SarError
from sar_compiler.opener import STANDARD_INPUT, TREE, UnreadableFileError, is_file, is_folder, read_file
from sar_compiler.parts import is_here
from sar_compiler.terminal import findings_as_text
from sar_compiler.tree.content import bytes_of, real_path
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.gathering import find_tree, tree_files_in
from sar_compiler.tree.plain import count_text
from sar_compiler.tree.showing import visible

if TYPE_CHECKING:
    from sar_compiler.analysis.trying import TrialBudget
    from sar_compiler.budget import Budget
    from sar_compiler.checks.fixing import Fix
    from sar_compiler.project import ProjectTree, Workspace

_TEXT, _JSON, _SARIF, _ = FORMATS = ("text", "json", "sarif", "github")
_FAILED = "internal-error"
_FILES_TRIED = 10
"""For how many files there is work enough to try their runs to the end of what may be tried of one."""
_ROUNDS = 20
"""The largest number of passes: a fix may reveal another mistake."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `validate`."""
    more = f"{INPUT_HELP}; or a folder, for all tree files in it and below"
    add = parser.add_argument
    add("files", nargs="+", type=TREE_INPUT, metavar="FILE", help=more)
    add_project_options(parser)
    add_mission(parser)
    add("--strict", action="store_true", help="count warnings as errors in the exit status")
    trial = parser.add_mutually_exclusive_group()
    text = "try the runs of each file for SEC seconds, for errors that a tick raises (default: as far as a fixed amount of work goes)"
    trial.add_argument("--deep", type=seconds, metavar="SEC", help=text)
    trial.add_argument("--no-deep", action="store_true", help="try no runs for errors that a tick raises")
    add_budget(parser)
    add("--fix", action="store_true", help="first correct plain slips, in the files themselves")
    text = "print one file as its findings suggest to write it, also where they guess, instead of the findings; nothing is written"
    add("--mended", action="store_true", help=text)
    text = "in text and for GitHub, tell each place, instead of each cause once"
    add("--all", action="store_true", help=text)
    text = "for people (default text), for scripts, for code scanning (SARIF), or as annotations of GitHub Actions"
    add("--format", choices=FORMATS, default=_TEXT, help=text)
    parser.set_defaults(run=validate_files)


def validate_files(arguments: argparse.Namespace) -> int:
    """Print the findings about files, and return the exit status: 130 after Ctrl-C, with what was found until then."""
    if arguments.mended:
        return _print_mended(arguments)
    budget = budget_of(arguments, patience_sec=0.5)
    validation = _Validation(arguments, budget)
    if arguments.fix:
        validation.mend()
    with suppress(BudgetSpentError):
        budget.run(validation.look)
    validation.leave()
    validation.note_use()
    validation.print_findings()
    if validation.unchecked:
        print_error(f"sar-compile: {budget.reason} ({count_text(validation.unchecked, 'file')} not checked)")
        return budget.exit_status
    counted = (Severity.ERROR, Severity.WARNING) if arguments.strict else (Severity.ERROR,)
    if validation.unreadable:
        return USAGE
    if any(each.code == _FAILED for each in validation.findings):
        return RULE_FAILED
    return FINDINGS if any(each.severity in counted for each in validation.findings) else OK


def _print_mended(arguments: argparse.Namespace) -> int:
    """Print a file as its findings suggest to write it, and return the exit status: whether errors are left.

    Raises:
        SarError: If it is not one file, or cannot be read.
        TreeError: If the project's configuration, or a palette, has mistakes.
    """
    from sar_compiler.agent.mending import mend
    from sar_compiler.project import Workspace

    if len(arguments.files) > 1 or arguments.fix:
        raise SarError("--mended prints one file, and writes none: name one, and leave --fix out")
    path, added = find_tree(arguments.files[0]), additions(arguments)
    tree = mend(path, lambda read: Workspace(added, read, tell_note, further_checks()).load_file(path))
    print(tree.source.text, end="")
    return FINDINGS if any(each.severity is Severity.ERROR for each in tree.findings) else OK


class _Validation:
    """The check of files that are one set: a tree that one lacks is sought in the others.

    Args:
        arguments: The command's.
        budget: What the check may take.

    Attributes:
        findings: What was found, each finding once.
        unreadable: How often files and folders could not be read, checked or written.
    """

    def __init__(self, arguments: argparse.Namespace, budget: "Budget") -> None:
        self.arguments = arguments
        self._budget = budget
        self.findings: list[Diagnostic] = []
        self.unreadable = 0
        self._checked = self._done = 0
        self._is_left = self._is_cut = False
        self._clean: list[Path] = []
        self._said: set[object] = set()
        self._fixable = 0
        self._fixes: dict[object, Fix] = {}
        self._work = 0
        self._raising: set[object] = set()
        self._found_in_folders: set[Path] = set()
        self._folders: list[Path] = []
        # Of several links to a file, and of a file that is also in a folder, the first counts.
        files: dict[Path, Path] = {}
        for name in arguments.files:
            for path in self._find_files(name):
                files.setdefault(real_path(path), path)
        self._files = tuple(files.values())
        self._places = frozenset(files)
        self._workspace = self._new_workspace()

    def _find_files(self, name: str) -> Iterator[Path]:
        """Yield the files that an argument names."""
        try:
            files = tree_files_in(Path(name)) if name and is_folder(name) else []
            # A package of leaves can have the name of a shipped tree.
            if name and is_folder(name) and (files or not is_file(resources.find("trees", name, ".xml"))):
                if not files:
                    self._tell(f"there is no tree file in {name}")
                self._found_in_folders.update(files)
                self._folders.append(Path(name))
                yield from files
            else:
                yield find_tree(name)
        except UnreadableFileError as error:
            self._tell(str(error))

    def _tell(self, why: str) -> None:
        self.unreadable += 1
        if why not in self._said:
            self._said.add(why)
            print_error(f"sar-compile: {why}")

    def _new_workspace(self) -> "Workspace":
        # One file or folder by itself is no set: what is around it is found with its surroundings.
        trees = self._files if self.arguments.files[1:] else ()
        return workspace(self.arguments, trees=trees, names=self._files, folders=tuple(self._folders))

    def mend(self) -> None:
        """Apply all possible fixes to the files; what is wrong otherwise is found when they are looked at."""
        for path in self._files:
            if path != STANDARD_INPUT:
                self._guard(path, self._mend_file, "mending")
        self._workspace = self._new_workspace()

    def _mend_file(self, path: Path) -> None:
        for _ in range(_ROUNDS):
            try:
                tree = self._workspace.load_file(path)
                tree.project.findings  # noqa: B018 - where a palette is malformed, no file is looked at
            except (TreeError, UnreadableFileError):
                return
            if not self._apply_fixes(tree):
                return

    def look(self) -> None:
        """Check the files, each whatever becomes of the others."""
        for path in self._files:
            self._guard(path, self._check, "check")
            if self._is_cut:
                return
            self._done += 1
            if self._budget.is_spent():
                return

    @property
    def unchecked(self) -> int:
        """How many files were not checked to the end."""
        return len(self._files) - self._done

    def note_use(self) -> None:
        """Report which palettes and trees around the files were used."""
        self._workspace.note_use()

    def leave(self) -> None:
        """Keep the findings as they are, whatever a check that was left behind still finds."""
        self._is_left = True

    def _guard(self, path: Path, what: Callable[[Path], None], name: str) -> None:
        """Do something with a file; if that fails, there is something to say about the other files all the same."""
        try:
            what(path)
        except TreeError as error:
            self._report(error.findings)
        except SarError as error:
            self._tell(str(error))
        except Exception as error:  # noqa: BLE001 - whatever it is
            from sar_compiler.checks import failure_of_file

            self._report([failure_of_file(path, error, name)])

    def _check(self, path: Path) -> None:
        try:
            tree = self._workspace.load_file(path)
        except TreeError:
            self._checked += 1
            raise
        self._checked += 1
        # A palette that is among the files is spoken of as such.
        palettes = tree.project.findings
        self._report(each for each in palettes if real_path(Path(each.source.path)) not in self._places)
        found = tree.findings
        self._report(found)
        further = [each for check in further_checks() for each in check(tree)]
        found = [*found, *further, *self._try_runs(tree)]
        self._report(found)
        self._note_fixes(tree)
        if self.arguments.format == _TEXT and not found and path not in self._found_in_folders:
            self._clean.append(path)

    def _try_runs(self, tree: "ProjectTree") -> list[Diagnostic]:
        """Return what a tick of some run of a file raises, as far as runs are tried."""
        deep = self.arguments.deep
        if self.arguments.no_deep or not is_here("analysis"):
            return []
        from sar_compiler.analysis.trial import try_tree

        budgets: list[TrialBudget] = []

        def budget() -> "TrialBudget":
            from sar_compiler.analysis.trying import WORK, TrialBudget

            left = WORK * _FILES_TRIED - self._work
            work = min(WORK, left) if deep is None else None
            budgets.append(TrialBudget(work, deep, self._budget.is_spent))
            return budgets[0]

        found = try_tree(tree, budget)
        self._work += sum(each.spent for each in budgets)
        self._is_cut = any(each.is_cut for each in budgets)
        # A tree of a file that others include is tried in each of them.
        new = [each for each in found if (each.source.path, each.span) not in self._raising]
        self._raising.update((each.source.path, each.span) for each in new)
        return new

    def _report(self, findings: Iterable[Diagnostic]) -> None:
        """Report findings, each once: a file may be included by several, or have trees that several use."""
        new = []
        for finding in findings:
            if finding.identity not in self._said:
                self._said.add(finding.identity)
                new.append(finding)
        if not self._is_left:
            self.findings += new

    def _note_fixes(self, tree: "ProjectTree") -> None:
        """Keep how the findings of a file can be fixed, where the form tells it."""
        form = self.arguments.format
        if form in (_TEXT, _SARIF) and any(each.suggestion is not None for each in tree.findings):
            from sar_compiler.checks.fixing import each_fix, fixes

            file = tree.source, tree.tree_file, tree.findings
            self._fixable += len(fixes(*file))
            self._fixes.update((fix.finding.identity, fix) for fix in each_fix(*file))

    @property
    def _findings_to_tell(self) -> Sequence[Diagnostic]:
        """The findings as people are told them."""
        if self.arguments.all or len(self.findings) <= 1:
            return self.findings
        from sar_compiler.views.findings import by_cause

        return by_cause(self.findings)

    def _sum_up(self, told: Sequence[Diagnostic]) -> None:
        """Print on standard error how much was found, unless there was only one file without findings."""
        if not told and self._checked <= 1:
            return
        counts = Counter(finding.severity.value for finding in told if finding.code != "more-findings")
        listed = [count_text(counts[each], each) for each in ("error", "warning", "info") if counts[each]]
        if any(each.code == "more-findings" for each in self.findings):
            listed.append("more that are not shown")
        fixable = f"; {self._fixable:,} fixable with --fix" if self._fixable else ""
        found = ", ".join(listed) or "no findings"
        more = len(self.findings) - len(told)
        places = f"; --all tells {count_text(len(self.findings), 'place')}" if more else ""
        sys.stdout.flush()
        print(f"{found} in {count_text(self._checked, 'file')}{fixable}{places}", file=sys.stderr)

    def print_findings(self) -> None:
        """Print what was found."""
        form = self.arguments.format
        if form == _TEXT:
            told = self._findings_to_tell
            if told:
                print(findings_as_text(told, sys.stdout))
            for path in self._clean:
                print_text(f"{path}: no findings")
            self._sum_up(told)
            return
        from sar_compiler.views import findings as views

        if form == _JSON:
            print(views.findings_as_json(self.findings))
        elif form == _SARIF:
            print(views.findings_as_sarif(self.findings, self._fixes))
        elif self.findings:
            print(views.findings_as_github(self._findings_to_tell))

    def _apply_fixes(self, tree: "ProjectTree") -> bool:
        """Apply all possible fixes to a file; return whether there were any."""
        from sar_compiler.checks.fixing import fixes

        chosen = fixes(tree.source, tree.tree_file, tree.findings)
        if chosen:
            _write(tree, chosen)
        output = sys.stdout if self.arguments.format == _TEXT else sys.stderr
        for fix in chosen:
            print(visible(fix.describe()), file=output)
        return bool(chosen)


def _write(tree: "ProjectTree", chosen: "Sequence[Fix]") -> None:
    """Apply fixes to a file; all other bytes are unchanged."""
    from sar_compiler.checks.fixing import apply_fixes
    from sar_compiler.writing import WriteError, write_bytes

    path, source = tree.path, tree.source
    if bytes_of(source, source.text) != read_file(path, TREE).data:
        raise WriteError(f"{path} is not mended: it has changed meanwhile, or its encoding has no way back")
    write_bytes(path, bytes_of(source, apply_fixes(source.text, chosen)))
