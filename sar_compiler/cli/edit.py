"""`sar-compile edit`: the graphical editor of a tree file, in the browser."""

import argparse

from sar_compiler.cli.arguments import TREE, add_page_options, add_project_options, additions
from sar_compiler.commands import OK, exit_on_interrupt, print_text


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `edit`."""
    parser.add_argument("file", type=TREE, metavar="FILE", help="a tree file in XML or YAML")
    parser.add_argument("--new", action="store_true", help="create FILE with an empty tree")
    add_page_options(parser)
    add_project_options(parser)
    parser.set_defaults(run=edit)


def edit(arguments: argparse.Namespace) -> int:
    """Serve the editor until Ctrl-C."""
    from sar_compiler.studio.edited_document import create_document
    from sar_compiler.tree.discovery import find_tree
    from sar_compiler.web.edit_page import serve_editor

    exit_on_interrupt()
    path, added = find_tree(arguments.file), additions(arguments)
    if arguments.new:
        create_document(path)
    serve_editor(path, added, print_text, arguments.web_port, opens=arguments.open)
    return OK
