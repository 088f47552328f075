"""Loads tree files, each with the settings of the project to which it belongs."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sar_compiler.nodes.installed import ignored_entry_points
from sar_compiler.nodes.registry import ENTRY_POINTS
from sar_compiler.project.command_line_settings import CommandLineSettings
from sar_compiler.project.project import Project
from sar_compiler.project.project_tree import FurtherCheck, ProjectTree
from sar_compiler.project.surroundings import FilesAround, find_surroundings
from sar_compiler.tree.discovery import find_tree, read_tree_file
from sar_compiler.tree.forest import Read

_MOST_NAMED = 5
"""The maximum number of files that are named in a note."""


@dataclass(eq=False, repr=False)
class Workspace:
    """Loads tree files, each with the settings of the project to which it belongs.

    Attributes:
        additions: The settings on the command line.
        read: A function that reads one tree file; an editor provides the text of open files.
        note: A function that receives each note for the user once, for example about a file that is ignored for safety.
        further_checks: Functions that return findings for `ProjectTree.check`, in addition to those of the rules.
        read_for_sets: A function that reads one file of a project's set of trees; None for `read`.
    """

    additions: CommandLineSettings = CommandLineSettings()  # noqa: RUF009 - immutable
    read: Read = read_tree_file
    note: Callable[[str], None] = lambda _text: None
    further_checks: Sequence[FurtherCheck] = ()
    read_for_sets: Read | None = None
    _projects: dict[tuple[Path | None, ...], Project] = field(default_factory=dict, init=False)
    _files_around: dict[tuple[Path | None, ...], FilesAround] = field(default_factory=dict, init=False)
    _noted: set[str] = field(default_factory=set, init=False)

    def load(self, tree: str | Path) -> ProjectTree:
        """Load a tree file by path or name.

        Args:
            tree: The path of a tree file, or the name of a shipped tree.

        Raises:
            UnreadableFileError: If the file does not exist or cannot be read.
            TreeError: If the project's configuration has errors.
        """
        return self.load_file(find_tree(str(tree)))

    def load_file(self, path: Path) -> ProjectTree:
        """Load a tree file.

        Raises:
            UnreadableFileError: If the file does not exist or cannot be read.
            TreeError: If the project's configuration has errors.
        """
        return ProjectTree(path, self.project_of(path), self.read, self.report_once, self.further_checks)

    def current_project(self) -> Project:
        """Return the project to which a tree file in the current folder would belong."""
        return self.project_of(Path("a tree file"))

    def project_of(self, path: Path) -> Project:
        """Return the project of a tree file.

        Raises:
            UnreadableFileError: If the project's configuration cannot be read.
            TreeError: If the configuration has errors.
        """

        def pass_over(foreign: Path) -> None:
            self.report_once(
                f"{foreign} is ignored, because this file belongs neither to you nor to the owner of {path}"
            )

        folders, is_isolated = self.additions.folders, self.additions.is_isolated
        found = find_surroundings(path, folders, pass_over, is_isolated=is_isolated)
        configuration, checkout, files = found
        key = (configuration.path, checkout, files.folder, files.root)
        if key not in self._projects or self._projects[key].configuration != configuration:
            around = self._files_around.setdefault((files.folder, files.root), files)
            self._projects[key] = Project(
                found._replace(files=around), self.additions, self.read_for_sets or self.read
            )
            for entry_point, place in ignored_entry_points(ENTRY_POINTS, checkout):
                self.report_once(
                    f"the leaves of '{entry_point.value}' are ignored: {place} declares them as installed, "
                    f"but this path is inside the checked folder. Install them, or add --nodes {entry_point.value}"
                )
        return self._projects[key]

    @property
    def projects(self) -> Collection[Project]:
        """The projects of the files that were loaded."""
        return self._projects.values()

    def reload_sets(self) -> None:
        """Discard the files of all sets. They are loaded again when a tree is next searched for in them."""
        for project in self._projects.values():
            project.reload_set()

    def report_use(self) -> None:
        """Report which surrounding palettes and tree files were used although the user has not named them."""
        palettes = {path for each in self.projects for path in each.used_palettes}
        trees = {path for each in self.projects for path in each.used_trees}
        for text in use_notes(palettes, trees):
            self.report_once(text)

    def report_once(self, text: str) -> None:
        """Report a note unless it has been reported before."""
        if text not in self._noted:
            self._noted.add(text)
            self.note(text)


def use_notes(palettes: Collection[Path], trees: Collection[Path]) -> Iterator[str]:
    """Yield notes about palettes and tree files that were used although the user has not named them."""
    for what, paths in (("nodes are described by", palettes), ("trees are taken from", trees)):
        if paths:
            more = f" and {len(paths) - _MOST_NAMED} more" if len(paths) > _MOST_NAMED else ""
            yield f"{what} {', '.join(map(str, sorted(paths)[:_MOST_NAMED]))}{more}"
