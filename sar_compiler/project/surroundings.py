"""Finds the configuration of a tree file, and the palettes and trees in the surrounding folders.

All commands, the language server and the tools for agents use this module, so that a file has the same surroundings
everywhere. Surrounding files are read only if a tree file uses a node without a description, a name that may be an
enumeration member, or a tree that the file lacks. A command reports the surrounding files that it has used.
"""

import functools
import os
import stat
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from sar_compiler.checks.configuration import (
    NOTHING_DECIDED,
    Configuration,
    configuration_for,
    find_repository,
)
from sar_compiler.opener import NamedPath, is_there, may_read, owner_of
from sar_compiler.resources import shipped_root
from sar_compiler.tree.content import as_written, real_path
from sar_compiler.tree.discovery import files_around, is_palette, is_tree_file

_PACKAGE = "package.xml"
_MOST_FILES = 20_000
"""The maximum number of files that are examined in a folder and its subfolders."""


class FilesAround:
    """The tree files and palettes below a folder. They are examined only when they are needed.

    Links out of the folder are ignored. Files are ignored unless they belong to the folder's owner, this user or root.

    Args:
        folder: The folder, with links resolved; None for no files.
        is_root: Whether the folder is the root of a project. If so, its subfolders are searched, and its files may
            include each other.
    """

    def __init__(self, folder: Path | None, *, is_root: bool = True) -> None:
        self.folder = folder
        self.root = folder if is_root else None

    @functools.cached_property
    def _files(self) -> list[Path]:
        if self.folder is None:
            return []
        folder, owners = self.folder, {0, owner_of(self.folder)}
        if hasattr(os, "geteuid"):
            owners.add(os.geteuid())
        found = files_around(folder, most=_MOST_FILES, is_whole=self.root is not None)
        return [
            NamedPath.confined_to(as_written(path), (folder,)) for path in found if owner_of(path) in owners
        ]

    @functools.cached_property
    def trees(self) -> tuple[Path, ...]:
        """The tree files, sorted by path."""
        return tuple(path for path in self._files if is_tree_file(path, is_sought=True))

    @functools.cached_property
    def palettes(self) -> tuple[Path, ...]:
        """The palettes, sorted by path: files and Groot2 projects that only describe nodes."""
        return tuple(path for path in self._files if is_palette(path))


NOTHING_AROUND = FilesAround(None)


class FileSurroundings(NamedTuple):
    """The configuration and the surrounding files of a tree file.

    Attributes:
        configuration: The configuration that applies to the tree file.
        checkout: The folder whose code is not trusted: the repository, or the configuration's folder.
        files: The tree files and palettes in the surrounding folders.
    """

    configuration: Configuration
    checkout: Path
    files: FilesAround


def find_surroundings(
    path: Path,
    folders: Iterable[Path] = (),
    passed_over: Callable[[Path], None] = lambda _path: None,
    *,
    is_isolated: bool = False,
) -> FileSurroundings:
    """Find the configuration and the surrounding files of a tree file.

    The surrounding files are the files below one folder. This is the repository of the tree file or, without a
    repository, the outermost of the following: the configuration's folder, the ROS package's folder, and the current
    folder if the tree file is in it. If none exists, only the files directly in the tree file's folder are used.
    A folder in *folders* takes precedence if it contains this folder. An unreadable folder is never used.

    Args:
        path: The tree file.
        folders: Folders that the user has named, or that an editor has open.
        passed_over: As for `configuration_for`.
        is_isolated: Whether to ignore the configuration and the surrounding files.

    Raises:
        TreeError: If the configuration has errors.
        UnreadableFileError: If the configuration cannot be read.
    """
    place = real_path(path)
    if is_isolated:
        return FileSurroundings(
            NOTHING_DECIDED, find_repository(place.parent) or place.parent, NOTHING_AROUND
        )
    configuration = configuration_for(path, passed_over)
    folder = (configuration.path or place).parent
    repository = find_repository(folder)
    checkout = repository or folder
    if place.is_relative_to(shipped_root() / "trees"):
        return FileSurroundings(configuration, checkout, NOTHING_AROUND)
    if repository is not None and may_read(repository):
        marked = [repository]
    else:
        marked = [*_roots_of(place, configuration)]
    marked += [each for each in map(real_path, folders) if place.is_relative_to(each)]
    around = [each for each in marked if place.is_relative_to(each) and may_read(each)]
    root = min(around, key=lambda each: len(each.parts), default=None)
    files = FilesAround(root) if root is not None else FilesAround(place.parent, is_root=False)
    return FileSurroundings(configuration, checkout, files)


def _roots_of(place: Path, configuration: Configuration) -> Iterable[Path]:
    """Yield the folders that may be the root of a project that is not in a repository."""
    if configuration.path is not None:
        yield configuration.path.parent
    yield from (each for each in place.parents if is_there(each / _PACKAGE))
    here = real_path(Path.cwd())
    # The files in these folders may belong to several projects or to several people.
    shared = here in (Path(here.anchor), real_path(Path.home())) or here.stat().st_mode & stat.S_IWOTH
    if not shared:
        yield here
