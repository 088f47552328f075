"""The configuration of a project, in `sar.toml` or under `[tool.sar]` in `pyproject.toml`.

The configuration is searched for from a tree file's folder upwards, and only the nearest file is used. A file that
another user owns is ignored. All paths in a configuration must be in its repository.
"""

import dataclasses
import itertools
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.nodes.btcpp import VERSIONS, Version
from sar_compiler.nodes.palettes import is_palette_name
from sar_compiler.opener import (
    SETTINGS,
    NamedPath,
    UnreadableFileError,
    is_file,
    is_there,
    owner_of,
    read_file,
)
from sar_compiler.resources import shipped_root
from sar_compiler.tree.content import as_written, real_path
from sar_compiler.tree.diagnostic import Diagnostic, Severity, Source, Span, TreeError
from sar_compiler.tree.model import NO_SPANS

if TYPE_CHECKING:
    from sar_compiler.documents.located import Document, Value

OWN_FILE = "sar.toml"
SHARED_FILE = "pyproject.toml"
_SHARED_TABLE = ("tool", "sar")
_NODES, _MODELS, _INCLUDE_PATH = "nodes", "models", "include-path"
_PROJECT, _TREES = "project", "trees"
_OFF = "off"
# A `pyproject.toml` without this word is not parsed, because it has no table `[tool.sar]`.
_OWN_WORD = re.compile(rb"(?<![\w-])sar(?![\w-])")


class Configuration(NamedTuple):
    """The configuration of a project.

    Attributes:
        nodes: The modules that define leaves, in the form that `--nodes` accepts.
        models: The palette files, in the form that `--model` accepts.
        include_path: Further folders from which files may be included.
        btcpp: The version of BehaviorTree.CPP that the trees are for; None if it is not configured.
        trees: The project's tree files, as pairs of a base folder and a file, folder or glob pattern.
        severities: The configured severities of findings, by code; None for a code that is switched off.
        path: The configuration file; None if there is none.
        source: The text of the configuration file.
        spans: The location of the name of each module and each palette in the configuration file.
        palettes: The installed palettes, in the form that `--model` accepts.
        enums: The numeric values of the C++ program's enumerators, by enumerator name.
    """

    nodes: tuple[str, ...] = ()
    models: tuple[Path, ...] = ()
    include_path: tuple[Path, ...] = ()
    btcpp: Version | None = None
    trees: tuple[tuple[Path, str], ...] = ()
    severities: Mapping[str, Severity | None] = {}
    path: Path | None = None
    source: Source = Source("", "", NO_SPANS)
    spans: Mapping[str, Span] = {}
    palettes: tuple[str, ...] = ()
    enums: Mapping[str, int] = {}

    def decide(self, findings: Iterable[Diagnostic]) -> list[Diagnostic]:
        """Set the configured severity of each finding, and remove the findings that are switched off."""
        decided = []
        for finding in findings:
            severity = self.severities.get(finding.code, finding.severity)
            if severity is finding.severity or finding.severity is Severity.ERROR:
                decided.append(finding)
            elif severity is not None:
                decided.append(dataclasses.replace(finding, severity=severity))
        return decided


NOTHING_DECIDED = Configuration()


def configuration_for(
    tree_file: Path, passed_over: Callable[[Path], None] = lambda _path: None
) -> Configuration:
    """Return the configuration for a tree file; it is empty if no configuration file exists.

    Args:
        tree_file: The tree file.
        passed_over: Called with the path of each configuration file that is ignored because another user owns it.

    Raises:
        TreeError: If the configuration has errors.
        UnreadableFileError: If the configuration cannot be read.
    """
    tree_file = real_path(tree_file)
    for folder in tree_file.parents:
        for name, table in ((OWN_FILE, ()), (SHARED_FILE, _SHARED_TABLE)):
            path = folder / name
            # A `sar.toml` that is a folder or a named pipe is reported as unreadable. Such a `pyproject.toml` is
            # ignored.
            exists = is_file(path) if table else is_there(path)
            if not exists or (table and not _OWN_WORD.search(read_file(path, SETTINGS).data)):
                continue
            if not _has_trusted_owner(path, tree_file):
                passed_over(path)
            elif (decided := _read_table(path, table)) is not None:
                return decided
    return NOTHING_DECIDED


def find_repository(folder: Path) -> Path | None:
    """Return the root of the Git repository that contains a folder; None if there is no repository."""
    return next((each for each in (folder, *folder.parents) if is_there(each / ".git")), None)


def enclosing_folder(folder: Path) -> Path:
    """Return the folder to which the paths in a folder's files are restricted.

    This is the repository or, outside of a repository, the folder itself.

    For a folder of this package, it is the folder of all its shipped files.
    """
    own = real_path(folder)
    if (repository := find_repository(own)) is not None:
        return repository
    return shipped_root() if own.is_relative_to(shipped_root()) else own


