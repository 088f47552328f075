"""The common options of commands that read trees."""

import argparse
import atexit
import gc
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sar_compiler.cli.arguments import FOLDER, PALETTE, YAML_FILE, ArgumentKind
from sar_compiler.commands import FINDINGS, OK, tell_note
from sar_compiler.parts import is_here
from sar_compiler.tree.gc_pause import LARGE, gc_paused

if TYPE_CHECKING:
    from sar_compiler.project import CommandLineSettings, ProjectTree, Workspace
    from sar_compiler.project.project_tree import FurtherCheck
    from sar_compiler.tree.diagnostic import Diagnostic

FILE_HELP = "a tree file, or the name of a shipped tree"
INPUT_HELP = "a tree file, the name of a shipped tree, or - for standard input"
FORMAT_HELP = "for people (default text), or for scripts"
PROJECT_OPTIONS = "options that add to the project's configuration"
"""The title of these options in `--help`; the page of the commands lists them once."""


def add_project_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that extend a project's configuration."""
    text = "a further folder for included tree files (in addition to the file's own); may be repeated"
    add = add_vocabulary_options(parser).add_argument
    add("--include-path", action="append", default=[], type=FOLDER, metavar="FOLDER", help=text)


def add_vocabulary_options(parser: argparse.ArgumentParser) -> "argparse._ArgumentGroup":
    """Add the options that determine the known nodes, and return their group."""
    options = parser.add_argument_group(PROJECT_OPTIONS)
    add = options.add_argument
    text = "load a module of leaves (installed, or in this folder); may be repeated"
    add("--nodes", action="append", default=[], type=ArgumentKind("module"), metavar="PKG.MOD", help=text)
    text = (
        "a palette of nodes that are not installed: a file with a TreeNodesModel, or Nav2's nodes (nav2:jazzy, "
        "nav2:kilted, nav2:main); may be repeated"
    )
    add("--model", action="append", default=[], type=PALETTE, metavar="NODES.xml", help=text)
    text = (
        "run the modules of leaves that the project's own configuration names and contains, now and until "
        "one of them changes"
    )
    add("--trust", action="store_true", help=text)
    text = "ignore the surroundings of a tree file: sar.toml, and palettes and trees that no option names"
    add("--isolated", action="store_true", help=text)
    return options


def add_mission(parser: "argparse.ArgumentParser | argparse._ArgumentGroup") -> None:
    """Add `--mission`."""
    text = "the mission, if the leaves of the tree do not determine it"
    parser.add_argument("--mission", type=ArgumentKind("mission"), metavar="NAME", help=text)


def workspace(arguments: argparse.Namespace, **added: Any) -> "Workspace":
    """Return a workspace with the options of a command; *added* are further fields of `CommandLineSettings`."""
    with collection_saved():
        from sar_compiler.project.workspace import Workspace
    return Workspace(additions(arguments)._replace(**added), note=tell_note, further_checks=further_checks())


@contextmanager
def collection_saved() -> Iterator[None]:
    """Disable garbage collection for large imports: it would search the new objects several times in vain, also afterwards and at the end."""
    with gc_paused(LARGE):
        yield
    atexit.register(gc.freeze)


def further_checks() -> "Sequence[FurtherCheck]":
    """Return the checks of a tree in addition to the rules, from the installed parts."""
    if not is_here("missions"):
        return ()
    from sar_compiler.missions.tree_check import check_mission

    return (check_mission,)


def require_there(name: str | Path, *, or_folder: bool = False) -> None:
    """Check that a tree file exists, before the slow imports that read it.

    Raises:
        UnreadableFileError: If *name* is a folder that is not allowed, or clearly a path, and nothing exists there.
    """
    from sar_compiler.opener import (
        STANDARD_INPUT,
        TREE,
        MissingFileError,
        UnreadableFileError,
        is_folder,
        is_there,
        read_file,
    )
    from sar_compiler.resources import find, is_bare_word

    path = find("trees", str(name), ".xml")
    if name and not or_folder and is_folder(path):
        said = f"{name} is a folder: name a tree file in it, or check all its trees with sar-compile validate"
        raise UnreadableFileError(path, "it is a folder", said)
    if name and path != STANDARD_INPUT and not is_bare_word(str(name)) and not is_there(path):
        try:
            read_file(path, TREE)
        except MissingFileError as error:
            if path.name != str(name) or not is_there(find("trees", path.stem, ".xml")):
                raise
            raise MissingFileError(
                path, error.reason, f"{error}; did you mean the shipped tree {path.stem}?"
            ) from None


def load_checked(arguments: argparse.Namespace, *names: str | Path) -> "list[ProjectTree]":
    """Load trees for a command that does more than report findings; report findings other than errors on standard error.

    Args:
        arguments: The options of the command.
        names: The paths of tree files, or the names of shipped trees.

    Raises:
        TreeError: If there are errors; carries all findings.
        UnreadableFileError: If a file does not exist or cannot be read.
    """
    from sar_compiler.tree.diagnostic import Severity, TreeError

    for name in names:
        require_there(name)
    loader = workspace(arguments)
    trees = [loader.load(name) for name in names]
    for tree in trees:
        findings = tree.check()
        loader.note_use()
        if any(each.severity is Severity.ERROR for each in findings):
            raise TreeError(findings)
        report_findings(findings)
    return trees


def report_findings(findings: "Sequence[Diagnostic]") -> int:
    """Print findings on standard error, each location as in `validate --all`; return the exit status: that of findings for errors."""
    from sar_compiler.terminal import findings_as_text
    from sar_compiler.tree.diagnostic import Severity

    if findings:
        print(findings_as_text(findings, sys.stderr), file=sys.stderr)
    return FINDINGS if any(each.severity is Severity.ERROR for each in findings) else OK


def additions(arguments: argparse.Namespace) -> "CommandLineSettings":
    """Return the additions of a command's options to a project's configuration."""
    from sar_compiler.project import CommandLineSettings

    models, folders = tuple(arguments.model), tuple(arguments.include_path)
    mission = getattr(arguments, "mission", None)  # some commands have no such option
    isolated = arguments.isolated
    return CommandLineSettings(
        tuple(arguments.nodes), models, folders, arguments.trust, mission=mission, is_isolated=isolated
    )


def add_params(parser: argparse.ArgumentParser) -> None:
    """Add `--params`."""
    text = "the mission's ROS 2 parameter file, as for sar-run: it determines facts and {@parameters}"
    parser.add_argument("--params", type=YAML_FILE, metavar="FILE", help=text)
