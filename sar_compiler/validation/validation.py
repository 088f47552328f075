"""The check of several files as one set, and the fixes for the files' errors."""

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler import resources
from sar_compiler.budget import Budget, BudgetSpentError
from sar_compiler.commands import LIMITS_VARIABLE
from sar_compiler.errors import SarError
from sar_compiler.gc_pause import large_imports
from sar_compiler.json_values import json_text, json_value
from sar_compiler.opener import (
    STANDARD_INPUT,
    TREE,
    Observation,
    UnreadableFileError,
    is_file,
    is_folder,
    read_file,
)
from sar_compiler.parts import is_part_installed
from sar_compiler.project.command_line_settings import CommandLineSettings
from sar_compiler.tree.content import encode_text, real_path
from sar_compiler.tree.diagnostic import Diagnostic, TreeError
from sar_compiler.tree.discovery import find_tree, read_tree_file, tree_files_in
from sar_compiler.tree.model import TreeFile
from sar_compiler.validation.check_cache import (
    CheckCache,
    FileCheck,
    TextFix,
    add_modules,
    check_from_data,
    check_to_data,
    observation_from_data,
    observation_to_data,
)

if TYPE_CHECKING:
    from sar_compiler.analysis.trial import TrialOutcome
    from sar_compiler.checks.fixing import Fix
    from sar_compiler.project.project_tree import FurtherCheck, ProjectTree
    from sar_compiler.project.workspace import Workspace
    from sar_compiler.validation.forked_workers import ForkedWorkers

_ROUNDS = 20
"""The maximum number of passes over a file. Several passes are needed because a fix may reveal another error."""


class CheckOptions(NamedTuple):
    """The options of `Validation.check`.

    Attributes:
        is_tried: Whether the runs of files are explored for ticks that raise an error.
        trial_sec: The processor time for exploring the runs of a file, in seconds; None for a fixed amount of work.
        is_cached: Whether results are stored and reused.
        max_sec: The maximum processor time of each worker process, in seconds.
    """

    is_tried: bool
    trial_sec: float | None
    is_cached: bool
    max_sec: float


