"""Arguments that several commands share, and functions that load the trees named by arguments."""

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
    """The type of a command-line argument, which determines how its string is converted and completed.

    Args:
        name: The key of the argument's completer in `cli.completion.COMPLETERS`.
        read: Converts the argument's string to its value.
    """

    def __init__(self, name: str, read: Callable[[str], Any] = str) -> None:
        self.name, self.read = name, read

    def __call__(self, text: str) -> Any:
        """Convert the argument's string to its value."""
        return self.read(text)


def _tree_input(name: str) -> str:
    """Return the name of a tree file, or the path of standard input for `-`."""
    from sar_compiler.opener import STANDARD_INPUT

    return str(STANDARD_INPUT) if name == "-" else name


_MAX_RESTARTS = 1000
FILE, FOLDER = ArgumentKind("file", Path), ArgumentKind("folder", Path)
YAML_FILE, PALETTE = ArgumentKind("YAML file", Path), ArgumentKind("palette", Path)
TREE, TREE_INPUT = ArgumentKind("tree"), ArgumentKind("tree", _tree_input)
TREE_ID, WORLD = ArgumentKind("tree's ID"), ArgumentKind("world")
DEFAULT_WORLD = "disaster_zone"


T = TypeVar("T")


def reader(
    read: Callable[[str], T], what: str, is_valid: Callable[[T], bool] = lambda _: True
) -> Callable[[str], T]:
    """Return a function that converts a valid string to a value; *what* describes valid values in errors."""

    def parse(text: str) -> T:
        with suppress(ValueError):
            value = read(text)
            if is_valid(value):
                return value
        raise argparse.ArgumentTypeError(f"'{text}' is not {what}")

    return parse


def report_argument_errors(read: Callable[[str], T]) -> Callable[[str], T]:
    """Wrap a function so that argparse reports each `SarError` as an error of the argument."""

    def parse(text: str) -> T:
        try:
            return read(text)
        except SarError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return parse


def report_forms() -> str:
    """Describe the available report formats, for use in the help of options."""
    if not is_part_installed("reports"):
        return "(needs sar_compiler.reports)"
    from sar_compiler.reports.report_forms import describe_forms

    return describe_forms()


def georeference(text: str) -> "Georeference":
    """Parse the georeference of the frame `map`, `LAT,LON,HEADING` in degrees.

    Raises:
        ArgumentTypeError: If the text is not a valid georeference.
    """
    from sar_compiler.journal.georeference import Georeference

    try:
        parsed = Georeference(*(float(number) for number in text.split(",")))
    except (TypeError, ValueError):
        raise argparse.ArgumentTypeError(f"'{text}' is not LAT,LON,HEADING in degrees") from None
    for name, mistake in parsed.mistakes():
        raise argparse.ArgumentTypeError(f"'{text}': {name} {mistake}")
    return parsed


def _parse_integer(text: str) -> int:
    digits = text.replace("_", "")
    return int(digits if digits.isascii() and digits.isdigit() else "no digits")


count = reader(_parse_integer, "an integer above 0", lambda value: value > 0)
seed = reader(_parse_integer, "an integer of 0 or more")
port = reader(_parse_integer, "a port, 0 to 65535", lambda value: value < 1 << 16)
pair_of_ports = reader(_parse_integer, "a port from 1 to 65534", lambda value: 0 < value < (1 << 16) - 1)
MAX_JOBS = max(64, os.cpu_count() or 1)
"""The maximum number of processes that a command runs in parallel."""


def number_within(low: float, high: float, what: str = "a number") -> Callable[[str], float]:
    """Return a function that converts a string to a number from *low* to *high*."""
    return reader(float, f"{what} from {low:g} to {high:g}", lambda value: low <= value <= high)


jobs = reader(
    _parse_integer, f"a number of processes from 1 to {MAX_JOBS}", lambda value: 0 < value <= MAX_JOBS
)
run_number = reader(_parse_integer, "the number of a run, from 1", lambda value: value > 0)
restarts = reader(_parse_integer, "an integer from 1 to 1000", lambda value: 0 < value <= _MAX_RESTARTS)
speed = number_within(0.001, 10_000)
tick_period = number_within(0.0001, 86_400, "a number of seconds")
seconds = reader(float, "a number of seconds above 0", lambda value: 0 < value < math.inf)
probability = reader(float, "a number between 0 and 1", lambda value: 0 <= value <= 1)
confidence = reader(float, "a number above 0 and below 1", lambda value: 0 < value < 1)


def add_page_options(parser: "argparse.ArgumentParser | argparse._ArgumentGroup", when: str = "") -> None:
    """Add `--open` and `--web-port`; *when* begins the help text of both options, and says when they apply."""
    parser.add_argument("--open", action="store_true", help=f"{when}open the page in a browser")
    text = f"{when}the port on which the page is served (default 8043; 0 for any free port)"
    parser.add_argument("--web-port", type=port, metavar="N", help=text)


