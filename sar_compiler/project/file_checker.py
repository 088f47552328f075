"""The check of several tree files in one process."""

from collections.abc import Callable, Sequence
from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.opener import Observation
from sar_compiler.project.additions import CommandLineSettings
from sar_compiler.project.file_check import FileCheck, TextFix, TrialOutcome
from sar_compiler.project.project_tree import FurtherCheck, ProjectTree
from sar_compiler.project.workspace import Workspace
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.model import TreeFile


class FileChecker:
    """Checks files one by one, and continues if one check fails.

    Args:
        additions: The user's additions to the projects of the files.
        further_checks: Returns findings in addition to those of the rules.
        try_runs: Explores the runs of a file within limits.

    Attributes:
        surroundings: The queries made by the checks of all files so far, except those in the `sources` of each check.
            Files share them, because they share configurations, palettes, sets of trees and nodes.
    """

    def __init__(
        self,
        additions: CommandLineSettings,
        further_checks: Sequence[FurtherCheck],
        try_runs: Callable[[ProjectTree], TrialOutcome],
    ) -> None:
        self.surroundings = Observation()
        self._further_checks, self._try_runs = further_checks, try_runs
        self._check = FileCheck()
        # The content of a file and its includes is recorded only for its own check; a set is read once for all files.
        self.workspace = Workspace(additions, self._read, self._note, further_checks, read_tree_file)

    def _read(self, path: Path) -> TreeFile:
        with self._check.sources.recording():
            return read_tree_file(path)

    def _note(self, text: str) -> None:
        self._check.notes.append(text)

    @property
    def reads_set(self) -> bool:
        """Whether the files that were named together were searched for trees."""
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
            except Exception as error:  # noqa: BLE001 - whatever it is, the other files are still checked
                from sar_compiler.checks import failure_of_file

                check.findings.append(failure_of_file(path, error))
        return check

    def _fill(self, check: FileCheck, path: Path) -> None:
        tree = self.workspace.load_file(path)
        check.is_read = True
        project = tree.project
        # Record the uses of this file even if other files have used the same palettes and trees.
        project.used_palettes, project.used_trees = {}, {}
        if not tree.is_malformed:
            project.note_use(tree.forest)
        check.palettes += project.findings
        check.findings += tree.findings
        check.further += [each for further in self._further_checks for each in further(tree)]
        trial = self._try_runs(tree)
        check.raised += trial.findings
        check.spent, check.is_limited, check.is_cut = trial[1:]
        self._add_fixes(check, tree)
        check.used_palettes = [*map(str, project.used_palettes)]
        check.used_trees = [*map(str, project.used_trees)]
        check.is_whole = True

    @staticmethod
    def _add_fixes(check: FileCheck, tree: ProjectTree) -> None:
        if any(each.suggestion is not None for each in check.findings):
            from sar_compiler.checks.fixing import each_fix, fixes

            file = tree.source, tree.tree_file, check.findings
            check.fixable = len(fixes(*file))
            numbers = {id(finding): number for number, finding in enumerate(check.findings)}
            check.fixes += [
                TextFix(numbers[id(each.finding)], each.start, each.end, each.text)
                for each in each_fix(*file)
            ]
