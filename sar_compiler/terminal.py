"""Output of commands: the width and colours of a terminal, and progress."""

import os
import sys
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TextIO

from sar_compiler.commands import columns, discard_output, print_error, print_text

if TYPE_CHECKING:
    from sar_compiler.tree.diagnostic import Diagnostic

_SGR = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33", "cyan": "36"}
"""The terminal codes for the words of a style."""


def has_colours(stream: TextIO) -> bool:
    """Return whether to colour the output to a stream.

    `NO_COLOR` (not empty) disables colours, and `CLICOLOR_FORCE` (not 0) enables them for all streams. Otherwise, output to a terminal
    is coloured unless `CLICOLOR=0` or `TERM=dumb` is set.
    """
    environment = os.environ
    if environment.get("NO_COLOR"):
        return False
    if environment.get("CLICOLOR_FORCE", "0") not in ("", "0"):
        return True
    plain = environment.get("CLICOLOR") == "0" or environment.get("TERM") == "dumb"
    return not plain and stream is not None and stream.isatty()


def draws_in_place(stream: TextIO | None) -> bool:
    """Return whether output to a stream can be overwritten. It can on any terminal except a `dumb` one.

    Programs that pass on a process's output, such as launch, use a `dumb` terminal.
    """
    return stream is not None and stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def painter(stream: TextIO) -> Callable[[str, str], str]:
    """Return a function that colours a text by the text's kind (a key of `TERMINAL`) if the stream shows colours."""
    if not has_colours(stream):
        return lambda text, _part: text
    from sar_compiler.style import TERMINAL

    return lambda text, part: f"\x1b[{_sgr(TERMINAL[part])}m{text}\x1b[0m" if text else text


def _sgr(style: str) -> str:
    return ";".join(_SGR[word] for word in style.split())


def findings_as_text(findings: "Iterable[Diagnostic]", stream: TextIO) -> str:
    """Return findings formatted for a stream."""
    from sar_compiler.tree.diagnostic import WIDTH

    width, paint = columns(stream) or WIDTH, painter(stream)
    return "\n".join(finding.render(width, paint) for finding in findings)


class ProgressLine:
    """A progress line on standard error. It is updated in place, and shown only on a terminal.

    For work of less than a second, no line is shown.
    """

    _PATIENCE_SEC = 1.0
    _EVERY_SEC = 0.25

    def __init__(self) -> None:
        self.is_possible = draws_in_place(sys.stderr)
        self._due = time.monotonic() + self._PATIENCE_SEC
        self._is_shown = False

    def show(self, text: Callable[[], str]) -> None:
        """Call *text* and show the result if an update is due. Otherwise, do nothing."""
        now = time.monotonic()
        if now < self._due or not self.is_possible:
            return
        self._due, self._is_shown = now + self._EVERY_SEC, True
        width = (columns(sys.stderr) or 80) - 1
        print(f"\r\x1b[K{text()[:width]}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the line from a terminal."""
        if self._is_shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
        self._is_shown = False


class RunOutput:
    """The output of a run for people. The run continues even if the program that reads the output ends (`| head`).

    Attributes:
        lost: Whether standard output is closed.
        leave: Called before output that must appear below a drawing that is updated in place.
    """

    def __init__(self) -> None:
        self.lost = False
        self.leave: Callable[[], object] = lambda: None

    def print_momentary(self, text: str) -> None:
        """Print a text of momentary interest, unless standard output is closed."""
        if not self.lost:
            self._try(lambda: print_text(text, flush=True))

    def draw(self, text: str) -> None:
        """Write control sequences to a terminal, unless standard output is closed."""
        if not self.lost:
            self._try(lambda: _write(text))

    def print_important(self, text: str) -> None:
        """Print an important text, on standard error if standard output is closed."""
        self.print_momentary(text)
        if self.lost:
            print_error(text)

    def _try(self, write: Callable[[], object]) -> None:
        try:
            write()
        except (OSError, UnicodeError) as error:
            self.lost = True
            reason = error.strerror if isinstance(error, OSError) else str(error)
            print_error(
                f"sar-run: standard output can no longer be written ({reason}). "
                "The run continues without output"
            )
            if isinstance(error, OSError):
                discard_output()


def _write(text: str) -> None:
    """Write a text immediately and in one piece. Characters that the encoding cannot represent become question marks."""
    stream = sys.stdout.buffer
    sys.stdout.flush()
    stream.write(text.encode(sys.stdout.encoding, "replace"))
    stream.flush()