def project_paths(folders: Iterable[Path]) -> list[Path]:
    """Return the resolved paths outside of folders that belong to the projects of these folders.

    These are the paths of all possible configuration files above the folders, including those of missing files. If the
    configuration of a folder is above the folder, the palettes, include folders and tree files in the configuration are
    added.

    Args:
        folders: The folders, with links resolved.
    """
    places: list[Path] = []
    for folder in folders:
        places += [above / name for above in folder.parents for name in (OWN_FILE, SHARED_FILE)]
        with suppress(TreeError, UnreadableFileError):  # each command reports these errors
            found = configuration_for(folder / "a tree file")
            if found.path is not None and not found.path.is_relative_to(folder):
                places += [*found.models, *found.include_path]
                places += [_folder_of(*each) for each in found.trees]
    return [*map(real_path, places)]


def _folder_of(folder: Path, pattern: str) -> Path:
    """Return the folder of all matches of a glob pattern, which is the part before the first wildcard."""
    import glob

    return folder.joinpath(*itertools.takewhile(lambda part: not glob.has_magic(part), Path(pattern).parts))


def _has_trusted_owner(configuration: Path, tree_file: Path) -> bool:
    """Return whether a configuration file belongs to the user, to root, or to the owner of the tree file."""
    if sys.platform == "win32":
        return True
    # A missing tree file is reported when it is read.
    return owner_of(configuration) in {os.geteuid(), 0, owner_of(tree_file)}


def _read_table(path: Path, table: tuple[str, ...]) -> Configuration | None:
    """Return the configuration in a table of a file; None if the file has no such table.

    Raises:
        TreeError: If the table has errors. The exception contains all findings.
        UnreadableFileError: If the file cannot be read.
    """
    from sar_compiler.documents.toml_files import read_toml

    document = read_toml(path, str(as_written(path)))
    found: Value | None = document.root
    for key in table:
        found = found.mapping.get(key) if found else None
    if found is None or not found.data:
        return None if table else NOTHING_DECIDED
    settings = document.validate("settings", found)
    data, entries = settings.data, settings.mapping
    written = entries[_MODELS].as_list if _MODELS in entries else ()
    palettes = tuple(each.text or "" for each in written if is_palette_name(each.text or ""))
    files = [each for each in written if not is_palette_name(each.text or "")]
    models = _paths(path, document, files, _MODELS, "--model")
    folders = entries[_INCLUDE_PATH].as_list if _INCLUDE_PATH in entries else ()
    include_path = _paths(path, document, folders, _INCLUDE_PATH, "--include-path")
    project = entries.get(_PROJECT)
    trees = project.mapping.get(_TREES) if project is not None else None
    listed = trees.as_list if trees is not None else ()
    patterns = tuple(str(each.data) for each in listed)
    _paths(path, document, listed, _TREES, "")
    document.raise_findings()
    modules = entries[_NODES].as_list if _NODES in entries else ()
    language = data.get("language", {})
    return Configuration(
        tuple(data.get(_NODES, ())),
        models,
        include_path,
        VERSIONS.get(language.get("btcpp", "")),
        tuple((path.parent, pattern) for pattern in patterns),
        {
            code: None if level == _OFF else Severity(level)
            for code, level in data.get("findings", {}).items()
        },
        path,
        document.source,
        {str(path.parent / str(each.data)): document.span(each) for each in files}
        | {str(each.data): document.span(each) for each in (*written, *modules)},
        palettes,
        language.get("enums", {}),
    )


def _paths(
    path: Path, document: "Document", listed: "Iterable[Value]", name: str, option: str
) -> tuple[Path, ...]:
    """Resolve a setting's paths relative to the file's folder, and report paths that leave the repository."""
    found = (
        path_inside(document, path.parent, value, name, f", or use the option {option}" if option else "")
        for value in listed
    )
    return tuple(each for each in found if each is not None)


def path_inside(
    document: "Document", folder: Path, value: "Value", name: str, otherwise: str = ""
) -> Path | None:
    """Resolve a path relative to its file's folder. If the path leaves the repository, report it and return None.

    Args:
        document: The file that contains the path.
        folder: The folder of this file. If it is in no repository, the path must not leave the folder.
        value: The path.
        name: The key that contains the path, for the message.
        otherwise: Another remedy, which is added to the hint.
    """
    # The folder from which the file was read. A link may have replaced it by now.
    text, limit = str(value.data), enclosing_folder(document.folder or folder)
    # Links are resolved. A loop of links is reported when the path is read.
    if "\0" not in text and real_path(folder / text).is_relative_to(limit):
        # The limit is checked again when the file is opened, because a link may change until then.
        return NamedPath.confined_to(folder / text, (limit,))
    where = "folder" if find_repository(limit) is None else "repository"
    message = f"{name}: '{text}' is outside the {where} of this file"
    document.report("setting-outside", message, value, hint=f"move it into the {where}{otherwise}")
    return None
