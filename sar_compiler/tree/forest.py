"""All trees that a file can name: its own, and those of the files that it includes."""

import functools
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from sar_compiler.tree.content import as_written
from sar_compiler.tree.diagnostic import Diagnostic, TreeError, UnreadableFileError
from sar_compiler.tree.model import INCLUDE_TAG, Element, TreeFile

MAX_FILES = 1000
"""More files than this are not read for one tree."""

MAX_NEIGHBOURS = 20_000
"""The number of file names that are compared with missing ones; beyond it nothing is suggested."""

MAX_INCLUDE_DEPTH = 50
"""An include in an include, and so on, ends here."""

_ENDINGS = frozenset((".xml", ".yaml", ".yml"))

Read = Callable[[Path], TreeFile]
"""Reads one file."""


@dataclass(frozen=True)
class Forest:
    """A file and everything that it includes.

    Attributes:
        main: The file.
        files: All files, each once: the included ones before those that include them.
        findings: What kept a file from being included.
    """

    main: TreeFile
    files: tuple[TreeFile, ...]
    findings: tuple[Diagnostic, ...] = ()

    @classmethod
    def of(cls, tree_file: TreeFile) -> "Forest":
        """Return the forest of a file by itself; its includes are not looked at."""
        return cls(tree_file, (tree_file,))

    @functools.cached_property
    def trees(self) -> dict[str, Element]:
        """The `BehaviorTree` elements that have an ID, by it; of several the first."""
        by_id: dict[str, Element] = {}
        for tree in self.iterate():
            if "ID" in tree.attributes:
                by_id.setdefault(tree.attributes["ID"], tree)
        return by_id

    def iterate(self) -> Iterator[Element]:
        """Yield every `BehaviorTree` element."""
        for tree_file in self.files:
            yield from tree_file.trees

    def main_tree(self, tree_id: str | None = None) -> Element | None:
        """Return the tree to execute: the one asked for, the one the main file names, or its only one.

        Returns:
            The `BehaviorTree` element; None if there is no such tree, or several to choose from.
        """
        wanted = tree_id if tree_id is not None else self.main.main_tree_name
        if wanted is not None:
            return self.trees.get(wanted)
        candidates = self.main.trees or tuple(self.iterate())
        return candidates[0] if len(candidates) == 1 else None


def load_forest(path: Path, read: Read, include_paths: Iterable[Path] = ()) -> Forest:
    """Read a file and everything that it includes.

    An included file must lie in the folder of the file given, below it, in one of *include_paths*, or (by
    `ros_pkg`) in the share folder of an installed ROS package: a mission must not be able to read whatever
    is on the machine.

    Raises:
        UnreadableFileError: If the file itself is not there or cannot be read.
        TreeError: If the file itself is malformed.
    """
    loader = _Loader(read, [path.resolve().parent, *(folder.resolve() for folder in include_paths)])
    main = read(path)
    loader.included(path.resolve(), main, ())
    return Forest(main, tuple(loader.files), tuple(loader.findings))


