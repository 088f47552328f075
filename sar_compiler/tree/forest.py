"""Loading of all trees that a file can reference.

A tree may be in the file, in an included file, or in another file of a set of files that belong together.
"""

import functools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from sar_compiler.opener import (
    NamedPath,
    UnreadableFileError,
    allow_reading,
    folder_entries,
    is_file,
    is_there,
)
from sar_compiler.tree.content import as_written, real_path
from sar_compiler.tree.diagnostic import Advice, Diagnostic, Severity, TreeError
from sar_compiler.tree.discovery import FORMS
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.model import INCLUDE_TAG, SUBTREE_TAG, Element, TreeFile

MAX_FILES = 1000
"""The maximum number of files that are read for one tree file."""

MAX_NEIGHBOURS = 20_000
"""The maximum number of file names that are compared with a missing include to suggest a name."""

MAX_INCLUDE_DEPTH = 50
"""The maximum nesting depth of includes."""

Read = Callable[[Path], TreeFile]
"""A function that reads one tree file."""


@dataclass(frozen=True, eq=False, repr=False)
class Forest:
    """A tree file with all files that it includes, and with the trees that it uses from other files of its set.

    Attributes:
        main: The tree file itself.
        files: All files, each once; included files precede the files that include them.
        findings: The errors about files that could not be included, or that could not be searched for a missing tree.
        homes: The forest of each tree from another file of the set, by the `id()` of the tree's element.
        targets: The trees of other files to which references are resolved, by the `id()` of the referencing element.
        clashes: A finding for each reference that matches several trees of the set.
        tree_set: The set of files; None if the file belongs to no set.
    """

    main: TreeFile
    files: tuple[TreeFile, ...]
    findings: tuple[Diagnostic, ...] = ()
    homes: "Mapping[int, Forest]" = field(default_factory=dict)
    targets: Mapping[int, Element] = field(default_factory=dict)
    clashes: tuple[Diagnostic, ...] = ()
    tree_set: "TreeSet | None" = None

    @classmethod
    def from_file(cls, tree_file: TreeFile) -> "Forest":
        """Return the forest of a single file, without its includes."""
        return cls(tree_file, (tree_file,))

    @functools.cached_property
    def trees(self) -> dict[str, Element]:
        """The `BehaviorTree` elements by ID. Of several elements with the same ID, the first is used."""
        by_id: dict[str, Element] = {}
        for tree in self.iterate():
            if "ID" in tree.attributes:
                by_id.setdefault(tree.attributes["ID"], tree)
        return by_id

    @functools.cached_property
    def others(self) -> tuple[TreeFile, ...]:
        """The other files of the set from which trees are used, with their includes."""
        return tuple({id(file): file for home in self.homes.values() for file in home.files}.values())

    @functools.cached_property
    def path(self) -> Path:
        """The path of the main file, with symbolic links resolved."""
        return real_path(Path(self.main.source.path))

    def iterate(self) -> Iterator[Element]:
        """Yield every `BehaviorTree` element of the files."""
        for tree_file in self.files:
            yield from tree_file.trees

    def target(self, reference: Element, tree_id: str) -> Element | None:
        """Return the tree that an element references; None if the tree is not found."""
        return self.targets.get(id(reference)) or self.trees.get(tree_id)

    @functools.cached_property
    def known_ids(self) -> list[str]:
        """The IDs of all trees that can be referenced."""
        return list(dict.fromkeys(self.trees) | dict.fromkeys(self.tree_set.by_id if self.tree_set else ()))

    def is_used_elsewhere(self, tree_id: str) -> bool:
        """Return whether another file of the set references a tree with this ID without defining one."""
        return self.tree_set is not None and self.tree_set.is_used(tree_id, self.path)

    def main_tree(self, tree_id: str | None = None) -> Element | None:
        """Return the tree to execute.

        This is the requested tree, the tree that the main file names, or the only tree.

        Returns:
            The `BehaviorTree` element; None if there is no such tree, or if several trees are possible.
        """
        wanted = tree_id if tree_id is not None else self.main.main_tree_name
        if wanted is not None:
            return self.trees.get(wanted) if tree_id is not None else self.target(self.main.root, wanted)
        candidates = self.main.trees or tuple(self.iterate())
        return candidates[0] if len(candidates) == 1 else None

    @functools.cached_property
    def executable(self) -> tuple[Element, ...]:
        """The trees to execute.

        This is the main tree, if the main file names one, else the trees of the main file that no file references.
        """
        main, is_named = self.main_tree(), self.main.main_tree_name is not None
        if is_named:
            return () if main is None else (main,)
        used = {
            id(self.target(each, each.attributes["ID"]))
            for tree in self.iterate()
            for each in _references(tree)
        }
        trees = self.main.trees or tuple(self.iterate())
        return tuple(
            tree
            for tree in trees
            if id(tree) not in used and not self.is_used_elsewhere(tree.attributes.get("ID", ""))
        )