class Validation:
    """A check of several files as one set. The trees that one file lacks are searched for in the others.

    Args:
        names: The names of the files and folders, as the user wrote them.
        additions: The user's additions to the projects of the files.
        further_checks: The checks of a tree in addition to the rules.
        on_error: Called with the reason if a file or folder cannot be read, checked or written.
        on_note: Called with each note.

    Attributes:
        files: The files.
        findings: The findings, without duplicates.
        fixes: Pairs of a fixable finding and its fix.
        fixable: The number of findings that can be fixed.
        checked: The number of files that could be read.
        clean: The files without findings, except for files that were found in a folder.
        unreadable: The number of files and folders that could not be read, checked or written.
    """

    def __init__(
        self,
        names: Sequence[str],
        additions: CommandLineSettings,
        further_checks: "Sequence[FurtherCheck]",
        on_error: Callable[[str], object],
        on_note: Callable[[str], None],
    ) -> None:
        self.findings: list[Diagnostic] = []
        self.fixes: list[tuple[Diagnostic, TextFix]] = []
        self.fixable = self.checked = self.unreadable = 0
        self.clean: list[Path] = []
        self._further_checks, self._on_error, self._on_note = further_checks, on_error, on_note
        self._run: CheckRun | None = None
        self._done = 0
        self._is_abandoned = False
        self._reported: set[object] = set()
        self._raising: set[object] = set()
        self._used: tuple[dict[Path, None], dict[Path, None]] = {}, {}
        self._found_in_folders: set[Path] = set()
        folders: list[Path] = []
        # A file may be named several times: by links, or by its own name and its folder's. The first name is used.
        files: dict[Path, Path] = {}
        for name in names:
            for path in self._find_files(name, folders):
                files.setdefault(real_path(path), path)
        self.files = tuple(files.values())
        self._places = frozenset(files)
        # A single file or folder is not a set. Missing trees are searched for in the surrounding folders instead.
        trees = self.files if names[1:] else ()
        self._additions = additions._replace(trees=trees, names=self.files, folders=tuple(folders))

    def processor_sec(self) -> float:
        """Return the processor time of this process and its worker processes, in seconds."""
        return time.process_time() + (0.0 if self._run is None else self._run.others_sec)

    def _find_files(self, name: str, folders: list[Path]) -> Iterator[Path]:
        """Yield the files to which a name refers. If the name is a folder, record it."""
        try:
            files = tree_files_in(Path(name)) if name and is_folder(name) else []
            # A folder without trees, such as a package of leaves, may have the same name as a shipped tree.
            if name and is_folder(name) and (files or not is_file(resources.find("trees", name, ".xml"))):
                if not files:
                    self._report_error(f"{name} has no tree file")
                self._found_in_folders.update(files)
                folders.append(Path(name))
                yield from files
            else:
                resources.require_tree_file(name)
                yield find_tree(name)
        except UnreadableFileError as error:
            self._report_error(str(error))

    def _report_error(self, why: str) -> None:
        self.unreadable += 1
        if why not in self._reported:
            self._reported.add(why)
            self._on_error(why)

    def fix(self, on_fix: "Callable[[Fix], object]") -> None:
        """Apply all safe fixes to the files; `check` finds the remaining errors.

        Args:
            on_fix: Called with each fix that was applied.
        """
        with large_imports():
            from sar_compiler.project.workspace import Workspace
        workspace = Workspace(self._additions, note=self._on_note, further_checks=self._further_checks)
        for path in self.files:
            if path == STANDARD_INPUT:
                continue
            try:
                _fix_file(workspace, path, on_fix)
            except TreeError as error:
                self._report(error.findings)
            except SarError as error:
                self._report_error(str(error))
            except Exception as error:  # noqa: BLE001 - no error may prevent findings about the other files
                from sar_compiler.checks import failure_of_file

                self._report([failure_of_file(path, error, "fixing")])

    def check(self, options: CheckOptions, budget: Budget) -> None:
        """Check the files within a budget. `processor_sec` measures the processor time that is used."""
        work: int | None = 0
        is_tried = options.is_tried and is_part_installed("analysis")
        if is_tried:
            from sar_compiler.budget import work_for

            work = work_for(len(self.files)) if options.trial_sec is None else None

        def try_runs(tree: "ProjectTree") -> "TrialOutcome":
            from sar_compiler.analysis.trial import try_runs_within

            return try_runs_within(tree, work, options.trial_sec, budget.is_spent)

        def make_checker() -> "FileChecker":
            return FileChecker(self._additions, self._further_checks, try_runs if is_tried else None)

        cache = self._cache(options, is_tried=is_tried)
        run = self._run = CheckRun(self.files, make_checker, cache, work, budget)
        try:
            try:
                run.start_workers(options.max_sec)
            except KeyboardInterrupt as interrupt:
                budget.spend_by(interrupt)
            with suppress(BudgetSpentError):
                budget.run(lambda: self._receive_checks(run, budget))
        finally:
            # Findings of an abandoned check are ignored.
            self._is_abandoned = True
            run.stop_workers()
        if any(self._used):
            from sar_compiler.project.workspace import use_notes

            for text in use_notes(*self._used):
                self._on_note(text)

    def _cache(self, options: CheckOptions, *, is_tried: bool) -> "CheckCache | None":
        if not options.is_cached or self._additions.trust or LIMITS_VARIABLE in os.environ:
            return None
        return CheckCache.for_settings(self._additions, [is_tried, options.trial_sec])

    def _receive_checks(self, run: "CheckRun", budget: Budget) -> None:
        for path, check in run.results():
            self._receive(path, check)
            if check.is_cut:
                return
            self._done += 1
            if budget.is_spent():
                return

    @property
    def unchecked_count(self) -> int:
        """The number of files that were not checked completely."""
        return len(self.files) - self._done

    def _receive(self, path: Path, check: "FileCheck") -> None:
        """Add the result of a file's check to the results of all files."""
        if self._is_abandoned:
            return
        for text in check.notes:
            if text not in self._reported:
                self._reported.add(text)
                self._on_note(text)
        self.checked += check.is_read
        # If a palette is one of the checked files, its own check reports it, under the name that the user wrote.
        self._report(each for each in check.palettes if real_path(Path(each.source.path)) not in self._places)
        # The runs of an included tree are explored again for each file that includes the tree.
        raised = [each for each in check.raised if (each.source.path, each.span) not in self._raising]
        self._raising.update((each.source.path, each.span) for each in raised)
        self._report([*check.findings, *check.further, *raised])
        if check.problem:
            self._report_error(check.problem)
        self.fixable += check.fixable
        self.fixes += [(check.findings[each.number], each) for each in check.fixes]
        for used, new in zip(self._used, (check.used_palettes, check.used_trees), strict=True):
            used.update(dict.fromkeys(map(Path, new)))
        is_clean = check.is_whole and not (check.findings or check.further or raised)
        if is_clean and path not in self._found_in_folders:
            self.clean.append(path)

    def _report(self, findings: Iterable[Diagnostic]) -> None:
        """Add findings, but no duplicates. Duplicates occur if several files include the same file."""
        new = []
        for finding in findings:
            if finding.identity not in self._reported:
                self._reported.add(finding.identity)
                new.append(finding)
        if not self._is_abandoned:
            self.findings += new


