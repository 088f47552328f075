"""`sar-compile`: check, show, convert and describe trees; works without ROS."""

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sar_compiler.cli.arguments import (
    FILE,
    FOLDER,
    FORMAT_HELP,
    INPUT_HELP,
    TREE_INPUT,
    ArgumentKind,
    add_budget,
    add_project_options,
    add_tree_id,
    add_vocabulary_options,
    budget_of,
    report_findings,
    workspace,
)
from sar_compiler.cli.parser import Parser
from sar_compiler.commands import (
    FINDINGS,
    LIMITS_VARIABLE,
    OK,
    USAGE,
    add_version,
    interruptible,
    is_tree_error,
    print_error,
    print_text,
    run,
)
from sar_compiler.errors import SarError
from sar_compiler.gc_pause import gc_paused
from sar_compiler.resources import require_tree_file
from sar_compiler.terminal import findings_as_text, painter

if TYPE_CHECKING:
    from sar_compiler.compiler.sketch import Drawable
    from sar_compiler.nodes.registry import Registry
    from sar_compiler.project import ProjectTree
    from sar_compiler.tree.diagnostic import Diagnostic, TreeError

PROG = "sar-compile"
_COMMANDS = {
    "validate": "Report all errors in tree files.",
    "show": "Draw a tree, even if its file has errors, and report the findings.",
    "convert": "Convert a tree file to another format, and report what is lost.",
    "format": "Format tree files canonically, and keep their comments.",
    "diff": "Show the differences between two trees, whose files may have different formats.",
    "simulate": "Simulate scripted runs without ROS, and check their expectations.",
    "sweep": "Simulate many runs with random outcomes, without ROS, and print the success rate and causes of failure.",
    "verify": "Explore all possible runs of a tree, and prove its properties.",
    "predict": "Compute how likely a tree is to succeed, how long its runs take, and which leaf outcomes influence these results most.",
    "conform": "Compare recorded runs with all possible runs of their tree, and print deviations and violated properties.",
    "approve": "Approve a version of a tree file for sar-run --approved.",
    "explain": "Explain a finding, with an example.",
    "nodes": "List the nodes that tree files can use, or describe one node and its attributes.",
    "schema": "Print the schema of tree files, for editors and other tools.",
    "edit": "Edit a tree file in the browser: drawing and text side by side, with findings, runs and proofs.",
    "lsp": "Offer findings, completion, renaming and more to an editor, through the Language Server Protocol.",
    "mcp": "Offer these commands as tools to an agent, through the Model Context Protocol.",
    "completion": "Print shell code that completes these commands with the Tab key.",
}
_STATUSES = (
    "Exit status: 0 without findings; 1 with findings; 2 wrong usage, or a missing or unreadable file; "
    "3 a check failed with an internal error (the other findings are reported)."
)
# The path of a finding about a command-line option begins with one of these prefixes.
_OPTION_SOURCES = ("--", "command line")
# The formats of `show` for which `views.drawing` has a function of the same name.
_PICTURES = ("svg", "mermaid", "dot")


def main(argv: Sequence[str] | None = None) -> int:
    """Run `sar-compile` and return its exit status."""
    return run(lambda: _run(sys.argv[1:] if argv is None else argv), PROG)


def _run(argv: Sequence[str]) -> int:
    interruptible()
    if LIMITS_VARIABLE in os.environ:
        from sar_compiler.agent.call_limits import limit_this_process

        limit_this_process(os.environ)
    with gc_paused():  # imports create no garbage
        arguments = _parser(argv).parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except SarError as error:
        if is_tree_error(error):
            return _print_findings(error)
        raise


def _print_findings(error: "TreeError") -> int:
    """Print the findings that make a file unusable, and return the exit status."""
    from sar_compiler.nodes.binding.nesting import UnknownTreeError

    if isinstance(error, UnknownTreeError):
        raise SarError(error.findings[0].message) from error
    print(findings_as_text(error.findings, sys.stderr), file=sys.stderr)
    is_usage = all(finding.source.path.startswith(_OPTION_SOURCES) for finding in error.findings)
    return USAGE if is_usage else FINDINGS


