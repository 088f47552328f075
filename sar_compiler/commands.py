"""The argument parser, the exit statuses and the error messages of all commands."""

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
"""The exit status of `sar-compile` if a check failed with an internal error. The findings of other checks are still reported."""
ROBOT_MAY_MOVE = 4
"""The exit status of a run that was stopped while a goal may still be active."""
INTERRUPTED = 130
PIPE_CLOSED = 141
"""The exit status that a shell reports for a process that wrote to a closed pipe, whose output may not have been read."""

_NO_MEMORY = "failed to map segment"
"""A part of the library loader's message for a lack of memory."""
LIMITS_VARIABLE = "SAR_CALL_LIMITS"
"""The environment variable in which the MCP server passes the limits of a tool call (`agent.call_limits`)."""

_UNWRITABLE = (errno.EBADF, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOSPC)
"""The error numbers of failed writes to standard output. A closed pipe is handled separately."""

# The top-level modules of the simulator's libraries.
_SIMULATOR = ("numpy", "scipy", "PIL")
# The extras of this package: the modules of each extra, the option that needs it, and an addition to the remedy.
_OPTION_EXTRAS = {
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
"""The message packages that no package index provides. Their wheels can be built from a checkout of this repository."""


def run(command: Callable[[], int], prog: str) -> int:  # noqa: PLR0911 - a line for each kind of error
    """Run a command and report its errors to the user as messages.

    Returns:
        The command's exit status, the `exit_status` of a `SarError`, or 2 if a library is missing or standard output cannot be written.
    """
    try:
        return _run_and_flush(command)
    except SarError as error:
        # A finding starts with its location, which editors and terminals turn into a link.
        print_error(str(error) if is_tree_error(error) else f"{prog}: {error}")
        return error.exit_status
    except ImportError as error:
        message = (
            "there is not enough memory for this command"
            if _NO_MEMORY in str(error)
            else missing_library_message(error)
        )
        if message is None:
            raise
        print_error(f"{prog}: {message}")
        return USAGE
    except BrokenPipeError:
        # The reader has closed the pipe (`| head`), so the rest of the buffer is discarded.
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
        # The message is printed below. Here, the exception still refers to the frames, which keep the memory in use.
        pass
    print_error(f"{prog}: there is not enough memory for this command")
    return USAGE


def is_tree_error(error: SarError) -> "TypeGuard[TreeError]":
    """Return whether an error is a `TreeError`, without importing the class: its module is loaded if such an error exists."""
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
    """Print a text on standard error, with control characters escaped. If standard error cannot be written, do nothing."""
    with suppress(OSError, UnicodeError):  # the failure cannot be reported anywhere
        try:
            print(f"{_visible(text)}\n", end="", file=sys.stderr, flush=True)
        except OSError:
            # The buffer is discarded. Otherwise, Python would try to write it again at exit, and change the exit status.
            _discard(sys.stderr)


def print_note(text: str) -> None:
    """Print a note about an unexpected fact on standard error."""
    print_error(f"note: {text}")


def print_text(text: str, end: str = "\n", *, flush: bool = False) -> None:
    """Print a text for people on standard output, with control characters escaped. Do not use it for data that programs read.

    The text is written in one piece, even if Python is unbuffered (PYTHONUNBUFFERED). Log lines of other threads therefore never split
    its lines.
    """
    print(f"{_visible(text)}{end}", end="", flush=flush)


def _visible(text: str) -> str:
    from sar_compiler.tree.display_text import visible

    return visible(text)


def interruptible(*more: int) -> None:
    """Make Ctrl-C raise a `KeyboardInterrupt` from now on. `run` then ends the command after its cleanup code.

    Args:
        more: Other signals with the same effect. The argument of the exception is the number of the signal.
    """

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(number)

    _set_handler(interrupt, *more)


def exit_on_interrupt() -> None:
    """Make Ctrl-C end this process immediately from now on, for a server that reads standard input in a thread.

    An exception in the main thread would not end the thread that reads.
    """

    def leave(number: int, _frame: object) -> None:
        os._exit(128 + number)

    _set_handler(leave)


def _set_handler(handler: Callable[[int, object], None], *more: int) -> None:
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
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 - os.devnull need not be a path
        os.dup2(nowhere.fileno(), stream.fileno())


def _write_failure(error: OSError | UnicodeEncodeError) -> str | None:
    """Return the reason why standard output could not be written; None if the error has another cause."""
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
    """Return the message about a missing library, with the command that installs it; None for an unknown library."""
    if (part := missing_part(error)) is not None:
        return f"a part of sar_compiler is not installed: sar_compiler.{part}"
    module = (error.name or "").split(".")[0]
    if module in _SIMULATOR:
        return (
            f"a library of the simulator is missing ({error}). The simulator and `predict` need numpy, scipy and Pillow. "
            "Install them with pip install 'sar_compiler[sim]', or with rosdep on a robot"
        )
    for extra, (modules, option, hint) in _OPTION_EXTRAS.items():
        if module in modules:
            return (
                f"{option} needs a library that is missing ({error}). "
                f"Install it with pip install 'sar_compiler[{extra}]'{hint}"
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
    """Return a suggestion to append to argparse's message, such as the option that the user probably meant.

    Return an empty string if there is no suggestion.
    """
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
"""The subcommand to suggest for a name that other programs use for the same command."""


def requested_columns() -> int:
    """Return the terminal width from the environment variable `COLUMNS`; 0 if the variable is not set."""
    text = os.environ.get("COLUMNS", "")
    return int(text) if text.isdecimal() else 0


def columns(stream: TextIO) -> int:
    """Return the number of columns of the terminal to which a stream writes; 0 for a file or a pipe."""
    try:
        width = os.get_terminal_size(stream.fileno()).columns
    except (AttributeError, ValueError, OSError):
        return 0
    return requested_columns() or width


class CommandParser(argparse.ArgumentParser):
    """An argument parser that does not accept abbreviated options, and completes arguments in a shell.

    `abridge` shortens `--help`, and adds `--help-all`, which shows the complete help.
    """

    def __init__(self, prog: str = "", description: str = "", **settings: Any) -> None:
        self._full_texts: dict[argparse.Action, str] = {}
        super().__init__(prog=prog, description=description, allow_abbrev=False, **settings)
        # As in Python 3.14: an argument of several numbers, such as -33.9,18.4,90, is a value, not an option.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a command line, or print its completions and exit if a shell requests them."""
        if "_ARGCOMPLETE" in os.environ:
            self.complete()
        return super().parse_args(args, namespace)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a command line. Unknown arguments are reported as errors of this parser, not of its parent."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def abridge(self, *hidden: str, **shortened: str) -> None:
        """Hide some options in `--help`, and shorten the help of others. `--help-all` shows all options in full.

        Args:
            hidden: The names of rarely used options.
            shortened: The shortened help texts, by the name of the argument in the namespace.
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
        """Show every option in the help of this parser and of its subcommands."""
        for action, text in self._full_texts.items():
            action.help = text
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - argparse has no other access to them
                for command in action.choices.values():
                    command.show_all()

    def error(self, message: str) -> NoReturn:
        """Report an error in the command line, with a suggestion, and exit."""
        if message.endswith("are required: COMMAND"):
            self.print_help(sys.stderr)
        else:
            self.print_usage(sys.stderr)
        options = [name for name in self._option_string_actions if name.startswith("--")]
        suggestion = _usage_suggestion(message, options, has_ros="--ros-args" in (self.epilog or ""))
        self.exit(USAGE, _visible(f"{self.prog}: error: {message}{suggestion}\n"))

    def complete(self) -> NoReturn:
        """Print the completions that a shell requests, and exit."""
        import argcomplete

        self.show_all()
        # After --ros-args, the shell completes file names instead.
        if "--ros-args" not in os.environ["COMP_LINE"].split():
            argcomplete.autocomplete(self, always_complete_options=False)
        sys.exit()

    def _get_formatter(self) -> argparse.HelpFormatter:
        # argparse creates a formatter to check each argument's name. Without a width, the formatter would import a slow module.
        width = columns(sys.stdout) or requested_columns() or 80
        return _Formatter(prog=self.prog, width=width - 2)


class _Formatter(argparse.HelpFormatter):
    """A help formatter that writes `[options]` in the usage line instead of all options. The help lists them below."""

    def _format_usage(self, usage: Any, actions: Any, groups: Any, prefix: Any) -> str:
        named = [action for action in actions if action.required or not action.option_strings]
        if usage is None and len(named) < len(actions):
            options = argparse.Action([], "options", metavar="[options]")
            return super()._format_usage(usage, [options, *named], [], prefix)
        return super()._format_usage(usage, actions, groups, prefix)


class _HelpAllAction(argparse.Action):
    """The action of `--help-all`: print the complete help and exit."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(nargs=0, **{**settings, "dest": argparse.SUPPRESS})

    def __call__(self, parser: Any, *_: object) -> None:
        parser.show_all()
        parser.print_help()
        parser.exit()


def add_version(parser: argparse.ArgumentParser) -> None:
    """Add `--version`."""
    shown = "show the versions of the software, and exit"
    parser.add_argument("--version", action=_VersionAction, default=argparse.SUPPRESS, help=shown)


def version_of(distribution: str) -> str:
    """Return the version of an installed distribution from the name of its metadata folder. Importing `importlib.metadata` is slow."""
    for folder in sys.path:
        with suppress(OSError):
            for name in os.listdir(folder or os.curdir):  # noqa: PTH208 - importing pathlib is slow too
                if name.startswith(f"{distribution}-") and name.endswith(".dist-info"):
                    return name.removesuffix(".dist-info").partition("-")[2]
    from importlib.metadata import version

    return version(distribution)


class _VersionAction(argparse.Action):
    """The action of `--version`: print the versions and exit."""

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