def load_forest(
    path: Path, read: Read, include_paths: Iterable[Path] = (), tree_set: "TreeSet | None" = None
) -> Forest:
    """Read a file with all its includes, and search the set for trees that these files lack.

    A mission must not be able to read arbitrary files of the machine. An included file must therefore be in or below the
    folder of *path* or one of *include_paths*, or (by `ros_pkg`) in the share folder of an installed ROS package.

    Raises:
        UnreadableFileError: If the file itself is missing or cannot be read.
        TreeError: If the file itself is not well-formed.
    """
    place = real_path(path)
    loader = _Loader(read, [place.parent, *map(real_path, include_paths)])
    # The folder of the file is allowed for includes. If it were replaced by a link after `real_path`, other files could be
    # included, so `read` checks the file's location again. A shell pipe has only a name, without a folder.
    main = read(NamedPath.confined_to(path, (place, Path(place.name))))
    loader.add_after_includes(place, main, ())
    forest = Forest(main, tuple(loader.files), tuple(loader.findings), tree_set=tree_set)
    return forest if tree_set is None else _SetSearch(forest, tree_set).result()


@dataclass(eq=False, repr=False)
class TreeSet:
    """Files that belong together. The trees that one file lacks are searched for in the other files.

    All files are read, each once, when the first tree is missing.

    Attributes:
        paths: A function that returns the paths of the files.
        read: A function that reads one file.
        include_paths: Further folders from which the files may include other files.
        is_declared: Whether the project declares the set; otherwise the user named the files together.
        findings: The findings of files that are not well-formed.
        unreadable: The error messages of files that cannot be read.
    """

    paths: Callable[[], Iterable[Path]]
    read: Read
    include_paths: tuple[Path, ...] = ()
    is_declared: bool = True
    findings: list[Diagnostic] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)
    _references: dict[int, tuple[Element, ...]] = field(default_factory=dict)

    @property
    def is_read(self) -> bool:
        """Whether files of the set have been read. If so, findings may depend on each of these files."""
        return "forests" in self.__dict__

    @functools.cached_property
    def forests(self) -> Mapping[Path, Forest]:
        """The forest of each file, by the file's path with symbolic links resolved.

        The first access reads the files, and fills `findings` and `unreadable`.
        """
        forests: dict[Path, Forest] = {}
        read = functools.lru_cache(maxsize=None)(self.read)
        for path in tuple(self.paths()):
            place = real_path(path)
            if place not in forests:
                try:
                    forests[place] = load_forest(path, read, self.include_paths)
                except UnreadableFileError as error:
                    self.unreadable.append(str(error))
                except TreeError as error:
                    self.findings += error.findings
        return forests

    @functools.cached_property
    def by_id(self) -> Mapping[str, Mapping[tuple[str, int], tuple[Path, Forest]]]:
        """A file that contains each tree, with the file's forest, by the ID and by the location of the tree.

        If a tree is in several forests, the file that defines it takes precedence.
        """
        by_id: dict[str, dict[tuple[str, int], tuple[Path, Forest]]] = {}
        for path, forest in self.forests.items():
            for tree_id, tree in forest.trees.items():
                places = by_id.setdefault(tree_id, {})
                if tree.source is forest.main.source:
                    places[tree.source.path, tree.line] = path, forest
                else:
                    places.setdefault((tree.source.path, tree.line), (path, forest))
        return by_id

    @functools.cached_property
    def _users(self) -> Mapping[str, list[Path]]:
        """The files that reference a tree of another file, by tree ID."""
        users: dict[str, list[Path]] = {}
        for path, forest in self.forests.items():
            wanted = {each.attributes["ID"] for tree in forest.main.trees for each in self.references(tree)}
            for tree_id in wanted - forest.trees.keys():
                users.setdefault(tree_id, []).append(path)
        return users

    def is_used(self, tree_id: str, by_other_than: Path) -> bool:
        """Return whether a file except *by_other_than* references a tree with this ID without defining one."""
        return any(path != by_other_than for path in self._users.get(tree_id, ()))

    def files_with_tree(self, tree_id: str) -> Iterable[tuple[Path, Forest]]:
        """Return the paths and forests of the files that contain a tree with an ID."""
        return self.by_id.get(tree_id, {}).values()

    def references(self, tree: Element) -> tuple[Element, ...]:
        """Return the elements in a tree of the set that reference trees."""
        if id(tree) not in self._references:
            self._references[id(tree)] = _references(tree)
        return self._references[id(tree)]


