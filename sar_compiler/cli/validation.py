"""The work of `sar-compile validate`, in a module of its own because its imports are slow and a missing file is reported without them."""

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler import resources
from sar_compiler.budget import BudgetSpentError
from sar_compiler.cli.arguments import budget_of
from sar_compiler.cli.loading import (
    additions,
    collection_saved,
    further_checks,
    require_there,
    workspace,
)
from sar_compiler.commands import (
    FINDINGS,
    LIMITS_VARIABLE,
    OK,
    RULE_FAILED,
    USAGE,
    print_error,
    print_text,
    tell_note,
)
from sar_compiler.errors import SarError
from sar_compiler.opener import STANDARD_INPUT, TREE, UnreadableFileError, is_file, is_folder, read_file
from sar_compiler.parts import is_here
from sar_compiler.terminal import findings_as_text
from sar_compiler.tree.content import bytes_of, real_path
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.discovery import find_tree, tree_files_in
from sar_compiler.tree.plain import count_text
from sar_compiler.tree.showing import visible

if TYPE_CHECKING:
    from sar_compiler.checks.fixing import Fix
    from sar_compiler.project import CommandLineSettings, ProjectTree
    from sar_compiler.project.check_cache import CheckCache
    from sar_compiler.project.check_run import CheckRun
    from sar_compiler.project.file_check import FileCheck, TrialOutcome
    from sar_compiler.project.file_checker import FileChecker

_TEXT, _JSON, _SARIF = "text", "json", "sarif"
_FAILED = "internal-error"
_ROUNDS = 20
"""Largest number of passes: a fix may reveal another error."""


def validate_files(arguments: argparse.Namespace) -> int:
    """Print the findings about files, and return the exit status: 130 after Ctrl-C, with the findings so far."""
    if arguments.print_fixed:
        return _print_fixed(arguments)
    validation = _Validation(arguments)
    if arguments.fix:
        validation.mend()
    validation.check()
    validation.print_findings()
    if validation.unchecked:
        budget = validation.budget
        print_error(f"sar-compile: {budget.reason} ({count_text(validation.unchecked, 'file')} not checked)")
        return budget.exit_status
    counted = (Severity.ERROR, Severity.WARNING) if arguments.strict else (Severity.ERROR,)
    if validation.unreadable:
        return USAGE
    if any(each.code == _FAILED for each in validation.findings):
        return RULE_FAILED
    return FINDINGS if any(each.severity in counted for each in validation.findings) else OK


def _print_fixed(arguments: argparse.Namespace) -> int:
    """Print a file with all suggestions applied, and return the exit status: whether errors are left.

    Raises:
        SarError: If the argument is not a single file, or cannot be read.
        TreeError: If the project's configuration, or a palette, has errors.
    """
    from sar_compiler.agent.mending import mend
    from sar_compiler.project import Workspace

    if len(arguments.files) > 1 or arguments.fix:
        raise SarError("--print-fixed prints a single file: name one file, and remove --fix")
    path, added = find_tree(arguments.files[0]), additions(arguments)
    tree = mend(path, lambda read: Workspace(added, read, tell_note, further_checks()).load_file(path))
    print(tree.source.text, end="")
    return FINDINGS if any(each.severity is Severity.ERROR for each in tree.findings) else OK


