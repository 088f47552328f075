"""`sar-compile diff`: show the differences between two tree files."""

import argparse
import sys

from sar_compiler.cli.loading import FILE_HELP
from sar_compiler.cli.terminal import findings_as_text
from sar_compiler.commands import FINDINGS, OK, USAGE, print_text


def add_diff(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `diff`."""
    parser.add_argument("old", metavar="A", help=f"{FILE_HELP}, before the change")
    parser.add_argument("new", metavar="B", help=f"{FILE_HELP}, after it")
    parser.set_defaults(run=diff_files)


def diff_files(arguments: argparse.Namespace) -> int:
    """Compare two files and return the exit status: 0 for equal ones, 1 for different ones.

    An invalid file counts as wrong usage, 2, since the differences are unknown.

    Raises:
        UnreadableFileError: If a file does not exist or cannot be read.
    """
    from sar_compiler.tree.diagnostic import TreeError
    from sar_compiler.tree.difference import difference, difference_as_text
    from sar_compiler.tree.gathering import find_tree
    from sar_compiler.tree.reading import read_tree_file

    try:
        old, new = (read_tree_file(find_tree(name)) for name in (arguments.old, arguments.new))
    except TreeError as error:
        print(findings_as_text(error.findings, sys.stderr), file=sys.stderr)
        return USAGE
    differences = difference(old, new)
    print_text(difference_as_text(differences), end="")
    return FINDINGS if differences else OK
