"""`sar-compile format`: write tree files in their canonical form."""

import argparse
import sys
from pathlib import Path

from sar_compiler.cli.arguments import FINDINGS, OK, USAGE


def add_format(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `format`."""
    parser.add_argument("files", nargs="+", metavar="FILE", help="a tree file")
    parser.add_argument(
        "--check", action="store_true", help="write nothing; name the files that would change"
    )
    parser.set_defaults(run=format_files)


def format_files(arguments: argparse.Namespace) -> int:
    """Rewrite files, or with `--check` list those that would change; return the exit status.

    Raises:
        WriteError: If a file cannot be written.
    """
    from sar_compiler.tree.diagnostic import TreeError, UnreadableFileError

    status = OK
    for name in arguments.files:
        try:
            differs = _format(name, write=not arguments.check)
        except UnreadableFileError as error:
            print(f"sar-compile: {error}", file=sys.stderr)
            status = USAGE
        except TreeError as error:
            print(error, file=sys.stderr)
            status = max(status, FINDINGS)
        else:
            if differs:
                print(f"{Path(name)}: {'is not in canonical form' if arguments.check else 'written anew'}")
            if differs and arguments.check:
                status = max(status, FINDINGS)
    return status


def _format(name: str, *, write: bool) -> bool:
    """Return whether a file differs from its canonical form, and rewrite it if requested."""
    from sar_compiler.cli.writing import write_text
    from sar_compiler.tree.content import read_bytes
    from sar_compiler.tree.conversion import convert
    from sar_compiler.tree.reading import read_tree_file
    from sar_compiler.tree.shipped import path_named

    path = path_named(name)
    tree_file = read_tree_file(path)
    text = convert(tree_file, tree_file.source.form).text
    differs = read_bytes(path) != text.encode()
    if differs and write:
        write_text(path, text)
    return differs
