"""`sar-compile diff`: show the differences between two tree files."""

import argparse

from sar_compiler.cli.arguments import TREE_INPUT
from sar_compiler.cli.loading import INPUT_HELP
from sar_compiler.commands import FINDINGS, OK, print_text


def add_diff(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `diff`."""
    parser.add_argument("old", type=TREE_INPUT, metavar="A", help=f"{INPUT_HELP}, before the change")
    parser.add_argument("new", type=TREE_INPUT, metavar="B", help=f"{INPUT_HELP}, after it")
    parser.set_defaults(run=diff_files)


def diff_files(arguments: argparse.Namespace) -> int:
    """Compare two files and return the exit status: 0 for equal ones, 1 for different ones.

    Raises:
        TreeError: If a file is malformed.
        UnreadableFileError: If a file does not exist or cannot be read.
    """
    from sar_compiler.tree.difference import difference, difference_as_text
    from sar_compiler.tree.gathering import find_tree, read_tree_file

    old, new = (read_tree_file(find_tree(name)) for name in (arguments.old, arguments.new))
    differences = difference(old, new)
    print_text(difference_as_text(differences), end="")
    return FINDINGS if differences else OK
