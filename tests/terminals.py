"""A terminal for commands of the project, with its screen and a variable size."""

import fcntl
import os
import pty
import select
import struct
import subprocess
import tempfile
import termios
import time

import pyte

from tests.processes import BIN, children_of
from tests.waiting import SILENCE_SEC


class Terminal:
    """A command on a terminal.

    Args:
        name: The command, as installed, or a program's path.
        arguments: Its arguments.
        columns: The width.
        lines: The height.
        env: Changes to the environment.
    """

    def __init__(self, name, *arguments, columns=80, lines=24, env=None):
        self.screen = pyte.HistoryScreen(columns, lines, history=10_000)
        self._stream = pyte.ByteStream(self.screen)
        self._state = tempfile.TemporaryDirectory(prefix="state_of_test")
        self._here, there = pty.openpty()
        self.tell_size(columns, lines)
        terminal = {"TERM": "xterm-256color", "XDG_STATE_HOME": self._state.name, "PYTHONUTF8": "1"}
        without = ("COLUMNS", "LINES", "NO_COLOR")
        self._process = subprocess.Popen(
            [BIN / name, *map(str, arguments)],
            stdin=there,
            stdout=there,
            stderr=there,
            start_new_session=True,
            env={
                **{key: value for key, value in os.environ.items() if key not in without},
                **terminal,
                **(env or {}),
            },
        )
        os.close(there)

    def tell_size(self, columns, lines):
        """Report another terminal size to the command without resizing the screen."""
        fcntl.ioctl(self._here, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def resize(self, columns, lines):
        """Resize the terminal."""
        self.tell_size(columns, lines)
        self.screen.resize(lines, columns)

    @property
    def rows(self):
        """The lines of the screen without trailing spaces."""
        return [row.rstrip() for row in self.screen.display]

    @property
    def history(self):
        """The lines that have scrolled off the screen, and the lines on it."""
        gone = [
            "".join(line[column].data for column in range(self.screen.columns)).rstrip()
            for line in self.screen.history.top
        ]
        return [*gone, *self.rows]

    def wait_for(self, wanted):
        """Wait until a condition on the rows holds, or until a row contains a text."""
        is_so = wanted if callable(wanted) else lambda rows: any(wanted in row for row in rows)
        deadline = time.monotonic() + SILENCE_SEC
        while not is_so(self.rows):
            is_over = self._process.poll() is not None
            came = self._read()
            assert time.monotonic() < deadline, "\n".join(self.rows)
            # Output from before its end can still arrive.
            assert came or not is_over, "\n".join(self.history)
        return self

    def _read(self):
        """Read available output for at most 0.1 s; return whether there was any."""
        ready, _, _ = select.select([self._here], [], [], 0.1)
        try:
            data = os.read(self._here, 65536) if ready else b""
        except OSError:  # the other end is closed
            return False
        self._stream.feed(data)
        return bool(data)

    def send(self, number):
        """Send a signal."""
        self._process.send_signal(number)

    def send_to_child(self, number):
        """Send a signal to the process that the command has started."""
        (child,) = children_of(self._process.pid)
        os.kill(child, number)

    def type(self, text):
        """Type a text."""
        os.write(self._here, text.encode())

    def end(self):
        """Wait for the command to end; return its exit status."""
        deadline = time.monotonic() + SILENCE_SEC
        while self._process.poll() is None:
            deadline = time.monotonic() + SILENCE_SEC if self._read() else deadline
            assert time.monotonic() < deadline, "\n".join(self.rows)
        while self._read():
            pass
        return self._process.returncode

    def kill(self):
        """Kill the command if it still runs, and close the terminal."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        os.close(self._here)
