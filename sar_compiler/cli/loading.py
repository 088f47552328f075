"""The common options of commands that read trees."""

import argparse
import atexit
import gc
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.commands import print_error
from sar_compiler.tree.gc_pause import LARGE, gc_paused

if TYPE_CHECKING:
    from sar_compiler.cli.run import Options
    from sar_compiler.project import Additions, Workspace

FILE_HELP = "a tree file, or the name of a shipped tree"
INPUT_HELP = "a tree file, the name of a shipped tree, or - for standard input"
FORMAT_HELP = "for people (default text), or for scripts"
PROJECT_OPTIONS = "options that add to the project's configuration"
"""The title of these options in `--help`; the page of the commands says them once."""


def tree_file(name: str) -> str:
    """Return the name of a tree file as it is read: for `-` that of standard input."""
    from sar_compiler.tree.content import STANDARD_INPUT

    return str(STANDARD_INPUT) if name == "-" else name


def add_project_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that extend a project's configuration."""
    options = add_vocabulary_options(parser)
    options.add_argument(
        "--include-path",
        action="append",
        default=[],
        type=Path,
        metavar="FOLDER",
        help="a further folder that tree files may be included from (besides the file's own); may be repeated",
    )


def add_vocabulary_options(parser: argparse.ArgumentParser) -> "argparse._ArgumentGroup":
    """Add those of these options that decide which nodes there are; return their group."""
    options = parser.add_argument_group(PROJECT_OPTIONS)
    options.add_argument(
        "--nodes",
        action="append",
        default=[],
        metavar="PKG.MOD",
        help="load a module of leaves (installed, or in the current folder); may be repeated",
    )
    options.add_argument(
        "--model",
        action="append",
        default=[],
        type=Path,
        metavar="NODES.xml",
        help="a palette, which describes nodes that are not installed: a file with a TreeNodesModel, or the nodes of a "
        "distribution of Nav2 (nav2:jazzy, nav2:kilted, nav2:main); may be repeated",
    )
    options.add_argument(
        "--trust",
        action="store_true",
        help="run the modules of leaves that the project's own configuration names and brings along, now and until "
        "one of them changes",
    )
    return options


def add_mission(parser: argparse.ArgumentParser) -> None:
    """Add `--mission`."""
    parser.add_argument(
        "--mission",
        metavar="NAME",
        help="the mission, where the leaves of the tree do not say which one it is",
    )


def workspace(
    arguments: argparse.Namespace,
    trees: tuple[Path, ...] = (),
    found_models: tuple[Path, ...] = (),
) -> "Workspace":
    """Return the workspace that loads trees by the options of a command.

    Args:
        arguments: The options.
        trees: Tree files, in which a tree is sought that one of them lacks.
        found_models: Palettes that lie in the folders of the tree files.
    """
    # The collector would look several times through what is imported, and find nothing; so it would afterwards and at the end.
    with gc_paused(LARGE):
        from sar_compiler.project import Workspace
    atexit.register(gc.freeze)

    added = additions(arguments)._replace(trees=trees, found_models=found_models)
    return Workspace(added, note=tell_note)


def additions(arguments: "argparse.Namespace | Options") -> "Additions":
    """Return what the options of a command add to a project's configuration."""
    from sar_compiler.project import Additions

    models, folders = tuple(arguments.model), tuple(arguments.include_path)
    mission = getattr(arguments, "mission", None)  # which not every command needs
    return Additions(tuple(arguments.nodes), models, folders, arguments.trust, mission=mission)


def tell_note(text: str) -> None:
    """Report on standard error what is surprising, but no mistake."""
    print_error(f"note: {text}")


def add_params(parser: argparse.ArgumentParser) -> None:
    """Add `--params`."""
    parser.add_argument(
        "--params",
        type=Path,
        metavar="FILE",
        help="the mission's ROS 2 parameter file, as sar-run takes it: it decides facts and {@parameters}",
    )