def _parser(argv: Sequence[str] = ()) -> Parser:
    """Return the parser. To save time, it contains only the subcommand that the arguments begin with.

    Without a known subcommand (`--help`, a typo), all subcommands are added, but without their arguments.
    """
    parser = Parser(PROG, "Check, show and describe behaviour trees, before a robot moves.", epilog=_STATUSES)
    add_version(parser)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", prog=PROG)
    named = [name for name in argv[:1] if name in _COMMANDS]
    for name in named or _COMMANDS:
        text = _COMMANDS[name]
        command = commands.add_parser(name, help=text, description=text)
        if argv and not named:
            continue
        if name in _ADD_ARGUMENTS:
            _ADD_ARGUMENTS[name](command)
        else:
            importlib.import_module(f"sar_compiler.cli.{name}").add_options(command)
    return parser


def _add_show(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=TREE_INPUT, metavar="FILE", help=INPUT_HELP)
    add_project_options(parser)
    add_tree_id(parser, "show")
    text = (
        "a text drawing (default unicode, or ascii), nested nodes with attributes and file locations (json), "
        "a picture (svg), or source for Mermaid or Graphviz (dot)"
    )
    forms = ("unicode", "ascii", "json", *_PICTURES)
    parser.add_argument("--format", choices=forms, default="unicode", help=text)
    text = "in a picture, draw each subtree as one node (use --tree to draw the content of a subtree)"
    parser.add_argument("--fold", action="store_true", help=text)
    text = "the file to write (default: standard output)"
    parser.add_argument("-o", "--output", type=FILE, metavar="OUT", help=text)
    add_budget(parser)
    parser.set_defaults(run=_show)


