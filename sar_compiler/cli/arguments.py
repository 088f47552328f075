"""Parsing of arguments, shared by the commands."""

import argparse
import math
import os
import sys
from typing import Any

from sar_compiler.commands import FINDINGS, INTERRUPTED, OK, PIPE_CLOSED, USAGE, run

__all__ = ["FINDINGS", "INTERRUPTED", "OK", "PIPE_CLOSED", "USAGE", "Parser", "count", "run", "speed"]


class Parser(argparse.ArgumentParser):
    """An argument parser that accepts no abbreviated options."""

    def __init__(self, prog: str = "", description: str = "", **settings: Any) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False, **settings)

    def _get_formatter(self) -> argparse.HelpFormatter:
        # It is made for every argument, to look at its name; what argparse asks for the width takes long to import.
        try:
            columns = int(os.environ.get("COLUMNS", "0")) or os.get_terminal_size(sys.stdout.fileno()).columns
        except (AttributeError, ValueError, OSError):
            columns = 80
        return argparse.HelpFormatter(prog=self.prog, width=columns - 2)


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
