"""Parsing of arguments, shared by the commands."""

import argparse
import math
import platform
from typing import Any

from sar_compiler.commands import FINDINGS, INTERRUPTED, OK, PIPE_CLOSED, USAGE, run

__all__ = ["FINDINGS", "INTERRUPTED", "OK", "PIPE_CLOSED", "USAGE", "Parser", "count", "run", "speed"]


class Parser(argparse.ArgumentParser):
    """An argument parser that accepts no abbreviated options."""

    def __init__(self, prog: str, description: str, **settings: object) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False, **settings)  # type: ignore[arg-type]
        self.add_argument("--version", action=_Version, help="show the version and what it runs on, and exit")


class _Version(argparse.Action):
    """Shows the version; what that takes is imported only now."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(nargs=0, **settings)

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