def _fix_file(workspace: "Workspace", path: Path, on_fix: "Callable[[Fix], object]") -> None:
    for _ in range(_ROUNDS):
        try:
            tree = workspace.load_file(path)
            tree.project.findings  # noqa: B018 - raises an error if a palette is malformed
        except (TreeError, UnreadableFileError):
            return
        from sar_compiler.checks.fixing import fixes

        chosen = fixes(tree.source, tree.tree_file, tree.findings)
        if not chosen:
            return
        _write(tree, chosen)
        for fix in chosen:
            on_fix(fix)


def _write(tree: "ProjectTree", chosen: "Sequence[Fix]") -> None:
    """Apply fixes to a file. No other byte of the file is changed."""
    from sar_compiler.checks.fixing import apply_fixes
    from sar_compiler.writing import WriteError, write_bytes

    path, source = tree.path, tree.source
    if encode_text(source, source.text) != read_file(path, TREE).data:
        raise WriteError(
            f"{path} was not fixed: the file has changed since it was read, or its encoding cannot be written"
        )
    write_bytes(path, encode_text(source, apply_fixes(source.text, chosen)))


FEWEST_FOR_WORKERS = 20
"""The minimum number of files for which worker processes save more time than they cost."""
_MOST_WORKERS = 8


class CheckRun:
    """One pass over files that uses stored results and worker processes.

    Args:
        files: The files.
        make_checker: A function that creates the checker. It is called only if results are missing.
        cache: The stored results; None if there is no cache.
        work: The limit for exploring the runs of a file, in units of work; None for no limit.
        budget: The limits of all checks together.

    Attributes:
        others_sec: The processor time that the worker processes have used, in seconds.
    """

    def __init__(
        self,
        files: Sequence[Path],
        make_checker: "Callable[[], FileChecker]",
        cache: CheckCache | None,
        work: int | None,
        budget: Budget,
    ) -> None:
        self.others_sec = 0.0
        self._files, self._budget = files, budget
        self._cache = None if STANDARD_INPUT in files else cache
        self._results: dict[int, FileCheck] = {}
        for number, path in enumerate(files):
            if self._cache is not None and (stored := self._cache.find(path, work)) is not None:
                self._results[number] = stored
        self._missing = [number for number in range(len(files)) if number not in self._results]
        self._checker = make_checker() if self._missing else None
        self._workers: ForkedWorkers | None = None
        self._count = 1
        self._others = Observation()
        self._reads_set = False
        self._sent = self._modules = 0
        self._cpu: dict[int, float] = {}

    def start_workers(self, max_sec: float) -> None:
        """Start worker processes if there are enough files. This must be done before any thread is started.

        Args:
            max_sec: The maximum processor time of each worker process, in seconds.
        """
        if len(self._missing) < FEWEST_FOR_WORKERS:
            return
        from sar_compiler.validation.forked_workers import ForkedWorkers

        affinity = getattr(os, "sched_getaffinity", None)
        count = min(len(affinity(0)) if affinity else os.cpu_count() or 1, _MOST_WORKERS)
        if count > 1 and ForkedWorkers.are_possible():
            import sar_compiler.checks.schema_validation
            import sar_compiler.tree.xml  # noqa: F401 - imported once for all workers

            self._count = count
            self._workers = ForkedWorkers(self._check_in_worker, self._missing, max_sec)
            self._workers.start(count)

    def _check_in_worker(self, number: int) -> str | None:
        checker = self._checker
        assert checker is not None  # noqa: S101 - there are files to check
        if not self._sent:
            self._budget.divide_memory(self._count)
        try:
            check = checker.check(self._files[number])
        except Exception:  # noqa: BLE001 - the main process repeats the check, and reports the error
            return None
        observed = checker.surroundings
        if self._cache is not None and self._modules != len(sys.modules):
            self._modules = len(sys.modules)
            add_modules(observed)
        new = Observation(islice(observed.items(), self._sent, None))
        self._sent = len(observed)
        return json_text(
            {
                "check": check_to_data(check),
                "surroundings": observation_to_data(new),
                "is_consistent": observed.is_consistent and check.sources.is_consistent,
                "reads_set": checker.reads_set,
                "process": os.getpid(),
                "cpu_sec": time.process_time(),
                "reason": self._budget.reason,
            }
        )

    def _receive(self, message: dict[str, Any]) -> FileCheck:
        for query, response in observation_from_data(message["surroundings"]).items():
            self._others.record(query, response)
        self._others.is_consistent = self._others.is_consistent and message["is_consistent"]
        self._reads_set = self._reads_set or message["reads_set"]
        self._cpu[message["process"]] = message["cpu_sec"]
        self.others_sec = sum(self._cpu.values())
        if message["reason"]:
            self._budget.spend(message["reason"])
        return check_from_data(message["check"])

    def results(self) -> Iterator[tuple[Path, FileCheck]]:
        """Yield each file with its result, in the order of the files."""
        computed = iter(()) if self._workers is None else self._workers.results(self._budget.is_spent)
        for number, path in enumerate(self._files):
            while number not in self._results and (result := next(computed, None)) is not None:
                done, text = result
                if text is not None:
                    self._results[done] = self._receive(json_value(text))
                elif done == number:
                    break
            if number not in self._results:
                if self._budget.is_spent():
                    return
                assert self._checker is not None  # noqa: S101 - there are files to check
                self._results[number] = self._checker.check(path)
            yield path, self._results[number]

    def stop_workers(self) -> None:
        """Stop the worker processes, and store the results for later commands."""
        if self._workers is not None:
            self._workers.terminate_workers()
        if self._cache is not None and self._checker is not None:
            for query, response in self._checker.surroundings.items():
                self._others.record(query, response)
            self._others.is_consistent = (
                self._others.is_consistent and self._checker.surroundings.is_consistent
            )
            new = {
                self._files[number]: self._results[number]
                for number in self._missing
                if number in self._results
            }
            reads_set = self._reads_set or self._checker.reads_set
            self._cache.store(new, self._others, reads_set=reads_set)


