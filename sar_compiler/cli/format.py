"""`sar-compile format`: format tree files canonically."""

import argparse
import sys
from pathlib import Path

from sar_compiler.cli.arguments import TREE_INPUT
from sar_compiler.commands import FINDINGS, OK, USAGE, print_error, print_text
from sar_compiler.opener import STANDARD_INPUT, TREE, UnreadableFileError, read_file
from sar_compiler.terminal import findings_as_text
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.discovery import parse_tree, path_for_name
from sar_compiler.writing import write_bytes


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `format`."""
    text = "a tree file, or - to read standard input and write its canonical form to standard output"
    parser.add_argument("files", nargs="+", type=TREE_INPUT, metavar="FILE", help=text)
    text = "list the files that are not in canonical form, without changing them; the exit status is 1 if there are any"
    parser.add_argument("--check", action="store_true", help=text)
    parser.set_defaults(run=format_files)


def format_files(arguments: argparse.Namespace) -> int:
    """Rewrite files, or only list the files that are not in canonical form; return the exit status.

    Raises:
        WriteError: If a file cannot be written.
    """
    return max(_format_file(name, check=arguments.check) for name in arguments.files)


def _format_file(name: str, *, check: bool) -> int:
    """Rewrite a file, or report that the file is not in canonical form; return the exit status."""
    try:
        differs = _rewrite(name, write=not check)
    except UnreadableFileError as error:
        print_error(f"sar-compile: {error}")
        return USAGE
    except TreeError as error:
        print(findings_as_text(error.findings, sys.stderr), file=sys.stderr)
        return FINDINGS
    if differs and (check or Path(name) != STANDARD_INPUT):
        print_text(f"{Path(name)}: {'is not in canonical form' if check else 'rewritten'}")
    return FINDINGS if differs and check else OK


def _rewrite(name: str, *, write: bool) -> bool:
    """Return whether a file differs from its canonical form. If *write* is true, write the canonical form."""
    from sar_compiler.tree.conversion import canonical_bytes

    path = path_for_name(name)
    written = read_file(path, TREE).data
    data = canonical_bytes(parse_tree(written, str(path)))
    differs = written != data
    if write and path == STANDARD_INPUT:
        sys.stdout.buffer.write(data)
    elif write and differs:
        write_bytes(path, data)
    return differs
