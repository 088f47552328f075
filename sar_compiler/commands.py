"""What all commands share: their parser, their exit statuses, and their errors as messages to the user."""

import argparse
import codecs
import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NoReturn, TextIO

from sar_compiler.errors import SarError

OK = 0
FINDINGS = 1
USAGE = 2
RULE_FAILED = 3
"""The status of `sar-compile` where a rule of the project's own has failed; what the others found is told."""
INTERRUPTED = 130
PIPE_CLOSED = 141
"""The status that a shell reports for a process that wrote to a closed pipe: the output may not have been read."""

_UNWRITABLE = (errno.EBADF, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOSPC)
"""What is wrong with standard output where writing it fails, besides a closed pipe."""

# The top-level modules of the simulator's libraries, and of ROS.
_SIMULATOR = ("numpy", "scipy", "PIL")
# The extras that only an option takes: the modules of each, what takes them, and what else helps.
_OF_OPTIONS = {
    "groot2": (("zmq", "msgpack"), "--groot2", ", apt's python3-zmq and python3-msgpack on a robot"),
    "record": (("mcap", "lz4", "zstandard"), "--record", ""),
    "report": (("cap_tools", "geojson", "pyproj", "xsdata"), "a report in coordinates of the world", ""),
    "sweep": (("dask", "distributed"), "--dask", ""),
    "view": (
        ("rich",),
        "--view text on a terminal",
        "; without it, `--view text | cat` shows each change in a line",
    ),
    "web": (("starlette", "uvicorn"), "the page", ""),
}
_ROS = ("rclpy", "rpyutils", "ament_index_python")
_ROS_ENDINGS = ("_msgs", "_srvs", "_interfaces")
# What no index has: wheels of them are made in a checkout.
_INTERFACES = ("nav2_msgs", "sar_interfaces", "tf2_msgs")


def run(command: Callable[[], int], prog: str) -> int:
    """Run a command and turn its errors for the user into messages.

    Returns:
        The exit status: the command's own, or 2 for a `SarError`, for a library that is not installed, and where
        standard output cannot be written.
    """
    try:
        return _done(command)
    except SarError as error:
        from sar_compiler.tree.diagnostic import TreeError

        # A finding begins with its place, which editors and terminals make a link of.
        print_error(str(error) if isinstance(error, TreeError) else f"{prog}: {error}")
        return USAGE
    except ImportError as error:
        message = _not_installed(error)
        if message is None:
            raise
        print_error(f"{prog}: {message}")
        return USAGE
    except BrokenPipeError:
        # The reader has closed the pipe (`| head`); the rest of the buffer is discarded.
        sys.stderr.close()
        return PIPE_CLOSED
    except (OSError, UnicodeEncodeError) as error:
        reason = _not_written(error)
        if reason is None:
            raise
        discard_output()
        print_error(f"{prog}: standard output cannot be written: {reason}")
        return USAGE
    except KeyboardInterrupt:
        return INTERRUPTED


def _done(command: Callable[[], int]) -> int:
    """Run a command, and write out what it has printed."""
    if sys.stderr is None:  # `print` would take standard output for it
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 - to the end of the process
    if sys.stdout is None:
        message = "standard output is closed"
        raise SarError(message)
    try:
        return command()
    finally:
        sys.stdout.flush()  # while what goes wrong can still be told


def print_error(text: str) -> None:
    """Print a text on standard error, made visible; does nothing where that is closed."""
    with suppress(OSError, UnicodeError):  # nobody can be told
        print(f"{_visible(text)}\n", end="", file=sys.stderr, flush=True)


def print_text(text: str, end: str = "\n", *, flush: bool = False) -> None:
    """Print a text for people on standard output, made visible; data for programs is printed as it is.

    In one piece, also where Python writes each at once (PYTHONUNBUFFERED): lines of the log, which other threads write, come
    between lines then, not into them.
    """
    print(f"{_visible(text)}{end}", end="", flush=flush)


def _visible(text: str) -> str:
    from sar_compiler.tree.showing import visible

    return visible(text)


