"""The display of `sar-run --view text`: a redrawn display on a terminal, otherwise a line for each change.

The display occupies the lower lines of the terminal. All other output scrolls above the display, including the log that nodes and libraries
write directly to the terminal. The terminal's scroll margins make this possible.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterable, Sequence

from sar_compiler.execution.run_setup import RunSetup
from sar_compiler.journal.journal_entries import RUN_BEGAN, STATUS, JournalEntry
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import condition
from sar_compiler.ros.clock import mission_clock, steady_timer
from sar_compiler.ros.run_extension import RunExtension
from sar_compiler.style import TERMINAL
from sar_compiler.terminal import draws_in_place
from sar_compiler.views.mission_view import Line, change_text, condition_change, full_height, screen

# Interval between drawings, in seconds of the steady clock.
_PERIOD_SEC = 0.2
# Minimum number of lines reserved for the log, and minimum height of the display in lines.
_LOG_LINES, _LEAST = 4, 3

# Substitutes for terminals whose encoding is not UTF-8.
_IN_ASCII = str.maketrans({"✓": "+", "✕": "x", "…": "~"})

_SAVE, _RESTORE, _HIDE, _SHOW = "\x1b7", "\x1b8", "\x1b[?25l", "\x1b[?25h"
_NO_MARGINS, _TO_THE_END, _CLEAR = "\x1b[r", "\x1b[K", "\x1b[2J"


class RunView(RunExtension):
    """Base class of the displays of a run with `--view text`.

    Args:
        run: The run before its tree is compiled.
    """

    def __init__(self, run: RunSetup) -> None:
        self._output = run.output
        self._state = MissionState.from_stream(run.journal.earlier())


def run_view() -> Callable[[RunSetup], RunView]:
    """Return the constructor of the display: `RunScreen` on a terminal, otherwise `ChangeLog`.

    Raises:
        ImportError: If rich is not installed.
    """
    if not draws_in_place(sys.stdout):
        return ChangeLog
    paint = _painter()
    return lambda run: RunScreen(run, paint)


class ChangeLog(RunView):
    """Prints a line for each change of the mission's state."""

    def __init__(self, run: RunSetup) -> None:
        super().__init__(run)
        # For each node, its last printed status, and the last tick in which it had this status.
        self._printed: dict[int, tuple[str, int]] = {}

    def on_entry(self, entry: JournalEntry) -> None:
        """Print how a journal entry changes the mission's state."""
        nodes, was = self._state.nodes, condition(self._state)
        before = nodes[entry.data["node"]].status if entry.kind == STATUS else ""
        self._state.apply(entry)
        text = change_text(self._state, entry, before)
        if text and entry.kind == STATUS and self._is_repeated(entry.data["node"], entry.data["tick"]):
            text = ""
        for each in (text, condition_change(self._state, was)):
            if each:
                self._output.print_momentary(each)

    def _is_repeated(self, node: int, tick: int) -> bool:
        """Return whether a node has the status that it had in the tick before, although it was reset since then."""
        status = self._state.nodes[node].status_text
        before, self._printed[node] = self._printed.get(node), (status, tick)
        return before == (status, tick - 1)


