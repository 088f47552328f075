"""`sar-compile convert`: convert a tree file to another format."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import FILE, INPUT_HELP, TREE_INPUT, add_project_options, workspace
from sar_compiler.commands import FINDINGS, OK
from sar_compiler.tree.diagnostic import Form, Severity
from sar_compiler.writing import WriteError, same_file, write_text

if TYPE_CHECKING:
    from sar_compiler.tree.conversion import ConvertedTree


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `convert`."""
    add = parser.add_argument
    add("file", type=TREE_INPUT, metavar="FILE", help=INPUT_HELP)
    text = "the output format: XML, YAML, or XML for BehaviorTree.CPP 4 and Groot2 (btcpp)"
    add("--to", choices=("xml", "yaml", "btcpp"), required=True, help=text)
    add_project_options(parser)
    add("-o", "--output", type=FILE, metavar="OUT", help="the file to write (default: standard output)")
    parser.set_defaults(run=convert_file)


def convert_file(arguments: argparse.Namespace) -> int:
    """Convert a tree file and return the exit status.

    Content without a counterpart in the other format is reported on standard error. The status is 1 if the result needs more than
    BehaviorTree.CPP itself provides; the result is written nevertheless.

    Raises:
        WriteError: If the output is the input file, or cannot be written.
        UnreadableFileError: If the file does not exist or cannot be read.
    """
    from sar_compiler.tree.discovery import find_tree

    path = find_tree(arguments.file)
    output: Path | None = arguments.output
    if output is not None and same_file(path, output):
        raise WriteError(f"{output} is the input file. Name another file with -o")
    converted = _convert(path, arguments)
    for loss in converted.losses:
        print(loss.render(), file=sys.stderr)
    if output is None:
        sys.stdout.buffer.write(converted.text.encode())
        sys.stdout.flush()
    else:
        write_text(output, converted.text)
    return OK if all(loss.severity is Severity.INFO for loss in converted.losses) else FINDINGS


def _convert(path: Path, arguments: argparse.Namespace) -> "ConvertedTree":
    if arguments.to == "btcpp":
        from sar_compiler.checks.btcpp_conversion import convert_to_btcpp

        loader = workspace(arguments)
        tree = loader.load(path)
        project, palettes = tree.project, tree.palettes
        loader.report_use()
        return convert_to_btcpp(tree.forest, project.registry, palettes, project.configuration.btcpp)
    from sar_compiler.tree.conversion import convert
    from sar_compiler.tree.discovery import read_tree_file

    return convert(read_tree_file(path), Form(arguments.to))