class _Loader:
    def __init__(self, read: Read, folders: list[Path]) -> None:
        self.read = read
        self.folders = folders
        self.files: list[TreeFile] = []
        self.findings: list[Diagnostic] = []
        self.seen: set[Path] = set()
        self.full = False
        self.compared = 0

    def included(self, path: Path, tree_file: TreeFile, around: tuple[Path, ...]) -> None:
        """Take a file in, after everything that it includes itself."""
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
            self._report(element, "include-cycle", f"the files include each other for ever: {circle}")
        elif target not in self.seen:
            self._read(element, target, around)

    def _read(self, element: Element, target: Path, around: tuple[Path, ...]) -> None:
        if len(around) > MAX_INCLUDE_DEPTH or len(self.files) + len(around) >= MAX_FILES:
            if not self.full:  # one such finding says it all
                deep = len(around) > MAX_INCLUDE_DEPTH
                limit = f"{MAX_INCLUDE_DEPTH} files deep" if deep else f"{MAX_FILES} files"
                self._report(element, "too-many-includes", f"includes go further than {limit}")
            self.full = True
            return
        try:
            tree_file = self.read(as_written(target))
        except UnreadableFileError as error:
            self._report(element, "unreadable-include", str(error), suggestion=self._near(element, target))
        except TreeError as error:
            self.findings.extend(error.findings)
        else:
            self.included(target, tree_file, around)
            return
        self.seen.add(target)

    def _near(self, element: Element, target: Path) -> str | None:
        """Return the path of a missing include with the name of the tree file beside it that was probably meant."""
        written, beside = element.attributes["path"], []
        with suppress(OSError):
            if self.compared < MAX_NEIGHBOURS and not target.exists():
                others = (path for path in target.parent.iterdir() if path.suffix in _ENDINGS)
                beside = [path.name for path in others if path.name != target.name]
        self.compared += len(beside)
        import difflib

        # The ending, which many have, speaks for none of them.
        stems = {Path(name).stem: name for name in sorted(beside, reverse=True)}
        near = difflib.get_close_matches(target.stem, sorted(stems), n=1)
        if not near or not written.endswith(target.name):
            return None
        return written.removesuffix(target.name) + stems[near[0]]

    def _target(self, element: Element, here: Path) -> Path | None:
        """Return the file that an include means, or None after a finding."""
        written = element.attributes.get("path")
        if not written:
            self._report_pathless(element)
            return None
        package = element.attributes.get("ros_pkg")
        if package is None or Path(written).is_absolute():
            target = self._resolved(element, here / written)
            return target if target is not None and self._allowed(element, target) else None
        share = _package_share(package)
        if share is None:
            message = f"no ROS package '{package}' is installed here"
            hint = "source the workspace that has it, or write a path without ros_pkg"
            self._report(element, "unknown-package", message, attribute="ros_pkg", hint=hint)
            return None
        # Packages that were installed with links to their sources lie there in truth, and so do the files
        # beside this one.
        target = self._resolved(element, share / written)
        if target is None or (
            not Path(os.path.normpath(share / written)).is_relative_to(share)
            and not self._allowed(element, target)
        ):
            return None
        self.folders += [share.resolve(), target.parent]
        return target

    def _resolved(self, element: Element, path: Path) -> Path | None:
        try:
            return path.resolve()
        except (OSError, RuntimeError, ValueError) as error:  # a circle of links, a name that none can have
            written = element.attributes["path"]
            self._report(element, "unreadable-include", f"'{written}' is no path of a file: {error}")
            return None

    def _allowed(self, element: Element, target: Path) -> bool:
        if any(target.is_relative_to(folder) for folder in self.folders):
            return True
        message = f"'{element.attributes['path']}' lies outside the folders that may be included from"
        hint = f"allow it: --include-path {target.parent}"
        self._report(element, "include-outside", message, hint=hint)
        return False

    def _report_pathless(self, element: Element) -> None:
        """Report an include without a path; a single strange attribute was meant for it."""
        strange = [name for name in element.attributes if name not in ("path", "ros_pkg")]
        if len(strange) == 1:
            message = f"<{INCLUDE_TAG}> has no attribute '{strange[0]}'; it has path, ros_pkg"
            span = element.name_span(strange[0])
            finding = Diagnostic("unknown-attribute", message, element.source, span, suggestion="path")
            self.findings.append(finding)
            return
        hint = 'write path="other.xml"'
        self._report(element, "missing-attribute", "<include> needs the attribute 'path'", hint=hint)

    def _report(
        self, element: Element, code: str, message: str, attribute: str = "path", **advice: str | None
    ) -> None:
        span = element.value_span(attribute) if attribute in element.attributes else element.tag_span()
        self.findings.append(Diagnostic(code, message, element.source, span, **advice))  # type: ignore[arg-type]


def _package_share(package: str) -> Path | None:
    """Return a ROS package's share folder by the ament index of the sourced workspaces."""
    if Path(package).name != package or package in ("", ".", ".."):
        return None
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        marker = Path(prefix) / "share" / "ament_index" / "resource_index" / "packages" / package
        if prefix and marker.is_file():
            return Path(prefix) / "share" / package
    return None