class RunScreen(RunView):
    """Draws the mission's state on the lower lines of a terminal until it is closed.

    Args:
        run: The run before its tree is compiled.
        paint: Formats lines for a terminal of a given width.
    """

    def __init__(self, run: RunSetup, paint: "Paint") -> None:
        super().__init__(run)
        self._node = run.node
        self._paint = paint
        self._size = (0, 0)
        self._height = 0
        self._start = self._now = 0.0
        self._has_begun = self._is_closed = self._is_to_stop = False
        self._output.leave = self.close

    def on_entry(self, entry: JournalEntry) -> None:
        """Apply a journal entry to the state that the next refresh draws."""
        self._state.apply(entry)
        if entry.kind == RUN_BEGAN:
            self._start, self._has_begun = entry.time, True
            self._listen()
            steady_timer(self._node, _PERIOD_SEC, self.refresh)
        self._now = max(self._now, entry.time)

    def refresh(self) -> None:
        """Draw the display; first suspend the process if Ctrl-Z was pressed."""
        if not self._is_closed:
            self._now = mission_clock(self._node).now()
            if not self._try(self._redraw):
                self._is_closed = True
                self._restore_terminal()

    def close(self) -> None:
        """Draw the display for the last time and release the terminal; further output appears below the display."""
        if self._has_begun and not self._is_closed:
            self._is_closed = True
            self._try(self._draw)
            self._restore_terminal()

    def _try(self, draw: Callable[[], None]) -> bool:
        """Call a drawing function; log an error and return False if it fails."""
        try:
            draw()
        except Exception as error:  # noqa: BLE001 - a view must not end a mission
            self._node.get_logger().error(f"The view has failed and was switched off: {error!r}.")
            return False
        return True

    def _redraw(self) -> None:
        if self._is_to_stop:
            self._suspend()
        self._draw()

    def _restore_terminal(self) -> None:
        if self._height:
            self._output.draw(f"{_NO_MARGINS}\x1b[{self._size[1]};1H\r\n")

    def _listen(self) -> None:
        # The parent process may have disabled the signal.
        if signal.getsignal(signal.SIGTSTP) == signal.SIG_DFL:
            signal.signal(signal.SIGTSTP, self._on_suspend_signal)

    def _on_suspend_signal(self, *_signal: object) -> None:
        # The signal can arrive while the display is drawn, so the process is suspended before the next drawing.
        self._is_to_stop = not self._is_closed
        if self._is_closed:
            _suspend_process()

    def _suspend(self) -> None:
        """Restore the terminal and suspend the process; the display is redrawn when the process continues."""
        self._is_to_stop = False
        self._restore_terminal()
        _suspend_process()
        self._listen()
        self._size = (0, 0)

    def _draw(self) -> None:
        try:
            size = tuple(os.get_terminal_size(sys.stdout.fileno()))
        except (OSError, ValueError):
            return
        begin = self._reserve_lines(size) if size != self._size else ""
        if not self._height:
            self._output.draw(begin)
            return
        width, lines = size
        view = screen(self._state, self._now - self._start, self._height)
        painted = self._paint(view, width, self._height)
        top = lines - self._height + 1
        rows = (f"\x1b[{top + index};1H{row}{_TO_THE_END}" for index, row in enumerate(painted))
        self._output.draw(f"{begin}{_SAVE}{_HIDE}{''.join(rows)}{_RESTORE}{_SHOW}")

    def _reserve_lines(self, size: tuple[int, ...]) -> str:
        """Return the control sequence that reserves lines for the display in a terminal of the given size."""
        is_first, (_, lines) = self._size == (0, 0), size
        self._size = (size[0], lines)
        self._height = min(full_height(self._state), lines - max(_LOG_LINES, lines // 4))
        if self._height < _LEAST:  # the terminal is too small for the log and the display
            self._height = 0
            return "" if is_first else f"{_SAVE}{_NO_MARGINS}{_RESTORE}"
        last = lines - self._height
        margins = f"\x1b[1;{last}r"
        if not is_first:
            return f"{_NO_MARGINS}{_CLEAR}{margins}\x1b[{last};1H"
        # Existing lines scroll up, and the cursor moves with them.
        return f"{chr(10) * self._height}\x1b[{self._height}A{_SAVE}{margins}{_RESTORE}"


def _suspend_process() -> None:
    """Suspend the process with the default handler of SIGTSTP; return when the process continues."""
    signal.signal(signal.SIGTSTP, signal.SIG_DFL)
    signal.raise_signal(signal.SIGTSTP)


Paint = Callable[[Sequence[Line], int, int], Iterable[str]]
"""Formats coloured lines for a terminal, given the terminal's width and number of rows. Lines are shortened to the width."""


def _painter() -> Paint:
    from rich.console import Console
    from rich.text import Text

    console = Console(file=sys.stdout)
    signs = {} if console.encoding.startswith("utf") else _IN_ASCII

    def paint(lines: Sequence[Line], width: int, height: int) -> Iterable[str]:
        for line in lines:
            text = Text.assemble(
                *((piece.text.translate(signs), TERMINAL.get(piece.style, "")) for piece in line), end=""
            )
            text.truncate(width, overflow="ellipsis")
            with console.capture() as painted:
                console.print(text, width=width, no_wrap=True, overflow="crop", highlight=False)
            yield painted.get().rstrip("\n")
        yield from [""] * (height - len(lines))

    return paint
