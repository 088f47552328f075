"""Arguments shared by several commands, and the loading of the trees that they name."""

import argparse
import math
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from sar_compiler.budget import MAX_MEMORY_MB, MAX_SEC, Budget
from sar_compiler.commands import FINDINGS, OK, print_note
from sar_compiler.errors import SarError
from sar_compiler.gc_pause import large_imports
from sar_compiler.parts import is_part_installed
from sar_compiler.resources import require_tree_file

if TYPE_CHECKING:
    from sar_compiler.journal.georeference import Georeference
    from sar_compiler.project import CommandLineSettings, ProjectTree, Workspace
    from sar_compiler.project.project_tree import FurtherCheck
    from sar_compiler.tree.diagnostic import Diagnostic


class ArgumentKind:
    """The kind of an argument: its type, and its values for shell completion.

    Args:
        name: The function of `cli.completion.COMPLETERS` that offers values.
        read: Converts the string to a value.
    """

    def __init__(self, name: str, read: Callable[[str], Any] = str) -> None:
        self.name, self.read = name, read

    def __call__(self, text: str) -> Any:
        """Return the value of a string."""
        return self.read(text)


def _tree_input(name: str) -> str:
    """Return the name under which a tree file is read; for `-`, that of standard input."""
    from sar_compiler.opener import STANDARD_INPUT

    return str(STANDARD_INPUT) if name == "-" else name


_MOST_RESTARTS = 1000
FILE, FOLDER = ArgumentKind("file", Path), ArgumentKind("folder", Path)
YAML_FILE, PALETTE = ArgumentKind("YAML file", Path), ArgumentKind("palette", Path)
TREE, TREE_INPUT = ArgumentKind("tree"), ArgumentKind("tree", _tree_input)
TREE_ID, WORLD = ArgumentKind("tree's ID"), ArgumentKind("world")
DEFAULT_WORLD = "disaster_zone"


T = TypeVar("T")


def reader(
    read: Callable[[str], T], what: str, fits: Callable[[T], bool] = lambda _: True
) -> Callable[[str], T]:
    """Return a function that converts a string to a value; its error names *what* is expected."""

    def parse(text: str) -> T:
        with suppress(ValueError):
            value = read(text)
            if fits(value):
                return value
        raise argparse.ArgumentTypeError(f"'{text}' is not {what}")

    return parse


def report_argument_errors(read: Callable[[str], T]) -> Callable[[str], T]:
    """Return a function that reports its errors as errors of an argument."""

    def parse(text: str) -> T:
        try:
            return read(text)
        except SarError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return parse


def report_forms() -> str:
    """Describe the available reports, for the help of options."""
    if not is_part_installed("reports"):
        return "(needs sar_compiler.reports)"
    from sar_compiler.reports.report_forms import describe_forms

    return describe_forms()


def georeference(text: str) -> "Georeference":
    """Parse the position of the frame `map` on the earth, `LAT,LON,HEADING` in degrees.

    Raises:
        ArgumentTypeError: If it is not a position on the earth.
    """
    from sar_compiler.journal.georeference import Georeference

    try:
        place = Georeference(*(float(number) for number in text.split(",")))
    except (TypeError, ValueError):
        raise argparse.ArgumentTypeError(f"'{text}' is not LAT,LON,HEADING in degrees") from None
    for name, mistake in place.mistakes():
        raise argparse.ArgumentTypeError(f"'{text}': {name} {mistake}")
    return place


def _parse_integer(text: str) -> int:
    digits = text.replace("_", "")
    return int(digits if digits.isascii() and digits.isdigit() else "no digits")


count = reader(_parse_integer, "an integer above 0", lambda value: value > 0)
seed = reader(_parse_integer, "an integer, 0 or above")
port = reader(_parse_integer, "a port, 0 to 65535", lambda value: value < 1 << 16)
pair_of_ports = reader(
    _parse_integer, "a port that has a next one, 1 to 65534", lambda value: 0 < value < (1 << 16) - 1
)
MOST_JOBS = max(64, os.cpu_count() or 1)
"""Largest number of processes that a command starts at a time."""


def number_within(least: float, most: float, what: str = "a number") -> Callable[[str], float]:
    """Return a function that converts a string to a number within bounds."""
    return reader(float, f"{what} from {least:g} to {most:g}", lambda value: least <= value <= most)