def add_tree_id(parser: argparse.ArgumentParser, use: str) -> None:
    """Add `--tree`; *use* is the verb in the help text, such as `show`."""
    text = f"the tree to {use} (default: the main tree)"
    parser.add_argument("--tree", type=TREE_ID, metavar="ID", help=text)


def add_budget(
    parser: argparse.ArgumentParser, max_sec: float = MAX_SEC, what: str = "processor time"
) -> None:
    """Add the options that limit an analysis; *what* names the limited time, such as `elapsed time`."""
    text = f"stop after SEC seconds of {what}, and print the results so far (default {max_sec:g})"
    parser.add_argument("--max-seconds", type=seconds, default=max_sec, metavar="SEC", help=text)
    text = f"stop when the process uses MB megabytes, and print the results so far (default {MAX_MEMORY_MB})"
    parser.add_argument("--max-memory", type=count, default=MAX_MEMORY_MB, metavar="MB", help=text)


def budget_of(arguments: argparse.Namespace, **options: Any) -> Budget:
    """Return the budget that the command line sets; *options* are passed to `Budget`."""
    return Budget(arguments.max_seconds, arguments.max_memory, **options)


FILE_HELP = "a tree file, or the name of a shipped tree"
INPUT_HELP = "a tree file, the name of a shipped tree, or - for standard input"
FORMAT_HELP = "the output format: text for people (default), or json for scripts"
PROJECT_OPTIONS = "options that add to the project's configuration"
"""The title, in `--help`, of the options that extend a project's configuration. The page of commands lists
these options once."""


def add_project_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that extend a project's configuration."""
    text = "another folder that contains included tree files; may be repeated"
    add = add_vocabulary_options(parser).add_argument
    add("--include-path", action="append", default=[], type=FOLDER, metavar="FOLDER", help=text)


def add_vocabulary_options(parser: argparse.ArgumentParser) -> "argparse._ArgumentGroup":
    """Add the options that determine which nodes are known, and return the group of these options."""
    options = parser.add_argument_group(PROJECT_OPTIONS)
    add = options.add_argument
    text = "load a module of leaves (installed, or in the current folder); may be repeated"
    add("--nodes", action="append", default=[], type=ArgumentKind("module"), metavar="PKG.MOD", help=text)
    text = (
        "a palette of nodes that are not installed: a file with a TreeNodesModel, or Nav2's nodes (nav2:jazzy, "
        "nav2:kilted, nav2:main); may be repeated"
    )
    add("--model", action="append", default=[], type=PALETTE, metavar="NODES.xml", help=text)
    text = "trust the project's own modules of leaves, as listed in the project's configuration, until one of these modules changes"
    add("--trust", action="store_true", help=text)
    text = "ignore sar.toml, and every palette and tree that no option names"
    add("--isolated", action="store_true", help=text)
    return options


def add_mission(parser: "argparse.ArgumentParser | argparse._ArgumentGroup") -> None:
    """Add `--mission`."""
    text = "the mission to use if the leaves of the tree do not determine the mission"
    parser.add_argument("--mission", type=ArgumentKind("mission"), metavar="NAME", help=text)


def workspace(arguments: argparse.Namespace, **added: Any) -> "Workspace":
    """Return the workspace that a command's options define; *added* are further `CommandLineSettings` fields."""
    with large_imports():
        from sar_compiler.project.workspace import Workspace
    return Workspace(additions(arguments)._replace(**added), note=print_note, further_checks=further_checks())


def further_checks() -> "Sequence[FurtherCheck]":
    """Return the additional checks of trees that installed parts of this project provide."""
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
    """Print findings with all their locations on standard error.

    Returns 1 if any finding is an error, otherwise 0.
    """
    from sar_compiler.terminal import findings_as_text
    from sar_compiler.tree.diagnostic import Severity

    if findings:
        print(findings_as_text(findings, sys.stderr), file=sys.stderr)
    return FINDINGS if any(each.severity is Severity.ERROR for each in findings) else OK


def additions(arguments: argparse.Namespace) -> "CommandLineSettings":
    """Return the settings that a command's options add to a project's configuration."""
    from sar_compiler.project import CommandLineSettings

    models, folders = tuple(arguments.model), tuple(arguments.include_path)
    mission = getattr(arguments, "mission", None)  # some commands have no --mission
    isolated = arguments.isolated
    return CommandLineSettings(
        tuple(arguments.nodes), models, folders, arguments.trust, mission=mission, is_isolated=isolated
    )


def add_params(parser: argparse.ArgumentParser) -> None:
    """Add `--params`."""
    text = "the mission's ROS 2 parameter file, as for sar-run; the file determines initial facts and the values of {@parameters}"
    parser.add_argument("--params", type=YAML_FILE, metavar="FILE", help=text)
