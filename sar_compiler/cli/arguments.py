"""What the commands share: parsing of arguments, and how they end."""

import argparse
import math
import sys
from collections.abc import Callable

from sar_compiler.errors import SarError

OK = 0
FINDINGS = 1
USAGE = 2
INTERRUPTED = 130
PIPE_CLOSED = 141
"""As a shell reports a process that wrote to a pipe which nobody reads: what was found is not known to be read."""

# What the simulator needs and nothing else does.
_SIMULATOR = ("numpy", "scipy", "PIL")


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
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in _SIMULATOR:
            raise
        print(f"{prog}: {_incomplete(error)}", file=sys.stderr)
        return USAGE
    except BrokenPipeError:
        # The reader has seen enough (`| head`); what is left in the buffer has nowhere to go.
        sys.stderr.close()
        return PIPE_CLOSED
    except KeyboardInterrupt:
        return INTERRUPTED


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


def _incomplete(error: ModuleNotFoundError) -> str:
    return (
        f"the simulator is not complete ({error}): it needs numpy, scipy and Pillow; "
        "pip install 'sar_compiler[sim]' brings them, rosdep on a robot"
    )


def no_ros(error: ImportError) -> SarError:
    """Return the error for a command that needs ROS 2 and finds none."""
    message = (
        f"ROS 2 is not here ({error}). On a robot, source its installation and workspace; without one, "
        "`make env` in a checkout builds an environment with ROS 2 from PyPI"
    )
    return SarError(message)