def _add_diff(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `diff`."""
    parser.add_argument("old", type=TREE_INPUT, metavar="A", help=f"the old tree: {INPUT_HELP}")
    parser.add_argument("new", type=TREE_INPUT, metavar="B", help=f"the new tree: {INPUT_HELP}")
    parser.add_argument("--format", choices=("text", "json"), default="text", help=FORMAT_HELP)
    add_budget(parser)
    parser.set_defaults(run=_diff)


def _add_explain(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `explain`."""
    text = "the code of a finding, which reports show in brackets after the severity"
    parser.add_argument("code", type=ArgumentKind("code"), metavar="CODE", help=text)
    parser.set_defaults(run=_explain)


def _add_nodes(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    text = "describe this node and its attributes (default: list all nodes)"
    add("tag", nargs="?", type=ArgumentKind("tag"), metavar="TAG", help=text)
    text = "text for people (default), json for scripts, groot2 for a Groot2 palette, or specs for a package's leaf_specs.json"
    add("--format", choices=("text", "json", "groot2", "specs"), default="text", help=text)
    text = "print a palette of the nodes in the trees of FOLDER that no palette or module describes; the ports are guessed"
    add("--from-use", type=FOLDER, metavar="FOLDER", help=text)
    add_vocabulary_options(parser)
    parser.set_defaults(run=_nodes, include_path=[])


def _add_schema(parser: argparse.ArgumentParser) -> None:
    text = "an XML Schema for XML files (xsd, default), or a JSON Schema for YAML files (json)"
    parser.add_argument("--format", choices=("xsd", "json"), default="xsd", help=text)
    add_vocabulary_options(parser)
    parser.set_defaults(run=_schema, include_path=[])


def _show(arguments: argparse.Namespace) -> int:
    if arguments.fold and arguments.format not in _PICTURES:
        print_error(f"{PROG}: --fold applies to pictures: add --format {', '.join(_PICTURES)}")
        return USAGE
    require_tree_file(arguments.file)
    loader = workspace(arguments)
    loaded = loader.load(arguments.file)
    try:
        findings, text = budget_of(arguments, patience_sec=0.0).run(lambda: _tree_drawing(loaded, arguments))
    finally:
        loader.report_use()
    if arguments.output is None:
        print(text, end="", flush=True)
    else:
        from sar_compiler.writing import write_text

        write_text(arguments.output, text)
    return report_findings(findings)


def _tree_drawing(loaded: "ProjectTree", arguments: argparse.Namespace) -> "tuple[list[Diagnostic], str]":
    """Return the findings about a file, and a drawing of its tree.

    Raises:
        TreeError: If the file is malformed, or does not contain a tree or the requested tree.
    """
    from sar_compiler.compiler.sketch import Sketch
    from sar_compiler.nodes.binding.nesting import UnknownTreeError
    from sar_compiler.tree.diagnostic import TreeError

    findings = loaded.check()
    if loaded.is_malformed:
        raise TreeError(findings)
    try:
        sketch = loaded.sketch(arguments.tree)
    except UnknownTreeError:
        raise
    except TreeError as error:
        raise TreeError([*findings, *error.findings]) from error
    others = [each for each in loaded.forest.trees if each != sketch.name]
    if arguments.tree is None and loaded.forest.main_tree() is None and others:
        print_error(f"note: this is the tree '{sketch.name}'. Show another with --tree: {', '.join(others)}")
    if isinstance(sketch, Sketch):
        findings = [*findings, *(each for each in sketch.findings if each not in findings)]
    return findings, _drawing(sketch, arguments.format, folded=arguments.fold)


def _drawing(tree: "Drawable", form: str, *, folded: bool) -> str:
    """Return a drawing of a tree in an output format of `show`."""
    if form not in _PICTURES:
        from sar_compiler.compiler.outline import outline_text

        return outline_text(tree, form)
    from sar_compiler.views import drawing

    picture: str = getattr(drawing, form)(tree, folded=folded)
    if form == "mermaid" and drawing.too_large(picture):
        print_error(f"{PROG}: this flowchart is too large for GitHub and GitLab. Use --format svg")
    return picture


def _diff(arguments: argparse.Namespace) -> int:
    """Compare two tree files and return the exit status: 0 if they are equal, otherwise 1.

    Raises:
        TreeError: If a file is malformed.
        UnreadableFileError: If a file does not exist or cannot be read.
    """
    from sar_compiler.tree.discovery import find_tree, read_tree_file
    from sar_compiler.views.difference import difference, difference_as_json, difference_as_text

    old, new = (read_tree_file(find_tree(name)) for name in (arguments.old, arguments.new))
    with gc_paused():  # otherwise the garbage collector scans both trees repeatedly
        differences = budget_of(arguments, patience_sec=0.0).run(lambda: difference(old, new))
    if arguments.format == "json":
        print(difference_as_json(differences))
    else:
        print_text(difference_as_text(differences), end="")
    return FINDINGS if differences else OK


def _explain(arguments: argparse.Namespace) -> int:
    """Print the page about findings with a given code, and return the exit status.

    Raises:
        SarError: If the code is unknown.
        ResourceError: If the pages are not installed.
    """
    from sar_compiler.tree.guessing import did_you_mean, nearest
    from sar_compiler.tree.kinds import KINDS
    from sar_compiler.views.findings import page_of, plain_text

    if arguments.code not in KINDS:
        advice = did_you_mean(nearest(arguments.code, KINDS))
        raise SarError(f"there is no finding code '{arguments.code}'{advice}")
    page = page_of(arguments.code)
    print(plain_text(page, painter(sys.stdout)) if sys.stdout.isatty() else page, end="")
    return OK


def _nodes(arguments: argparse.Namespace) -> int:
    if arguments.from_use is not None and arguments.format != "json":
        return _nodes_from_use(arguments)
    if arguments.from_use is not None:
        raise SarError("--from-use prints a palette in XML: remove --format json")
    from sar_compiler.checks.leaf_classes import check_class
    from sar_compiler.nodes.models.palette import palette
    from sar_compiler.tree.diagnostic import Severity
    from sar_compiler.views.nodes import nodes_as_json, nodes_as_text

    if arguments.format == "specs":
        from sar_compiler.nodes.declared import specs_as_json
        from sar_compiler.nodes.registry import registered_leaves

        print(specs_as_json(spec for each in arguments.nodes for spec in registered_leaves(each)), end="")
        return OK
    registry = _registry(arguments)
    if arguments.tag is not None and arguments.tag not in registry:
        from sar_compiler.nodes.palettes import palettes_containing
        from sar_compiler.tree.guessing import did_you_mean

        others = ". List known nodes with `sar-compile nodes`, and add your own with --nodes PACKAGE.MODULE"
        advice = did_you_mean(registry.nearest(arguments.tag)) or others
        if known := palettes_containing(arguments.tag):
            advice = f". Add a palette that describes it: --model {' or '.join(known)}"
        raise SarError(f"there is no node '{arguments.tag}'{advice}")
    specs = list(registry) if arguments.tag is None else registry.variants(arguments.tag)
    if arguments.format == "groot2":
        print(palette(specs), end="")
        return OK
    print_text(nodes_as_json(specs) if arguments.format == "json" else nodes_as_text(specs))
    found = [finding for spec in specs for finding in check_class(spec)]
    for finding in found:
        print(finding.render(), file=sys.stderr)
    return FINDINGS if any(each.severity is Severity.ERROR for each in found) else OK


def _nodes_from_use(arguments: argparse.Namespace) -> int:
    """Print a palette of the nodes in a folder's trees that no palette or module describes.

    Raises:
        UnreadableFileError: If the folder, or a file in it, cannot be read.
        TreeError: If a configuration, or a palette named by the user, is malformed.
    """
    from sar_compiler.nodes.models.from_use import UndescribedNodes
    from sar_compiler.nodes.models.palette import palette_of
    from sar_compiler.tree.discovery import tree_files_in

    files = tree_files_in(arguments.from_use)
    loader = workspace(arguments, folders=(arguments.from_use,))
    uses = UndescribedNodes()
    for path in files:
        tree = loader.load_file(path)
        if tree.is_malformed:
            print_error(
                f"{PROG}: {path} is not a well-formed tree file. Run `{PROG} validate` to see the errors"
            )
        else:
            uses.add(tree.forest.main, tree.palettes, tree.project.registry)
    loader.report_use()
    print(palette_of(uses.models(arguments.tag)), end="")
    return OK


def _schema(arguments: argparse.Namespace) -> int:
    from sar_compiler.nodes.schemas.json_schema import json_schema
    from sar_compiler.nodes.schemas.xml_schema import xml_schema

    registry = _registry(arguments)
    if arguments.format == "json":
        from sar_compiler.tree.plain import as_json

        print(as_json(json_schema(registry)))
    else:
        print(xml_schema(registry), end="")
    return OK


def _registry(arguments: argparse.Namespace) -> "Registry":
    """Return the nodes that trees in the current folder can use; print warnings about palettes on standard error.

    Raises:
        TreeError: If the configuration or a palette is malformed.
        RegistryError: If a module of leaves cannot be imported or contains no leaf.
        UnreadableFileError: If a palette cannot be read.
    """
    project = workspace(arguments).current_project()
    registry = project.vocabulary
    for finding in project.findings:
        print(finding.render(), file=sys.stderr)
    return registry


_ADD_ARGUMENTS = {
    "show": _add_show,
    "diff": _add_diff,
    "explain": _add_explain,
    "nodes": _add_nodes,
    "schema": _add_schema,
}

if __name__ == "__main__":
    sys.exit(main())
