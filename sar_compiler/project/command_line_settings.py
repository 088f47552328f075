"""The user's additions to the configurations of projects."""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from sar_compiler.nodes.registry import Named, Registry


class CommandLineSettings(NamedTuple):
    """The user's additions to any project's configuration, which may refer to any file.

    Attributes:
        nodes: Leaves: import paths of modules, which may be in the current folder; modules; classes.
        models: Palettes, which describe nodes that are not installed: files, or names of installed ones
            (`nav2:jazzy`).
        include_path: Further folders from which files may be included.
        trust: Whether the modules beside configurations may run, now and until they change.
        registry: The registered nodes; None for the installed and named ones.
        trees: Further tree files, searched for trees that a file lacks.
        mission: The name of the mission, which overrides the requirements of the leaves; None if these determine it.
        folders: Folders that the user has named; the files in one belong together, like those of a repository.
        names: The tree files as the user has named them, for their findings.
        is_isolated: Whether the surroundings of a file are ignored: configuration, palettes and trees around it.
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
        """The installed palettes."""
        from sar_compiler.nodes.palettes import is_palette_name

        return tuple(str(each) for each in self.models if is_palette_name(str(each)))