class FileChecker:
    """The checker of single files. If the check itself raises an error, this becomes a finding.

    Args:
        additions: The user's additions to the projects of the files.
        further_checks: Functions that return findings in addition to those of the rules.
        try_runs: A function that explores the runs of a file within limits; None if runs are not explored.

    Attributes:
        surroundings: The file system queries of all checks so far, except for the queries in `sources` of each check.
            They concern the configurations, palettes, sets of trees and node modules, which the files share.
    """

    def __init__(
        self,
        additions: CommandLineSettings,
        further_checks: "Sequence[FurtherCheck]",
        try_runs: "Callable[[ProjectTree], TrialOutcome] | None",
    ) -> None:
        self.surroundings = Observation()
        self._further_checks, self._try_runs = further_checks, try_runs
        self._check = FileCheck()
        # The queries for a file and its includes are recorded in the file's check. A set is read once for all files.
        with large_imports():
            from sar_compiler.project.workspace import Workspace
        self.workspace = Workspace(additions, self._read, self._add_note, further_checks, read_tree_file)

    def _read(self, path: Path) -> TreeFile:
        with self._check.sources.recording():
            return read_tree_file(path)

    def _add_note(self, text: str) -> None:
        self._check.notes.append(text)

    @property
    def reads_set(self) -> bool:
        """Whether a check has searched other files of the command for trees."""
        return any(each.tree_set is not None and each.tree_set.is_read for each in self.workspace.projects)

    def check(self, path: Path) -> FileCheck:
        """Check a file.

        Raises:
            Exception: An error for which commands have a message, such as a library that is not installed.
        """
        check = self._check = FileCheck()
        with self.surroundings.recording():
            try:
                self._fill(check, path)
            except TreeError as error:
                check.findings += error.findings
                check.is_read = True
            except SarError as error:
                check.problem = str(error)
            except Exception as error:  # noqa: BLE001 - the other files are checked after any error
                from sar_compiler.checks import failure_of_file

                check.findings.append(failure_of_file(path, error))
        return check

    def _fill(self, check: FileCheck, path: Path) -> None:
        tree = self.workspace.load_file(path)
        check.is_read = True
        project = tree.project
        # The palettes and trees that this file uses are recorded even if other files have used them.
        project.used_palettes, project.used_trees = {}, {}
        if not tree.is_malformed:
            project.report_use(tree.forest)
        check.palettes += project.findings
        check.findings += tree.findings
        check.further += [each for further in self._further_checks for each in further(tree)]
        if self._try_runs is not None:
            trial = self._try_runs(tree)
            check.raised += trial.findings
            check.spent, check.is_limited, check.is_cut = trial[1:]
        self._add_fixes(check, tree)
        check.used_palettes = [*map(str, project.used_palettes)]
        check.used_trees = [*map(str, project.used_trees)]
        check.is_whole = True

    @staticmethod
    def _add_fixes(check: FileCheck, tree: "ProjectTree") -> None:
        if any(each.suggestion is not None for each in check.findings):
            from sar_compiler.checks.fixing import each_fix, fixes

            file = tree.source, tree.tree_file, check.findings
            check.fixable = len(fixes(*file))
            numbers = {id(finding): number for number, finding in enumerate(check.findings)}
            check.fixes += [
                TextFix(numbers[id(each.finding)], each.start, each.end, each.text)
                for each in each_fix(*file)
            ]
