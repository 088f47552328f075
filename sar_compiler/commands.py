"""Common parts of all commands: their parser, their exit statuses, and their error messages."""

import argparse
import codecs
import errno
import os
import re
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from sar_compiler.errors import SarError
from sar_compiler.parts import missing_part

if TYPE_CHECKING:
    from typing import TypeGuard

    from sar_compiler.tree.diagnostic import TreeError

OK = 0
FINDINGS = 1
USAGE = 2
RULE_FAILED = 3
"""The status of `sar-compile` if one of the project's own rules failed; findings of the others are reported."""
ROBOT_MAY_MOVE = 4
"""The status of a stopped run with a goal that may still be active."""
INTERRUPTED = 130
PIPE_CLOSED = 141
"""The status that a shell reports for a process that wrote to a closed pipe: the output may not have been read."""

_NO_MEMORY = "failed to map segment"
"""Part of the library loader's message if there is no memory for a library."""
LIMITS_VARIABLE = "SAR_CALL_LIMITS"
"""The environment variable with the limits of a call by the server of tools for agents (`agent.call_limits`)."""

_UNWRITABLE = (errno.EBADF, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOSPC)
"""Errors of writing to standard output, other than a closed pipe."""

# Top-level modules of the simulator's libraries, and of ROS.
_SIMULATOR = ("numpy", "scipy", "PIL")
# Extras for single options: their modules, the option, and a further remedy.
_OF_OPTIONS = {
    "groot2": (("zmq", "msgpack"), "--groot2", ", or apt's python3-zmq and python3-msgpack on a robot"),
    "lsp": (("pygls", "lsprotocol", "cattrs", "attr", "attrs"), "the language server", ""),
    "mcp": (("mcp", "mcp_types", "anyio"), "the server of tools for agents", ""),
    "record": (("mcap", "lz4", "zstandard"), "--record", ""),
    "report": (
        ("cap_tools", "geojson", "jinja2", "pyproj", "xsdata"),
        "a report as a page or in world coordinates",
        ", or for a page apt's python3-jinja2 on a robot",
    ),
    "search": (("shapely",), "an area with a polygon", ", or apt's python3-shapely on a robot"),
    "view": (
        ("rich",),
        "--view text on a terminal",
        ". Without it, `--view text | cat` prints each change on a line",
    ),
    "web": (("starlette", "uvicorn"), "the page", ""),
}
_ROS = ("rclpy", "rpyutils", "ament_index_python")
_ROS_ENDINGS = ("_msgs", "_srvs", "_interfaces")
INTERFACES = ("bond", "btcpp_ros2_interfaces", "nav2_msgs", "sar_interfaces", "tf2_msgs")
"""Message packages that no index provides: their wheels are built in a checkout."""


def run(command: Callable[[], int], prog: str) -> int:  # noqa: PLR0911 - a line for each kind of error
    """Run a command and report its errors to the user as messages.

    Returns:
        The exit status: the command's own, that of a `SarError` (mostly 2), or 2 for a missing library, and for
            unwritable standard output.
    """
    try:
        return _run_and_flush(command)
    except SarError as error:
        # A finding starts with its location, which editors and terminals turn into a link.
        print_error(str(error) if is_tree_error(error) else f"{prog}: {error}")
        return error.exit_status
    except ImportError as error:
        message = (
            "there is not enough memory for this"
            if _NO_MEMORY in str(error)
            else missing_library_message(error)
        )
        if message is None:
            raise
        print_error(f"{prog}: {message}")
        return USAGE
    except BrokenPipeError:
        # The reader has closed the pipe (`| head`); the rest of the buffer is discarded.
        sys.stderr.close()
        return PIPE_CLOSED
    except (OSError, UnicodeEncodeError) as error:
        reason = _write_failure(error)
        if reason is None and isinstance(error, OSError) and isinstance(error.filename, (str, bytes)):
            print_error(f"{prog}: {os.fsdecode(error.filename)}: {error.strerror}")
            return USAGE
        if reason is None:
            raise
        discard_output()
        print_error(f"{prog}: standard output cannot be written: {reason}")
        return USAGE
    except KeyboardInterrupt as interrupt:
        return status_of_interrupt(interrupt)
    except MemoryError:
        # Reported only below: the exception holds the frames, and these the memory.
        pass
    print_error(f"{prog}: there is not enough memory for this")
    return USAGE


