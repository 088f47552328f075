"""`sar-compile`: check, show, convert and describe trees; works without ROS."""

import argparse
import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import FINDINGS, OK, USAGE, Parser, run
from sar_compiler.cli.convert import convert_file
from sar_compiler.cli.diff import diff_files
from sar_compiler.cli.explain import add_explain
from sar_compiler.cli.format import format_files
from sar_compiler.cli.loading import FILE_HELP, add_nodes, add_project_options, workspace
from sar_compiler.cli.simulate import add_simulate
from sar_compiler.cli.validate import add_validate
from sar_compiler.cli.verify import add_verify

if TYPE_CHECKING:
    from sar_compiler.nodes.registry import Registry

PROG = "sar-compile"


def main(argv: Sequence[str] | None = None) -> int:
    """Run `sar-compile` and return its exit status."""
    arguments = _parser().parse_args(argv)
    return run(lambda: int(arguments.run(arguments)), PROG)


def _parser() -> Parser:
    parser = Parser(PROG, "Check, show and describe behaviour trees, before a robot moves.")
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=argparse.ArgumentParser
    )
    shared = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    add_nodes(shared)

    def command(name: str, help_text: str) -> argparse.ArgumentParser:
        return commands.add_parser(
            name, help=help_text, description=help_text, parents=[shared], allow_abbrev=False
        )

    add_validate(command("validate", "Say everything that is wrong with tree files."))

    show = command("show", "Show the compiled tree.")
    show.add_argument("file", metavar="FILE", help=FILE_HELP)
    add_project_options(show)
    show.add_argument("--tree", metavar="ID", help="the tree to show (default: the one the file executes)")
    show.add_argument(
        "--format",
        choices=("unicode", "ascii", "json"),
        default="unicode",
        help="a drawing, or nested nodes with their attributes and places in the file",
    )
    show.set_defaults(run=_show)

    convert = command("convert", "Write a tree file in another form; says what that cannot have.")
    convert.add_argument("file", metavar="FILE", help=FILE_HELP)
    convert.add_argument(
        "--to",
        choices=("xml", "yaml", "btcpp"),
        required=True,
        help="the form to write; btcpp: XML that BehaviorTree.CPP 4 and Groot2 open",
    )
    add_project_options(convert)
    convert.add_argument("-o", "--output", metavar="OUT", help="the file to write (default: standard output)")
    convert.set_defaults(run=convert_file)

    formatting = command("format", "Write tree files in their canonical form; comments stay.")
    formatting.add_argument("files", nargs="+", metavar="FILE", help="a tree file")
    formatting.add_argument(
        "--check", action="store_true", help="write nothing; name the files that would change"
    )
    formatting.set_defaults(run=format_files)

    diff = command("diff", "Say what is different between two trees, whatever their form.")
    diff.add_argument("old", metavar="A", help=FILE_HELP)
    diff.add_argument("new", metavar="B", help=FILE_HELP)
    diff.set_defaults(run=diff_files)

    add_simulate(
        command("simulate", "Tick the tree without ROS: scripted runs, and whether they went as expected.")
    )

    add_verify(command("verify", "Go through all possible runs of a tree; prove what holds in every one."))

    add_explain(command("explain", "Say what a finding means, with an example."))

    nodes = command("nodes", "Say what can be written in a tree file.")
    nodes.add_argument("tag", nargs="?", metavar="TAG", help="describe this one with its attributes")
    nodes.add_argument(
        "--format",
        choices=("text", "json", "groot2"),
        default="text",
        help="for people, for scripts, or as a palette for Groot2",
    )
    nodes.set_defaults(run=_nodes)

    schema = command("schema", "Print the schema of tree files, for editors and other tools.")
    schema.add_argument(
        "--format", choices=("xsd", "json"), default="xsd", help="for files in XML, or for those in YAML"
    )
    schema.set_defaults(run=_schema)
    return parser


def _show(arguments: argparse.Namespace) -> int:
    from sar_compiler.tree.diagnostic import TreeError
    from sar_compiler.views.outline import outline
    from sar_compiler.views.text import ascii_tree, unicode_tree

    try:
        # `validate` warns of the doubtful cases.
        tree = workspace(arguments).load(arguments.file).preview(arguments.tree)
    except TreeError as error:
        print(error, file=sys.stderr)
        return FINDINGS
    if arguments.format == "json":
        print(json.dumps(outline(tree), indent=2, ensure_ascii=False))
    else:
        draw = ascii_tree if arguments.format == "ascii" else unicode_tree
        print(draw(tree.root), end="")
    return OK


def _nodes(arguments: argparse.Namespace) -> int:
    from sar_compiler.views.nodes import nodes_as_json, nodes_as_text
    from sar_compiler.views.palette import palette

    registry = _registry(arguments)
    if arguments.tag is not None and arguments.tag not in registry:
        near = registry.nearest(arguments.tag)
        advice = f"; did you mean '{near}'?" if near else ""
        print(f"{PROG}: no node is called '{arguments.tag}'{advice}", file=sys.stderr)
        return USAGE
    specs = list(registry) if arguments.tag is None else registry.variants(arguments.tag)
    if arguments.format == "groot2":
        print(palette(specs), end="")
        return OK
    print(nodes_as_json(specs) if arguments.format == "json" else nodes_as_text(specs))
    return OK


def _schema(arguments: argparse.Namespace) -> int:
    from sar_compiler.nodes.schemas.json_schema import json_schema
    from sar_compiler.nodes.schemas.xml_schema import xml_schema

    registry = _registry(arguments)
    if arguments.format == "json":
        print(json.dumps(json_schema(registry), indent=2, ensure_ascii=False))
    else:
        print(xml_schema(registry), end="")
    return OK


def _registry(arguments: argparse.Namespace) -> "Registry":
    from sar_compiler.nodes.registry import load_registry

    return load_registry(arguments.nodes)


if __name__ == "__main__":
    sys.exit(main())