class _Validation:
    """The check of files as one set: trees missing in one file are searched in the others.

    Args:
        arguments: The command's arguments.

    Attributes:
        budget: The budget of the check.
        findings: The findings, each once.
        unreadable: Number of files and folders that could not be read, checked or written.
    """

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments
        self._run: CheckRun | None = None
        self.budget = budget_of(arguments, patience_sec=0.5, clock=self._processor_sec)
        self.findings: list[Diagnostic] = []
        self.unreadable = 0
        self._checked = self._done = 0
        self._is_left = False
        self._clean: list[Path] = []
        self._said: set[object] = set()
        self._fixable = 0
        self._fixes: dict[object, Fix] = {}
        self._raising: set[object] = set()
        self._used: tuple[dict[Path, None], dict[Path, None]] = {}, {}
        self._found_in_folders: set[Path] = set()
        self._folders: list[Path] = []
        # Of several links to a file, or a file listed again in a folder, the first one is used.
        files: dict[Path, Path] = {}
        for name in arguments.files:
            for path in self._find_files(name):
                files.setdefault(real_path(path), path)
        self._files = tuple(files.values())
        self._places = frozenset(files)

    def _processor_sec(self) -> float:
        """Return the processor time of this process and its copies."""
        return time.process_time() + (0.0 if self._run is None else self._run.others_sec)

    def _find_files(self, name: str) -> Iterator[Path]:
        """Yield the files of an argument."""
        try:
            files = tree_files_in(Path(name)) if name and is_folder(name) else []
            # A package of leaves can have the name of a shipped tree.
            if name and is_folder(name) and (files or not is_file(resources.find("trees", name, ".xml"))):
                if not files:
                    self._tell(f"{name} has no tree file")
                self._found_in_folders.update(files)
                self._folders.append(Path(name))
                yield from files
            else:
                require_there(name)
                yield find_tree(name)
        except UnreadableFileError as error:
            self._tell(str(error))

    def _tell(self, why: str) -> None:
        self.unreadable += 1
        if why not in self._said:
            self._said.add(why)
            print_error(f"sar-compile: {why}")

    @property
    def _additions(self) -> "CommandLineSettings":
        # A single file or folder is no set: its surroundings are searched instead.
        trees = self._files if self.arguments.files[1:] else ()
        added = additions(self.arguments)
        return added._replace(trees=trees, names=self._files, folders=tuple(self._folders))

    def mend(self) -> None:
        """Apply all possible fixes to the files; other errors are found by the check."""
        self._workspace = workspace(self.arguments, **self._additions._asdict())
        for path in self._files:
            if path != STANDARD_INPUT:
                self._guard(path)

    def _fix_file(self, path: Path) -> None:
        for _ in range(_ROUNDS):
            try:
                tree = self._workspace.load_file(path)
                tree.project.findings  # noqa: B018 - with a malformed palette, no file is checked
            except (TreeError, UnreadableFileError):
                return
            if not self._apply_fixes(tree):
                return

    def check(self) -> None:
        """Check the files within the budget."""
        from sar_compiler.project.check_run import CheckRun

        arguments, is_tried = self.arguments, not self.arguments.no_deep and is_here("analysis")
        work: int | None = 0
        if is_tried:
            from sar_compiler.analysis.trial_work import work_for

            work = work_for(len(self._files)) if arguments.deep is None else None

        def try_runs(tree: "ProjectTree") -> "TrialOutcome":
            from sar_compiler.project.file_check import TrialOutcome

            if not is_tried:
                return TrialOutcome()
            from sar_compiler.analysis.trial import try_within

            return try_within(tree, work, arguments.deep, self.budget.is_spent)

        def make_checker() -> "FileChecker":
            with collection_saved():
                from sar_compiler.project.file_checker import FileChecker
            return FileChecker(self._additions, further_checks(), try_runs)

        run = self._run = CheckRun(self._files, make_checker, self._cache(is_tried), work, self.budget)
        run.make_copies(arguments.max_seconds)
        try:
            with suppress(BudgetSpentError):
                self.budget.run(lambda: self._receive_checks(run))
        finally:
            # Findings of an abandoned check are ignored.
            self._is_left = True
            run.end()
        if any(self._used):
            from sar_compiler.project.workspace import notes_on_use

            for text in notes_on_use(*self._used):
                tell_note(text)

    def _cache(self, is_tried: bool) -> "CheckCache | None":
        arguments = self.arguments
        if arguments.no_cache or arguments.trust or LIMITS_VARIABLE in os.environ:
            return None
        from sar_compiler.project.check_cache import CheckCache

        return CheckCache.of(self._additions, [is_tried, arguments.deep])

    def _receive_checks(self, run: "CheckRun") -> None:
        for path, check in run.results():
            self._receive(path, check)
            if check.is_cut:
                return
            self._done += 1
            if self.budget.is_spent():
                return

    @property
    def unchecked(self) -> int:
        """Number of files that were not checked completely."""
        return len(self._files) - self._done

    def _guard(self, path: Path) -> None:
        """Fix a file; an error must not prevent findings about the other files."""
        try:
            self._fix_file(path)
        except TreeError as error:
            self._report(error.findings)
        except SarError as error:
            self._tell(str(error))
        except Exception as error:  # noqa: BLE001 - any error
            from sar_compiler.checks import failure_of_file

            self._report([failure_of_file(path, error, "mending")])

    def _receive(self, path: Path, check: "FileCheck") -> None:
        """Report the result of the check of a file."""
        if self._is_left:
            return
        for text in check.notes:
            if text not in self._said:
                self._said.add(text)
                tell_note(text)
        self._checked += check.is_read
        # A palette among the files is reported under its name as written.
        self._report(each for each in check.palettes if real_path(Path(each.source.path)) not in self._places)
        # A tree of an included file is tried in each of the including files.
        raised = [each for each in check.raised if (each.source.path, each.span) not in self._raising]
        self._raising.update((each.source.path, each.span) for each in raised)
        self._report([*check.findings, *check.further, *raised])
        if check.problem:
            self._tell(check.problem)
        self._fixable += check.fixable
        if self.arguments.format == _SARIF and check.fixes:
            from sar_compiler.checks.fixing import Fix

            for number, start, end, text in check.fixes:
                finding = check.findings[number]
                self._fixes[finding.identity] = Fix(finding, start, end, text)
        for used, new in zip(self._used, (check.used_palettes, check.used_trees), strict=True):
            used.update(dict.fromkeys(map(Path, new)))
        is_clean = check.is_whole and not (check.findings or check.further or raised)
        if self.arguments.format == _TEXT and is_clean and path not in self._found_in_folders:
            self._clean.append(path)

    def _report(self, findings: Iterable[Diagnostic]) -> None:
        """Report findings, each once: several files may include a file, and several trees may use a tree."""
        new = []
        for finding in findings:
            if finding.identity not in self._said:
                self._said.add(finding.identity)
                new.append(finding)
        if not self._is_left:
            self.findings += new

    @property
    def _findings_to_tell(self) -> Sequence[Diagnostic]:
        """The findings in the form of the text output."""
        if self.arguments.all or len(self.findings) <= 1:
            return self.findings
        from sar_compiler.views.findings import by_cause

        return by_cause(self.findings)

    def _sum_up(self, told: Sequence[Diagnostic]) -> None:
        """Print the number of findings on standard error, unless there was only one file without findings."""
        if not told and self._checked <= 1:
            return
        counts = Counter(finding.severity.value for finding in told if finding.code != "more-findings")
        listed = [count_text(counts[each], each) for each in ("error", "warning", "info") if counts[each]]
        if any(each.code == "more-findings" for each in self.findings):
            listed.append("others not shown")
        fixable = f"; {self._fixable:,} fixable with --fix" if self._fixable else ""
        found = ", ".join(listed) or "no findings"
        more = len(self.findings) - len(told)
        places = f"; --all lists {count_text(len(self.findings), 'location')}" if more else ""
        sys.stdout.flush()
        print(f"{found} in {count_text(self._checked, 'file')}{fixable}{places}", file=sys.stderr)

    def print_findings(self) -> None:
        """Print the findings."""
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
        raise WriteError(f"{path} is not fixed: it has changed meanwhile, or its encoding cannot be written")
    write_bytes(path, bytes_of(source, apply_fixes(source.text, chosen)))
