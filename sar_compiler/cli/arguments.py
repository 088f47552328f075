"""Parsing of arguments, shared by the commands."""

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from sar_compiler.commands import CommandParser

REPORT_FORMS = "in the form of the file's ending: .html to print and hand on, .json, or in the world's coordinates .geojson, .cot, .cap"
"""What the help says of the files of reports: the endings of `views.mission_report.FORMS`, which take too long to import for it."""


class ArgumentKind:
    """What a word of a command line is: the type of its argument, and what a shell offers for it.

    Args:
        name: Which function of `cli.completion.COMPLETERS` offers values.
        read: Makes a value of the word.
    """

    def __init__(self, name: str, read: Callable[[str], Any] = str) -> None:
        self.name, self.read = name, read

    def __call__(self, text: str) -> Any:
        """Return the value of a word."""
        return self.read(text)


def _tree_input(name: str) -> str:
    """Return the name of a tree file as it is read: for `-` that of standard input."""
    from sar_compiler.tree.content import STANDARD_INPUT

    return str(STANDARD_INPUT) if name == "-" else name


FILE, FOLDER, YAML_FILE = (
    ArgumentKind("file", Path),
    ArgumentKind("folder", Path),
    ArgumentKind("YAML file", Path),
)
TREE, TREE_INPUT = ArgumentKind("tree"), ArgumentKind("tree", _tree_input)
TREE_ID, WORLD = ArgumentKind("tree's ID"), ArgumentKind("world")


class Parser(CommandParser):
    """The parser of a command, which completes the values of its arguments as well."""

    def complete(self) -> NoReturn:
        """Answer the shell that asks for completions."""
        from sar_compiler.cli.completion import add_completers

        add_completers(self)
        super().complete()


def count(text: str) -> int:
    """Read a whole number above 0, with `_` between its digits if one likes."""
    digits = text.replace("_", "")
    if not (digits.isdecimal() and int(digits) > 0):
        message = f"'{text}' is not a whole number above 0"
        raise argparse.ArgumentTypeError(message)
    return int(digits)


def port(text: str) -> int:
    """Read the number of a port; 0 stands for any that is free."""
    if not (text.isascii() and text.isdigit() and int(text) < 1 << 16):
        message = f"'{text}' is not a port, 0 to 65535"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def pair_of_ports(text: str) -> int:
    """Read the number of a port that is used together with the next one."""
    number = port(text)
    if not 0 < number < (1 << 16) - 1:
        message = f"'{text}' is not a port that has a next one, 1 to 65534"
        raise argparse.ArgumentTypeError(message)
    return number


def seed(text: str) -> int:
    """Read a seed: a whole number, 0 or above."""
    if not (text.isascii() and text.isdigit()):
        message = f"'{text}' is not a whole number, 0 or above"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def speed(text: str) -> float:
    """Read the argument of `--speed`: simulated seconds per second, above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        message = f"'{text}' is not a number above 0"
        raise argparse.ArgumentTypeError(message)
    return value


def seconds(text: str) -> float:
    """Return a time in seconds above 0, for argparse."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < math.inf:
        message = f"'{text}' is no number of seconds above 0"
        raise argparse.ArgumentTypeError(message)
    return value


def add_web_port(parser: argparse.ArgumentParser, when: str = "") -> None:
    """Add `--web-port`; *when* it counts."""
    text = f"{when}the page's port (default 8043; 0 for any)"
    parser.add_argument("--web-port", type=port, metavar="N", help=text)


def add_tree_id(parser: argparse.ArgumentParser, use: str) -> None:
    """Add `--tree`; *use* is what is done with that tree."""
    text = f"the tree to {use} (default: the one the file executes)"
    parser.add_argument("--tree", type=TREE_ID, metavar="ID", help=text)
