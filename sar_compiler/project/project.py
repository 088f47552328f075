"""Combines a project's configuration with the settings from the command line."""

import contextlib
import functools
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from sar_compiler.checks import check_palettes
from sar_compiler.nodes.installed import has_entry_point
from sar_compiler.nodes.models import (
    described_specs,
    enums_file,
    supplements,
    undeclared_names,
    undescribed_tags,
)
from sar_compiler.nodes.palettes import PaletteError, is_palette_name, load_palettes
from sar_compiler.nodes.registry import ENTRY_POINTS, Registry, is_library_tag, load_registry
from sar_compiler.opener import TREE, NamedPath, UnreadableFileError, is_there, read_file
from sar_compiler.project.command_line_settings import CommandLineSettings
from sar_compiler.project.surroundings import FileSurroundings
from sar_compiler.tree.content import as_written, real_path
from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.discovery import matching_files, read_tree_file
from sar_compiler.tree.forest import Forest, Read, TreeSet
from sar_compiler.tree.model import TreeFile


class Project:
    """The settings that all tree files with the same configuration share.

    Attributes:
        configuration: The configuration of the tree files.
        checkout: The folder whose code is not trusted: the repository, or the configuration's folder.
        files_around: The palettes and tree files in the surrounding folders. They can be used without being named.
        used_palettes: The paths of the surrounding palettes that were used.
        used_trees: The paths of the surrounding tree files that were used.
        additions: The settings on the command line.
        tree_set: The files that are searched for trees that a file lacks; None if there are no such files.
    """

    def __init__(
        self,
        surroundings: FileSurroundings,
        additions: CommandLineSettings,
        read: Read,
    ) -> None:
        self.configuration, self.checkout, self.files_around = surroundings
        self.additions = additions
        self.used_palettes: dict[Path, None] = {}
        self.used_trees: dict[Path, None] = {}
        self._names = {real_path(each): each for each in additions.names}
        self.tree_set: TreeSet | None = None
        self._read = read
        self.reload_set()

    def reload_set(self) -> None:
        """Discard the files of the set. They are loaded again when a tree is next searched for in them."""
        if self.configuration.trees or self.additions.trees or self.files_around.folder is not None:
            is_declared = bool(self.configuration.trees)
            self.tree_set = TreeSet(self._set_files, self._read, self.include_path, is_declared=is_declared)

    @functools.cached_property
    def registry(self) -> Registry:
        """The registered nodes.

        Raises:
            TreeError: If the configuration names modules that are neither installed nor trusted, or a palette that is not
                installed.
            RegistryError: If a module cannot be imported or has no leaves.
            TrustError: If trust cannot be recorded.
            PaletteError: If the user has named a palette that is not installed.
        """
        if self.additions.registry is not None:
            return self.additions.registry
        wanted = [each for each in self.configuration.nodes if each not in self.additions.nodes]
        brought = [each for each in wanted if not has_entry_point(each, ENTRY_POINTS, self.checkout)]
        if brought:
            self._require_trust(brought)
        palettes = (*self.additions.palettes, *self.configuration.palettes)
        try:
            return load_registry(self.additions.nodes, wanted, self.checkout, palettes)
        except PaletteError:
            for name in self.configuration.palettes:
                with self._locate_palette_errors(name):
                    load_palettes([name], self.checkout)
            raise

    def _require_trust(self, modules: list[str]) -> None:
        """Make modules in the configuration's folder importable, or raise an error if they are not trusted."""
        from sar_compiler.project.trust import ConfigurationCode

        path = self.configuration.path
        assert path is not None  # noqa: S101 - it has named the modules
        content = ConfigurationCode.from_configuration(path, modules)
        if self.additions.trust:
            content.trust()
        elif not content.is_trusted:
            raise TreeError([self._trust_finding(each, modules) for each in modules])
        content.make_importable()

    def _trust_finding(self, module: str, modules: Sequence[str]) -> Diagnostic:
        message = (
            f"the module '{module}' is not trusted, because no installed package registers it (entry point '{ENTRY_POINTS}'). "
            "Code beside a configuration file is not trusted automatically"
        )
        options = " ".join(f"--nodes {each}" for each in modules)
        hint = (
            f"add {options} to the command, or first install the package with pip. "
            "--trust runs the code in this folder until it changes"
        )
        source, span = self.configuration.source, self.configuration.spans[module]
        return Diagnostic("untrusted-nodes", message, source, span, hint=hint)

    @functools.cached_property
    def palettes(self) -> tuple[TreeFile, ...]:
        """The palette files that the user or the configuration names.

        Raises:
            UnreadableFileError: If a file that the user has named does not exist or cannot be read.
            TreeError: If a palette is malformed, or if the configuration names a palette that cannot be read.
        """
        files = [path for path in self.additions.models if not is_palette_name(str(path))]
        read = [read_tree_file(path) for path in files]
        for path in self.configuration.models:
            with self._locate_palette_errors(str(path)):
                read.append(read_tree_file(path))
        if self.configuration.enums:
            read.append(enums_file(self.configuration.enums))
        return tuple(read)

    @contextlib.contextmanager
    def _locate_palette_errors(self, palette: str) -> Iterator[None]:
        """Convert errors about a palette to findings at the palette's name in the configuration."""
        try:
            yield
        except (UnreadableFileError, PaletteError) as error:
            source, span = self.configuration.source, self.configuration.spans[palette]
            raise TreeError([Diagnostic("setting-not-found", str(error), source, span)]) from error

    @functools.cached_property
    def _palettes_around(self) -> tuple[TreeFile, ...]:
        """The palettes in the surrounding folders, except malformed ones."""
        found = []
        for path in self.files_around.palettes:
            with contextlib.suppress(TreeError, UnreadableFileError):
                found.append(read_tree_file(path))
        return tuple(found)

    def palettes_for(self, forest: Forest) -> tuple[TreeFile, ...]:
        """Return the named palettes, and the surrounding palettes that describe the undescribed nodes of a file.

        Raises:
            TreeError, UnreadableFileError: As `palettes`.
        """
        own = [_real_path(each) for each in forest.files]
        named = tuple(each for each in self.palettes if _real_path(each) not in own)
        tags = undescribed_tags([*forest.files, *forest.others], named)
        wanted = {tag for tag in tags if tag not in self.registry or is_library_tag(tag)}
        names = undeclared_names([*forest.files, *forest.others], named)
        if not wanted and not names:
            return named

        around = [each for each in self._palettes_around if _real_path(each) not in own]
        nearest = sorted(around, key=lambda each: -len(os.path.commonpath([_real_path(each).parent, own[0]])))
        found = list(supplements(nearest, wanted, names))
        self.used_palettes |= dict.fromkeys(Path(each.source.path) for each in found)
        return (*named, *found)

    @functools.cached_property
    def findings(self) -> list[Diagnostic]:
        """The findings about the named palettes. They are the same for every tree of the project."""
        return self.configuration.decide(check_palettes(self.palettes, self.registry))

    @functools.cached_property
    def vocabulary(self) -> Registry:
        """All nodes that a tree can use: the registered nodes and the nodes that palettes describe.

        Raises:
            TreeError: If a palette has errors, or the configuration names modules that are not trusted.
            UnreadableFileError: If a palette cannot be read.
        """
        if any(each.severity is Severity.ERROR for each in self.findings):
            raise TreeError(self.findings)
        described = described_specs([*self.palettes, *self._palettes_around], self.registry)
        return Registry([*self.registry.specs(), *described]) if described else self.registry

    def _set_files(self) -> Iterator[Path]:
        """Yield the paths of the tree files in the project's set.

        Raises:
            UnreadableFileError: If a file or a folder that the configuration names does not exist or cannot be read.
        """
        yield from self.additions.trees
        if not self.configuration.trees:
            yield from (self._names.get(real_path(each), each) for each in self.files_around.trees)
        for folder, pattern in self.configuration.trees:
            for path in map(as_written, matching_files(folder, pattern)):
                if not is_there(path):
                    read_file(path, TREE)  # raises with the reason
                place = real_path(path)
                if place.is_relative_to(self.checkout):
                    yield self._names.get(place) or NamedPath.confined_to(path, (self.checkout,))

    def report_use(self, forest: Forest) -> None:
        """Record the surrounding files that provide trees that the file itself lacks."""
        if self.configuration.trees:
            return
        given = {*map(real_path, self.additions.trees), *self._names}
        used = {Path(home.main.source.path): home.path for home in forest.homes.values()}
        self.used_trees |= dict.fromkeys(path for path, place in used.items() if place not in given)

    @property
    def include_path(self) -> tuple[Path, ...]:
        """The additional folders from which tree files may include files."""
        root = self.files_around.root
        return (*self.additions.include_path, *self.configuration.include_path, *([root] if root else []))


def _real_path(tree_file: TreeFile) -> Path:
    return real_path(Path(tree_file.source.path))
