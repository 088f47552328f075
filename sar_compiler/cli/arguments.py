"""Parsing of arguments, shared by the commands."""

import argparse
import math
import platform
import sys
from typing import Any

from sar_compiler.cli.terminal import columns, columns_asked_for
from sar_compiler.commands import FINDINGS, INTERRUPTED, OK, PIPE_CLOSED, USAGE, run

__all__ = [
    "FINDINGS",
    "INTERRUPTED",
    "OK",
    "PIPE_CLOSED",
    "USAGE",
    "Parser",
    "add_version",
    "count",
    "run",
    "seed",
    "speed",
]


class Parser(argparse.ArgumentParser):
    """An argument parser that accepts no abbreviated options."""

    def __init__(self, prog: str = "", description: str = "", **settings: Any) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False, **settings)

    def _get_formatter(self) -> argparse.HelpFormatter:
        # It is made for every argument, to look at its name; what argparse asks for the width takes long to import.
        width = columns(sys.stdout) or columns_asked_for() or 80
        return argparse.HelpFormatter(prog=self.prog, width=width - 2)


def add_version(parser: argparse.ArgumentParser) -> None:
    """Add `--version`, which every command has."""
    shown = "show the version and what it runs on, and exit"
    parser.add_argument("--version", action=_Version, default=argparse.SUPPRESS, help=shown)


class _Version(argparse.Action):
    """Shows the version; what that takes is imported only now."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(nargs=0, **{**settings, "dest": argparse.SUPPRESS})

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        from sar_compiler.runtime import kernel

        print(
            f"{parser.prog} {version('sar_compiler')} (Python {platform.python_version()}, "
            f"py_trees {version('py_trees')}, kernel: {kernel.described()})"
        )
        parser.exit()


def count(text: str) -> int:
    """Read a whole number above 0, with `_` between its digits if one likes."""
    digits = text.replace("_", "")
    if not (digits.isdecimal() and int(digits) > 0):
        message = f"'{text}' is not a whole number above 0"
        raise argparse.ArgumentTypeError(message)
    return int(digits)


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
