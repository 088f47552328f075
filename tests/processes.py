"""Commands of the project as processes: started, listened to, and ended by tests."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

BIN = Path(sys.executable).parent

# What tells of a failure that nobody caught.
_TRACEBACK = "Traceback (most recent call last)"


class Command:
    """A running command; all it prints is kept line by line, standard output and error together.

    Args:
        name: The command, as installed.
        arguments: Its arguments.
        env: Changes to the environment.
    """

    def __init__(self, name, *arguments, env=None):
        self.name = name
        self._lines = []
        self._news = threading.Condition()
        self._process = subprocess.Popen(
            [BIN / name, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONFAULTHANDLER": "1", **(env or {})},
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout or ():
            with self._news:
                self._lines.append(line.rstrip("\n"))
                self._news.notify_all()
        with self._news:
            self._news.notify_all()

    @property
    def output(self):
        """All that was printed so far."""
        with self._news:
            return "\n".join(self._lines)

    @property
    def log(self):
        """The texts of the ROS log, without level, time and node."""
        return [match[2] for match in self.stamped_log()]

    def stamped_log(self):
        """The ROS log as triples of wall time, node and text."""
        pattern = re.compile(r"\[\w+\] \[([\d.]+)\] \[([^\]]*)\]: (.*)")
        with self._news:
            found = [pattern.fullmatch(line) for line in self._lines]
        return [(float(match[1]), match[2], match[3]) for match in found if match]

    def wait_for(self, text, timeout_sec=30.0):
        """Wait until a line holds a text; fail with all that was printed if none does in time."""
        deadline = time.monotonic() + timeout_sec
        with self._news:
            while not any(text in line for line in self._lines):
                ended = self._process.poll() is not None and not self._reader.is_alive()
                if ended or not self._news.wait(max(0.0, min(0.2, deadline - time.monotonic()))):
                    over = ended or time.monotonic() > deadline
                    assert not over, f"{self.name} did not print '{text}':\n" + "\n".join(self._lines)
        return self

    def send(self, number):
        """Send a signal."""
        self._process.send_signal(number)

    def end(self, timeout_sec=60.0):
        """Wait for the command to end by itself; return its exit status."""
        try:
            status = self._process.wait(timeout_sec)
        except subprocess.TimeoutExpired:
            # Python's fault handler then says where every thread is.
            self.send(signal.SIGABRT)
            self._reader.join(5.0)
            message = f"{self.name} did not end within {timeout_sec} s:\n{self.output}"
            raise AssertionError(message) from None
        self._reader.join(5.0)
        assert _TRACEBACK not in self.output, self.output
        return status

    def stop(self, number=signal.SIGINT, timeout_sec=2.0):
        """Have the command end in order and in time; return its exit status and how long it took."""
        start = time.monotonic()
        self.send(number)
        status = self.end(timeout_sec)
        return status, time.monotonic() - start

    def kill(self):
        """See that nothing is left of it, whatever the test did."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()


def in_order(expected, lines):
    """Return the first of the expected lines that does not come after those before it; None if all do."""
    rest = iter(lines)
    return next((line for line in expected if line not in rest), None)