jobs = reader(
    _parse_integer, f"a number of processes from 1 to {MOST_JOBS}", lambda value: 0 < value <= MOST_JOBS
)
restarts = reader(_parse_integer, "an integer from 1 to 1000", lambda value: 0 < value <= _MOST_RESTARTS)
speed = number_within(0.001, 10_000)
tick_period = number_within(0.0001, 86_400, "a number of seconds")
seconds = reader(float, "a number of seconds above 0", lambda value: 0 < value < math.inf)
probability = reader(float, "a number between 0 and 1", lambda value: 0 <= value <= 1)
confidence = reader(float, "a number above 0 and below 1", lambda value: 0 < value < 1)


def add_page_options(parser: "argparse.ArgumentParser | argparse._ArgumentGroup", when: str = "") -> None:
    """Add `--open` and `--web-port`; *when* is their condition, as a prefix of the help."""
    parser.add_argument("--open", action="store_true", help=f"{when}open the page in a browser")
    text = f"{when}the page's port (default 8043; 0 for any)"
    parser.add_argument("--web-port", type=port, metavar="N", help=text)


def add_tree_id(parser: argparse.ArgumentParser, use: str) -> None:
    """Add `--tree`; *use* is the action on that tree."""
    text = f"the tree to {use} (default: the main tree)"
    parser.add_argument("--tree", type=TREE_ID, metavar="ID", help=text)


def add_budget(
    parser: argparse.ArgumentParser, max_sec: float = MAX_SEC, what: str = "processor time"
) -> None:
    """Add the options that limit an analysis; *what* is the measured time."""
    text = f"stop after SEC seconds of {what}, and print the results so far (default {max_sec:g})"
    parser.add_argument("--max-seconds", type=seconds, default=max_sec, metavar="SEC", help=text)
    text = f"stop when the process uses MB megabytes, and print the results so far (default {MAX_MEMORY_MB})"
    parser.add_argument("--max-memory", type=count, default=MAX_MEMORY_MB, metavar="MB", help=text)


def budget_of(arguments: argparse.Namespace, **options: Any) -> Budget:
    """Return the budget of an analysis from the command line; *options* are further ones of `Budget`."""
    return Budget(arguments.max_seconds, arguments.max_memory, **options)


FILE_HELP = "a tree file, or the name of a shipped tree"
INPUT_HELP = "a tree file, the name of a shipped tree, or - for standard input"
FORMAT_HELP = "for people (default text), or for scripts"
PROJECT_OPTIONS = "options that add to the project's configuration"
"""The title of these options in `--help`; the page of the commands lists them once."""


def add_project_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that extend a project's configuration."""
    text = "another folder that contains included tree files; may be repeated"
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
    text = "trust the modules of leaves that the project contains and its configuration lists, until one of them changes"
    add("--trust", action="store_true", help=text)
    text = "ignore sar.toml, and palettes and trees that no option names"
    add("--isolated", action="store_true", help=text)
    return options


def add_mission(parser: "argparse.ArgumentParser | argparse._ArgumentGroup") -> None:
    """Add `--mission`."""
    text = "the mission, if the leaves of the tree do not determine it"
    parser.add_argument("--mission", type=ArgumentKind("mission"), metavar="NAME", help=text)


def workspace(arguments: argparse.Namespace, **added: Any) -> "Workspace":
    """Return a workspace with the options of a command; *added* are further fields of `CommandLineSettings`."""
    with large_imports():
        from sar_compiler.project.workspace import Workspace
    return Workspace(additions(arguments)._replace(**added), note=print_note, further_checks=further_checks())


def further_checks() -> "Sequence[FurtherCheck]":
    """Return the further checks of a tree that the installed parts provide."""
    if not is_part_installed("missions"):
        return ()
    from sar_compiler.missions.tree_check import check_mission

    return (check_mission,)


def load_checked(arguments: argparse.Namespace, *names: str | Path) -> "list[ProjectTree]":
    """Load trees for a command; print warnings and notes on standard error.

    Args:
        arguments: The options of the command.
        names: The paths of tree files, or the names of shipped trees.

    Raises:
        TreeError: If there are errors; carries all findings.
        UnreadableFileError: If a file does not exist or cannot be read.
    """
    from sar_compiler.tree.diagnostic import Severity, TreeError

    for name in names:
        require_tree_file(name)
    loader = workspace(arguments)
    trees = [loader.load(name) for name in names]
    for tree in trees:
        findings = tree.check()
        loader.report_use()
        if any(each.severity is Severity.ERROR for each in findings):
            raise TreeError(findings)
        report_findings(findings)
    return trees


def report_findings(findings: "Sequence[Diagnostic]") -> int:
    """Print findings on standard error, each location as in `validate --all`; return the exit status for the errors."""
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