def _references(tree: Element) -> tuple[Element, ...]:
    return tuple(each for each in tree.iterate() if each.tag == SUBTREE_TAG and each.attributes.get("ID"))


class _SetSearch:
    """Recursive search of a set for the trees that are missing from a forest."""

    def __init__(self, forest: Forest, tree_set: TreeSet) -> None:
        self.forest = forest
        self.tree_set = tree_set
        self.findings = list(forest.findings)
        self.targets: dict[int, Element] = {}
        self.clashes: list[Diagnostic] = []
        # The trees found in other files, with the forests of these files.
        self.found: dict[int, tuple[Element, Forest]] = {}

    def result(self) -> Forest:
        """Return the forest, including the trees found in the set."""
        forest, root = self.forest, self.forest.main.root
        named = forest.main.main_tree_name
        if named and named not in forest.trees:
            self._find(root, "main_tree_to_execute", forest)
        for tree in forest.iterate():
            for reference in _references(tree):
                if reference.attributes["ID"] not in forest.trees:
                    self._find(reference, "ID", forest)
        waiting = list(self.found.values())
        for tree, home in waiting:
            known = len(self.found)
            for reference in self.tree_set.references(tree):
                self._find(reference, "ID", home)
            waiting += list(self.found.values())[known:]
        return replace(
            forest,
            findings=tuple(dict.fromkeys(self.findings)),
            homes={id(tree): home for tree, home in waiting},
            targets=self.targets,
            clashes=tuple(self.clashes),
        )

    def _find(self, reference: Element, attribute: str, home: Forest) -> None:
        """Resolve a reference in a tree of the forest *home*.

        The referenced tree is in this forest or in the set.
        """
        tree_id = reference.attributes[attribute]
        having = (
            [(self.forest.path, home)] if tree_id in home.trees else self._files_with_tree(tree_id, reference)
        )
        if not having:
            # If the main file itself is malformed and only its beginning is checked, its error is reported elsewhere.
            self.findings += [
                each
                for each in self.tree_set.findings
                if tree_id in each.source.text and real_path(Path(each.source.path)) != self.forest.path
            ]
            for reason in self.tree_set.unreadable if self.tree_set.is_declared else ():
                message = f"the tree '{tree_id}' may be in a file of the set that cannot be read: {reason}"
                self.findings.append(reference.finding("unreadable-include", message, value=attribute))
            return
        first = having[0][1]
        target = self.targets[id(reference)] = first.trees[tree_id]
        others = [other.trees[tree_id] for _, other in having[1:] if other.trees[tree_id] != target]
        if others:
            places = f"{target.file_and_line} and {others[0].file_and_line}"
            more = f", and in {len(others) - 1} more" if others[1:] else ""
            message = f"the tree '{tree_id}' is defined in several files of the set: {places}{more}"
            # Files that the user named together may belong to different robots.
            severity = Severity.ERROR if self.tree_set.is_declared else Severity.WARNING
            hint = "give each tree a unique ID, or include the file with the intended tree"
            advice = Advice(hint=hint, severity=severity)
            self.clashes.append(reference.finding("duplicate-tree-id", message, value=attribute, **advice))
        if first is not self.forest:
            self.found.setdefault(id(target), (target, first))

    def _files_with_tree(self, tree_id: str, reference: Element) -> list[tuple[Path, Forest]]:
        """Return the files that contain a tree.

        If there are several, return those closest to the referencing file.
        """
        having = [each for each in self.tree_set.files_with_tree(tree_id) if each[0] != self.forest.path]
        if tree_id in self.forest.trees:
            having.insert(0, (self.forest.path, self.forest))
        here = real_path(Path(reference.source.path)).parent
        if not having:
            return having
        shared = [len(os.path.commonpath([here, place.parent])) for place, _ in having]
        return [each for each, length in zip(having, shared, strict=True) if length == max(shared)]


