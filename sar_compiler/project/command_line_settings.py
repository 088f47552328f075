"""Defines the settings from the command line. They supplement the configuration of a project."""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from sar_compiler.nodes.registry import Named, Registry


class CommandLineSettings(NamedTuple):
    """The settings from the command line.

    They supplement every project's configuration, and may name any file.

    Attributes:
        nodes: The leaves: classes, modules, or import paths of modules, which may be in the current folder.
        models: The palettes, which describe nodes that are not installed: paths, or names of installed palettes (`nav2:jazzy`).
        include_path: Further folders from which files may be included.
        trust: Whether to trust the modules beside configurations, until their code changes.
        registry: The registered nodes; None for the installed nodes and those in *nodes*.
        trees: Further tree files. They are searched for the trees that a file lacks.
        mission: The name of the mission; None if the leaves of the tree determine the mission.
        folders: Folders that the user has named. The files in each of them belong together, like those of a repository.
        names: The paths of tree files as the user has written them, for findings.
        is_isolated: Whether to ignore the configuration, the palettes and the trees in the folders around a tree file.
    """

    nodes: "tuple[Named, ...]" = ()
    models: tuple[Path, ...] = ()
    include_path: tuple[Path, ...] = ()
    trust: bool = False
    registry: "Registry | None" = None
    trees: tuple[Path, ...] = ()
    mission: str | None = None
    folders: tuple[Path, ...] = ()
    names: tuple[Path, ...] = ()
    is_isolated: bool = False

    @property
    def palettes(self) -> tuple[str, ...]:
        """The entries of `models` that are names of installed palettes."""
        from sar_compiler.nodes.palettes import is_palette_name

        return tuple(str(each) for each in self.models if is_palette_name(str(each)))