def is_tree_error(error: SarError) -> "TypeGuard[TreeError]":
    """Return whether an error is a `TreeError`, without importing its slow module, which any such error has imported."""
    diagnostic = sys.modules.get("sar_compiler.tree.diagnostic")
    return diagnostic is not None and isinstance(error, diagnostic.TreeError)


def _run_and_flush(command: Callable[[], int]) -> int:
    """Run a command, and flush its output."""
    if sys.stderr is None:  # `print` would use standard output instead
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 - to the end of the process
    if sys.stdout is None:
        raise SarError("standard output is closed")
    try:
        return command()
    finally:
        sys.stdout.flush()  # while errors can still be reported


def print_error(text: str) -> None:
    """Print a text on standard error, with visible control characters; do nothing if that is closed or unwritable."""
    with suppress(OSError, UnicodeError):  # there is nowhere to report it
        try:
            print(f"{_visible(text)}\n", end="", file=sys.stderr, flush=True)
        except OSError:
            # Python would try again at its end, and change the exit status.
            _discard(sys.stderr)


def print_note(text: str) -> None:
    """Print a note about something unexpected that is not an error on standard error."""
    print_error(f"note: {text}")


def print_text(text: str, end: str = "\n", *, flush: bool = False) -> None:
    """Print a text for people on standard output, with visible control characters; data for programs is printed unchanged.

    The text is written in one piece, even if Python is unbuffered (PYTHONUNBUFFERED), so that log lines of other threads appear between lines
    and not within them.
    """
    print(f"{_visible(text)}{end}", end="", flush=flush)


def _visible(text: str) -> str:
    from sar_compiler.tree.display_text import visible

    return visible(text)


def interruptible(*more: int) -> None:
    """From here on, within `run`, turn Ctrl-C into an exception that ends the command, so that cleanup code runs.

    Args:
        more: Other signals with the same effect. The `KeyboardInterrupt` has the number of the signal as its argument.
    """

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(number)

    _handle(interrupt, *more)


def exit_on_interrupt() -> None:
    """From here on, end this process at once on Ctrl-C: a server reads standard input in a thread that no exception reaches."""

    def leave(number: int, _frame: object) -> None:
        os._exit(128 + number)

    _handle(leave)


def _handle(handler: Callable[[int, object], None], *more: int) -> None:
    import signal

    for number in (signal.SIGINT, *more):
        if signal.getsignal(number) != signal.SIG_IGN:
            with suppress(ValueError):  # only the main thread may set handlers
                signal.signal(number, handler)


def status_of_interrupt(interrupt: KeyboardInterrupt) -> int:
    """Return the exit status of a command ended by a signal: 130 after Ctrl-C."""
    return 128 + int(interrupt.args[0]) if interrupt.args else INTERRUPTED


def discard_output() -> None:
    """Discard the buffer of standard output, and all further output."""
    _discard(sys.stdout)


def _discard(stream: TextIO) -> None:
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 - os.devnull is no path of a file
        os.dup2(nowhere.fileno(), stream.fileno())


def _write_failure(error: OSError | UnicodeEncodeError) -> str | None:
    """Return why standard output could not be written; None if the error has another cause."""
    if isinstance(error, OSError):
        return error.strerror if error.filename is None and error.errno in _UNWRITABLE else None
    encoding = sys.stdout.encoding
    if codecs.lookup(error.encoding) != codecs.lookup(encoding):
        return None
    return (
        f"its encoding is {encoding}, which cannot represent '{error.object[error.start]}'. "
        "Choose a UTF-8 locale, or set PYTHONUTF8=1"
    )


