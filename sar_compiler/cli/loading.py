"""What commands that read trees have in common: their options, and what these mean."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sar_compiler.tree.forest import Forest
    from sar_compiler.tree.model import TreeFile

FILE_HELP = "a tree file, or the name of a shipped tree"


def add_include_path(parser: argparse.ArgumentParser) -> None:
    """Add `--include-path`."""
    parser.add_argument(
        "--include-path",
        action="append",
        default=[],
        type=Path,
        metavar="FOLDER",
        help="a further folder that files may be included from (besides the file's own); may be repeated",
    )


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add `--model`."""
    parser.add_argument(
        "--model",
        action="append",
        default=[],
        type=Path,
        metavar="NODES.xml",
        help="a palette: a file whose TreeNodesModel describes nodes that are not installed; may be repeated",
    )


def configured(arguments: argparse.Namespace) -> argparse.Namespace:
    """Return the arguments of a command on one tree file, with what the file's project adds to them.

    Raises:
        TreeError: If the project's configuration has mistakes.
        UnreadableFileError: If that, or the tree file, cannot be read.
    """
    if "file" not in arguments:
        return arguments
    from sar_compiler.checks.configuration import configuration_for
    from sar_compiler.tree.shipped import find_tree

    configuration = configuration_for(find_tree(arguments.file))
    added = {
        "nodes": configuration.nodes,
        "model": configuration.models,
        "include_path": configuration.include_path,
    }
    for name, values in added.items():
        if name in arguments:
            setattr(arguments, name, [*getattr(arguments, name), *values])
    return arguments


def load(name: str, arguments: argparse.Namespace) -> "Forest":
    """Read a tree file that a user means, and everything that it includes.

    Raises:
        UnreadableFileError: If the file is not there or cannot be read.
        TreeError: If it is malformed.
    """
    from sar_compiler.tree.forest import load_forest
    from sar_compiler.tree.reading import read_tree_file
    from sar_compiler.tree.shipped import find_tree

    return load_forest(find_tree(name), read_tree_file, arguments.include_path)


def palettes(arguments: argparse.Namespace) -> "list[TreeFile]":
    """Read the palettes that were given.

    Raises:
        UnreadableFileError: If one is not there or cannot be read.
        TreeError: If one is malformed.
    """
    from sar_compiler.tree.reading import read_tree_file

    return [read_tree_file(path) for path in arguments.model]