def interruptible() -> None:
    """From here on, within `run`, Ctrl-C ends a command as an exception: what is half done is tidied up."""
    import signal

    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        with suppress(ValueError):  # only the main thread may decide that
            signal.signal(signal.SIGINT, signal.default_int_handler)


def discard_output() -> None:
    """Discard what is still in the buffer of standard output, and all that is written to it from here on."""
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 - os.devnull is no path of a file
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _not_written(error: OSError | UnicodeEncodeError) -> str | None:
    """Return why standard output could not be written; None if the error is about something else."""
    if isinstance(error, OSError):
        return error.strerror if error.filename is None and error.errno in _UNWRITABLE else None
    encoding = sys.stdout.encoding
    if codecs.lookup(error.encoding) != codecs.lookup(encoding):
        return None
    return (
        f"its encoding is {encoding}, which has no '{error.object[error.start]}'; "
        "choose a UTF-8 locale, or set PYTHONUTF8=1"
    )


def _not_installed(error: ImportError) -> str | None:
    """Return a message about a missing library and its source; None if it is not one to be installed."""
    module = (error.name or "").split(".")[0]
    if module in _SIMULATOR:
        return (
            f"the simulator is not complete ({error}): it needs numpy, scipy and Pillow; "
            "pip install 'sar_compiler[sim]' brings them, rosdep on a robot"
        )
    for extra, (modules, option, hint) in _OF_OPTIONS.items():
        if module in modules:
            return (
                f"{option} takes a library that is not here ({error}): "
                f"pip install 'sar_compiler[{extra}]' brings it{hint}"
            )
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
    import re

    from sar_compiler.tree.guessing import did_you_mean, nearest

    chosen = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message)
    return did_you_mean(nearest(chosen[1], re.findall(r"[\w-]+", chosen[2]))) if chosen else ""


def columns_asked_for() -> int:
    """Return the width that the environment asks for (`COLUMNS`); 0 if it asks for none."""
    text = os.environ.get("COLUMNS", "")
    return int(text) if text.isdecimal() else 0


def columns(stream: TextIO) -> int:
    """Return the width of the terminal that a stream is shown on; 0 for a file or a pipe."""
    try:
        width = os.get_terminal_size(stream.fileno()).columns
    except (AttributeError, ValueError, OSError):
        return 0
    return columns_asked_for() or width


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
        """Report what is wrong with a command line, and what was probably meant, and exit."""
        if message.endswith("are required: COMMAND"):
            self.print_help(sys.stderr)
        else:
            self.print_usage(sys.stderr)
        self.exit(USAGE, _visible(f"{self.prog}: error: {message}{_meant(message)}\n"))

    def complete(self) -> NoReturn:
        """Answer the shell that asks for completions."""
        import argcomplete

        # What follows is ROS', and the shell offers files.
        if "--ros-args" not in os.environ["COMP_LINE"].split():
            argcomplete.autocomplete(self, always_complete_options=False)
        sys.exit()

    def _get_formatter(self) -> argparse.HelpFormatter:
        # It is made for every argument, to look at its name; what argparse asks for the width takes long to import.
        width = columns(sys.stdout) or columns_asked_for() or 80
        return argparse.HelpFormatter(prog=self.prog, width=width - 2)


def add_version(parser: argparse.ArgumentParser) -> None:
    """Add `--version`, which every command has."""
    shown = "show the version and what it runs on, and exit"
    parser.add_argument("--version", action=_VersionAction, default=argparse.SUPPRESS, help=shown)


class _VersionAction(argparse.Action):
    """Shows the version; what that takes is imported only now."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(nargs=0, **{**settings, "dest": argparse.SUPPRESS})

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        import platform
        from importlib.metadata import version

        from sar_compiler.runtime import kernel

        print(
            f"{parser.prog} {version('sar_compiler')} (Python {platform.python_version()}, "
            f"py_trees {version('py_trees')}, kernel: {kernel.described()})"
        )
        parser.exit()