def missing_library_message(error: ImportError) -> str | None:
    """Return a message about a missing library and its source; None if the library cannot be installed."""
    if (part := missing_part(error)) is not None:
        return f"a part of sar_compiler is not installed: sar_compiler.{part}"
    module = (error.name or "").split(".")[0]
    if module in _SIMULATOR:
        return (
            f"a library of the simulator is missing ({error}): the simulator and `predict` need numpy, scipy and Pillow. "
            "Install them with pip install 'sar_compiler[sim]', or with rosdep on a robot"
        )
    for extra, (modules, option, hint) in _OF_OPTIONS.items():
        if module in modules:
            return (
                f"{option} needs a missing library ({error}): "
                f"install it with pip install 'sar_compiler[{extra}]'{hint}"
            )
    if module in INTERFACES and "rclpy" in sys.modules:
        return (
            f"ROS 2 is installed, but not the interface package '{module}' ({error}). On a robot, source the workspace and "
            "Nav2. Without a robot, build it with `make wheels` in a checkout and run `pip install --find-links dist "
            "'sar_compiler[interfaces]'`"
        )
    if module in _ROS or module.endswith(_ROS_ENDINGS):
        return (
            f"ROS 2 is missing ({error}). On a robot, source its installation and workspace. Without a robot, "
            "run pip install 'sar_compiler[ros]' (in a checkout: `make env`)"
        )
    return None


def _usage_suggestion(message: str, options: Iterable[str], *, has_ros: bool) -> str:
    """Return the suggestion that argparse's message lacks: the choice, or the option, that was probably meant."""
    from sar_compiler.tree.guessing import did_you_mean, nearest

    if chosen := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message):
        known, other = re.findall(r"[\w-]+", chosen[2]), _OTHER_NAMES.get(chosen[1])
        return did_you_mean(nearest(chosen[1], known) or (other if other in known else None))
    if has_ros and re.match(r"unrecognized arguments: (-[pr]|--params-file|--remap|--param)\b", message):
        return "; write ROS arguments after --ros-args"
    if file := re.match(r"unrecognized arguments: ([^-]\S*\.ya?ml)$", message):
        named = [
            f"{each} {file[1]}" for each in ("--scenario", "--properties", "--params") if each in options
        ]
        return f"; write {' or '.join(named)}" if named else ""
    if unknown := re.match(r"unrecognized arguments: (--[\w-]+)", message):
        written = unknown[1]
        # `--simulate` for `--sim`, `--port` for `--web-port`.
        longer = [each for each in options if written.startswith(each) or written[2:] in each[2:].split("-")]
        return did_you_mean(nearest(written, options) or (longer[0] if len(longer) == 1 else None))
    return ""


_OTHER_NAMES = {
    **dict.fromkeys(("check", "lint", "test"), "validate"),
    **dict.fromkeys(("draw", "print", "graph", "render"), "show"),
    **dict.fromkeys(("run", "play", "execute"), "simulate"),
    **dict.fromkeys(("prove", "model-check"), "verify"),
    **dict.fromkeys(("list", "palette"), "nodes"),
    "fmt": "format",
    "help": "explain",
}
"""Commands that other programs call."""


def requested_columns() -> int:
    """Return the width that the environment requests (`COLUMNS`); 0 if it requests none."""
    text = os.environ.get("COLUMNS", "")
    return int(text) if text.isdecimal() else 0


def columns(stream: TextIO) -> int:
    """Return the width of the terminal of a stream; 0 for a file or a pipe."""
    try:
        width = os.get_terminal_size(stream.fileno()).columns
    except (AttributeError, ValueError, OSError):
        return 0
    return requested_columns() or width


