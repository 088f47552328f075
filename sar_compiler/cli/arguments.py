"""What the commands share: parsing of arguments, and how they end."""

import argparse
import sys
from collections.abc import Callable, Sequence

from sar_compiler.errors import SarError

OK = 0
FINDINGS = 1
USAGE = 2


class Parser(argparse.ArgumentParser):
    """An argument parser that takes options only as they are spelt."""

    def __init__(self, prog: str, description: str, **settings: object) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False, **settings)  # type: ignore[arg-type]


def run(command: Callable[[], int], prog: str) -> int:
    """Run a command and turn what it raises for its user into a message.

    Args:
        command: Does the work and returns the exit status.
        prog: The command's name, for the message.

    Returns:
        The exit status: the command's own, or 2 for a `SarError`.
    """
    try:
        return command()
    except SarError as error:
        print(f"{prog}: {error}", file=sys.stderr)
        return USAGE
    except BrokenPipeError:
        # The reader has seen enough (`| head`); what is left in the buffer has nowhere to go.
        sys.stderr.close()
        return OK


def split_ros_arguments(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split a command line at its first `--ros-args`.

    Returns:
        The command's own arguments; and `--ros-args` with everything behind it. What stands behind a
        closing `--` is the command's again.
    """
    arguments = list(argv)
    if "--ros-args" not in arguments:
        return arguments, []
    start = arguments.index("--ros-args")
    ros = arguments[start:]
    if "--" in ros:
        end = ros.index("--")
        return arguments[:start] + ros[end + 1 :], ros[:end]
    return arguments[:start], ros