class _Loader:
    def __init__(self, read: Read, folders: list[Path]) -> None:
        self.read = read
        self.folders = folders
        self.files: list[TreeFile] = []
        self.findings: list[Diagnostic] = []
        self.seen: set[Path] = set()
        self.full = False
        self.compared = 0

    def add_after_includes(self, path: Path, tree_file: TreeFile, around: tuple[Path, ...]) -> None:
        """Add a file after the files that it includes."""
        self.seen.add(path)
        around = (*around, path)
        for element in tree_file.root.children:
            if element.tag == INCLUDE_TAG:
                self._include(element, around)
        self.files.append(tree_file)

    def _include(self, element: Element, around: tuple[Path, ...]) -> None:
        target = self._target(element, around[-1].parent)
        if target is None:
            return
        if target in around:
            circle = " -> ".join(path.name for path in (*around[around.index(target) :], target))
            self._report("include-cycle", f"the files include each other in a cycle: {circle}", element)
        elif target not in self.seen:
            self._read(element, target, around)

    def _read(self, element: Element, target: Path, around: tuple[Path, ...]) -> None:
        if len(around) > MAX_INCLUDE_DEPTH or len(self.files) + len(around) >= MAX_FILES:
            if not self.full:  # one such finding is enough
                is_deep = len(around) > MAX_INCLUDE_DEPTH
                limit = f"{MAX_INCLUDE_DEPTH} nested files" if is_deep else f"{MAX_FILES} files"
                self._report("too-many-includes", f"includes exceed the limit of {limit}", element)
            self.full = True
            return
        try:
            tree_file = self.read(NamedPath.confined_to(as_written(target), self.folders))
        except UnreadableFileError as error:
            near = self._intended_path(element, target)
            self.findings.append(
                element.finding("unreadable-include", str(error), value="path", suggestion=near)
            )
        except TreeError as error:
            self.findings.extend(error.findings)
        else:
            self.add_after_includes(target, tree_file, around)
            return
        self.seen.add(target)

    def _intended_path(self, element: Element, target: Path) -> str | None:
        """Return the existing path to which a missing include probably refers; None without a similar path."""
        written, beside = element.attributes["path"], []
        with suppress(UnreadableFileError):
            if self.compared < MAX_NEIGHBOURS and not is_there(target):
                others = (path for path in folder_entries(target.parent) if path.suffix in FORMS)
                beside = [path.name for path in others if path.name != target.name]
        self.compared += len(beside)
        # The extensions are not compared, because equal ones would make all names similar.
        stems = {Path(name).stem: name for name in sorted(beside, reverse=True)}
        near = nearest(target.stem, sorted(stems))
        if near is None or not written.endswith(target.name):
            return None
        return written.removesuffix(target.name) + stems[near]

    def _target(self, element: Element, here: Path) -> Path | None:
        """Return the path of an included file. If there is none, add a finding and return None."""
        written = element.attributes.get("path")
        if not written:
            self._report_pathless(element)
            return None
        package = element.attributes.get("ros_pkg")
        if package is None or Path(written).is_absolute():
            target = self._resolve_path(element, here / written)
            return target if target is not None and self._is_allowed(element, target) else None
        share = _package_share(package)
        if share is None:
            message = f"the ROS package '{package}' is not installed"
            hint = "source the workspace that contains this package, or write a path without ros_pkg"
            self.findings.append(element.finding("unknown-package", message, value="ros_pkg", hint=hint))
            return None
        # After a symlink installation, the files in the share folder are links. Their targets, and the files beside a
        # target, are outside of the share folder.
        target = self._resolve_path(element, share / written)
        if target is None or (
            not Path(os.path.normpath(share / written)).is_relative_to(share)
            and not self._is_allowed(element, target)
        ):
            return None
        self.folders += [share.resolve(), target.parent]
        allow_reading(target)
        return target

    def _resolve_path(self, element: Element, path: Path) -> Path | None:
        try:
            return path.resolve()
        except (OSError, RuntimeError, ValueError) as error:  # circular links, an invalid name
            written = element.attributes["path"]
            self._report("unreadable-include", f"'{written}' is not a valid path: {error}", element)
            return None

    def _is_allowed(self, element: Element, target: Path) -> bool:
        if any(target.is_relative_to(folder) for folder in self.folders):
            return True
        message = f"'{element.attributes['path']}' is outside the folders from which files may be included"
        self._report("include-outside", message, element, hint=f"add --include-path {target.parent}")
        return False

    def _report_pathless(self, element: Element) -> None:
        """Report an include without the attribute `path`.

        If the include has a single unknown attribute, this is probably meant as `path`.
        """
        strange = [name for name in element.attributes if name not in ("path", "ros_pkg")]
        if len(strange) == 1:
            message = f"<{INCLUDE_TAG}> has no attribute '{strange[0]}' (known: path, ros_pkg)"
            finding = element.finding("unknown-attribute", message, name=strange[0], suggestion="path")
            self.findings.append(finding)
            return
        hint = 'write path="other.xml"'
        self._report("missing-attribute", "<include> needs the attribute 'path'", element, hint=hint)

    def _report(self, code: str, message: str, element: Element, hint: str | None = None) -> None:
        self.findings.append(element.finding(code, message, value="path", hint=hint))


def _package_share(package: str) -> Path | None:
    """Return the share folder of a ROS package; None if the package is not found.

    The folder is looked up in the ament index of the sourced workspaces.
    """
    if Path(package).name != package or package in ("", ".", ".."):
        return None
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        marker = Path(prefix) / "share" / "ament_index" / "resource_index" / "packages" / package
        if prefix and is_file(marker):
            return Path(prefix) / "share" / package
    return None