class CommandParser(argparse.ArgumentParser):
    """An argument parser that accepts no abbreviated options, and completes them for a shell.

    What `abridge` leaves out of `--help` is in `--help-all`, which an abridged parser has.
    """

    def __init__(self, prog: str = "", description: str = "", **settings: Any) -> None:
        self._full_texts: dict[argparse.Action, str] = {}
        super().__init__(prog=prog, description=description, allow_abbrev=False, **settings)
        # As of Python 3.14: a value of several numbers, such as -33.9,18.4,90, is not an option either.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a command line; if a shell requests its completion, respond and exit."""
        if "_ARGCOMPLETE" in os.environ:
            self.complete()
        return super().parse_args(args, namespace)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a command line; unknown arguments are errors of this command, not of its parent."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def abridge(self, *hidden: str, **shortened: str) -> None:
        """Hide options and shorten the help of others in `--help`; `--help-all` has them all in full.

        Args:
            hidden: Names of rarely used options.
            shortened: Help texts by the name of the argument in the namespace.
        """
        shown = "show all options in full, and exit"
        self.add_argument("--help-all", action=_HelpAllAction, default=argparse.SUPPRESS, help=shown)
        for action in self._actions:
            if (
                text := argparse.SUPPRESS
                if {*hidden} & {*action.option_strings}
                else shortened.get(action.dest)
            ):
                self._full_texts[action], action.help = str(action.help), text

    def show_all(self) -> None:
        """Show every option in the help, here and in the subcommands."""
        for action, text in self._full_texts.items():
            action.help = text
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - argparse has no other access to them
                for command in action.choices.values():
                    command.show_all()

    def error(self, message: str) -> NoReturn:
        """Report the error of a command line with a suggestion, and exit."""
        if message.endswith("are required: COMMAND"):
            self.print_help(sys.stderr)
        else:
            self.print_usage(sys.stderr)
        options = [name for name in self._option_string_actions if name.startswith("--")]
        meant = _usage_suggestion(message, options, has_ros="--ros-args" in (self.epilog or ""))
        self.exit(USAGE, _visible(f"{self.prog}: error: {message}{meant}\n"))

    def complete(self) -> NoReturn:
        """Respond to a shell that requests completions."""
        import argcomplete

        self.show_all()
        # ROS arguments follow, for which the shell offers files.
        if "--ros-args" not in os.environ["COMP_LINE"].split():
            argcomplete.autocomplete(self, always_complete_options=False)
        sys.exit()

    def _get_formatter(self) -> argparse.HelpFormatter:
        # A formatter is made for every argument, to check its name; argparse's import for the width takes long.
        width = columns(sys.stdout) or requested_columns() or 80
        return _Formatter(prog=self.prog, width=width - 2)


class _Formatter(argparse.HelpFormatter):
    """Replaces optional arguments in the usage line by `[options]`, because the help lists them below."""

    def _format_usage(self, usage: Any, actions: Any, groups: Any, prefix: Any) -> str:
        named = [action for action in actions if action.required or not action.option_strings]
        if usage is None and len(named) < len(actions):
            options = argparse.Action([], "options", metavar="[options]")
            return super()._format_usage(usage, [options, *named], [], prefix)
        return super()._format_usage(usage, actions, groups, prefix)


class _HelpAllAction(argparse.Action):
    """Shows the help with the rarely used options."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(nargs=0, **{**settings, "dest": argparse.SUPPRESS})

    def __call__(self, parser: Any, *_: object) -> None:
        parser.show_all()
        parser.print_help()
        parser.exit()


def add_version(parser: argparse.ArgumentParser) -> None:
    """Add `--version`, which every command has."""
    shown = "show the versions of what is in use, and exit"
    parser.add_argument("--version", action=_VersionAction, default=argparse.SUPPRESS, help=shown)


def version_of(distribution: str) -> str:
    """Return the version of an installed distribution: as the folder of its metadata is called, since `importlib.metadata` takes long to import."""
    for folder in sys.path:
        with suppress(OSError):
            for name in os.listdir(folder or os.curdir):  # noqa: PTH208 - pathlib takes a moment too
                if name.startswith(f"{distribution}-") and name.endswith(".dist-info"):
                    return name.removesuffix(".dist-info").partition("-")[2]
    from importlib.metadata import version

    return version(distribution)


class _VersionAction(argparse.Action):
    """Shows the version; its dependencies are imported only now."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(nargs=0, **{**settings, "dest": argparse.SUPPRESS})

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from sar_compiler.runtime import kernel

        python = sys.version.partition(" ")[0]
        print(
            f"{parser.prog} {version_of('sar_compiler')} (Python {python}, "
            f"py_trees {version_of('py_trees')}, kernel: {kernel.describe()})"
        )
        parser.exit()
