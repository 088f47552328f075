"""The common options of commands that read trees."""

import argparse
import atexit
import gc
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import FOLDER, PALETTE, YAML_FILE, ArgumentKind
from sar_compiler.commands import print_error
from sar_compiler.tree.gc_pause import LARGE, gc_paused

if TYPE_CHECKING:
    from sar_compiler.project import Additions, Workspace

FILE_HELP = "a tree file, or the name of a shipped tree"
INPUT_HELP = "a tree file, the name of a shipped tree, or - for standard input"
FORMAT_HELP = "for people (default text), or for scripts"
PROJECT_OPTIONS = "options that add to the project's configuration"
"""The title of these options in `--help`; the page of the commands says them once."""


def add_project_options(parser: argparse.ArgumentParser) -> tuple[argparse.Action, argparse.Action]:
    """Add the options that extend a project's configuration; return those that few need."""
    options, trust = add_vocabulary_options(parser)
    text = "a further folder that tree files may be included from (besides the file's own); may be repeated"
    folder = options.add_argument(
        "--include-path", action="append", default=[], type=FOLDER, metavar="FOLDER", help=text
    )
    return trust, folder


def add_vocabulary_options(
    parser: argparse.ArgumentParser,
) -> "tuple[argparse._ArgumentGroup, argparse.Action]":
    """Add those of these options that decide which nodes there are; return their group, and `--trust`."""
    options = parser.add_argument_group(PROJECT_OPTIONS)
    add = options.add_argument
    text = "load a module of leaves (installed, or in the current folder); may be repeated"
    add("--nodes", action="append", default=[], type=ArgumentKind("module"), metavar="PKG.MOD", help=text)
    text = (
        "a palette, which describes nodes that are not installed: a file with a TreeNodesModel, or the nodes of a "
        "distribution of Nav2 (nav2:jazzy, nav2:kilted, nav2:main); may be repeated"
    )
    add("--model", action="append", default=[], type=PALETTE, metavar="NODES.xml", help=text)
    text = (
        "run the modules of leaves that the project's own configuration names and brings along, now and until "
        "one of them changes"
    )
    return options, add("--trust", action="store_true", help=text)


def add_mission(parser: "argparse.ArgumentParser | argparse._ArgumentGroup") -> None:
    """Add `--mission`."""
    text = "the mission, where the leaves of the tree do not say which one it is"
    parser.add_argument("--mission", type=ArgumentKind("mission"), metavar="NAME", help=text)


def workspace(
    arguments: argparse.Namespace, trees: tuple[Path, ...] = (), found_models: tuple[Path, ...] = ()
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


def additions(arguments: argparse.Namespace) -> "Additions":
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
    text = "the mission's ROS 2 parameter file, as sar-run takes it: it decides facts and {@parameters}"
    parser.add_argument("--params", type=YAML_FILE, metavar="FILE", help=text)
