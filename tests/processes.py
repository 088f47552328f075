"""Commands of the project as processes that tests start, observe and end."""

import itertools
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from contextlib import closing, suppress
from pathlib import Path

from tests.waiting import SILENCE_SEC, News, Stopwatch

BIN = Path(sys.executable).parent

# The first line of an uncaught exception.
_TRACEBACK = "Traceback (most recent call last)"


class Command:
    """A running command. It stores all lines of standard output and error together.

    Args:
        name: The command, as installed.
        arguments: Its arguments.
        env: Changes to the environment.
        stdin: Its standard input; by default that of this process.
    """

    def __init__(self, name, *arguments, env=None, stdin=None):
        self.name = name
        self._lines = []
        self._news = News()
        # A separate folder, so that a mission does not find the journal of another test. Tests that need a journal name it.
        self._state = tempfile.TemporaryDirectory(prefix="state_of_test")
        self._process = subprocess.Popen(
            [BIN / name, *map(str, arguments)],
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={
                **os.environ,
                "PYTHONFAULTHANDLER": "1",
                "XDG_STATE_HOME": self._state.name,
                **(env or {}),
            },
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout or ():
            with self._news:
                self._lines.append(line.rstrip("\n"))
                self._news.tell()
        with self._news:
            self._news.tell()

    @property
    def pid(self):
        """The process id."""
        return self._process.pid

    @property
    def output(self):
        """The output so far."""
        with self._news:
            return "\n".join(self._lines)

    @property
    def log(self):
        """The messages of the ROS log, without level, time and node."""
        return [match[2] for match in self.stamped_log()]

    def stamped_log(self):
        """Return the ROS log as triples of wall time, node and message."""
        pattern = re.compile(r"\[\w+\] \[([\d.]+)\] \[([^\]]*)\]: (.*)")
        with self._news:
            found = [pattern.fullmatch(line) for line in self._lines]
        return [(float(match[1]), match[2], match[3]) for match in found if match]

    def wait_for(self, text):
        """Wait until a line contains a text; fail with the output if the command ends or stops printing before."""
        searched = 0

        def came():
            nonlocal searched
            new, searched = self._lines[searched:], len(self._lines)
            return any(text in line for line in new) or self.is_over

        with self._news:
            complaint = lambda: f"{self.name} did not print '{text}':\n{self.output}"  # noqa: E731
            self._news.wait_until(came, complaint, pid=self.pid)
            over = self.is_over
        assert not over or text in self.output, f"{self.name} ended without printing '{text}':\n{self.output}"
        return self

    def wait_until(self, wanted, what, silence_sec=SILENCE_SEC):
        """Wait, while the command prints, for a true value and return it; `what` names it in the failure."""
        with self._news:
            complaint = lambda: f"{what} of {self.name} did not come:\n{self.output}"  # noqa: E731
            return self._news.wait_until(wanted, complaint, silence_sec, self.pid)

    @property
    def is_over(self):
        """Whether it has ended and all its output was read."""
        return self._process.poll() is not None and not self._reader.is_alive()

    def send(self, number):
        """Send a signal."""
        self._process.send_signal(number)

    def end(self, meanwhile=lambda: None):
        """Wait, while the command prints, until it ends; return its exit status.

        Args:
            meanwhile: Called ten times a second while it runs; may fail the test.
        """

        def over():
            if self._process.poll() is not None:
                return True
            meanwhile()
            return False

        try:
            with self._news:
                complaint = lambda: f"{self.name} prints nothing more, and does not end"  # noqa: E731
                self._news.wait_until(over, complaint, pid=self.pid)
        except AssertionError as error:
            # Python's fault handler then prints the stack of every thread.
            self.send(signal.SIGABRT)
            self._reader.join(5.0)
            message = f"{error}:\n{self.output}"
            raise AssertionError(message) from None
        self._reader.join(SILENCE_SEC)
        assert _TRACEBACK not in self.output, self.output
        return self._process.returncode

    def stop(self, number=signal.SIGINT, within_sec=2.0):
        """Send a signal and wait until the command ends in time; return its exit status.

        Args:
            number: The signal.
            within_sec: The time limit in seconds, without the time that its threads wait for a processor.
        """
        watch = Stopwatch(self._process.pid)

        # Not checked after the command has ended: this process may notice the end late on a busy machine.
        def in_time():
            own, took = watch.own_sec, watch.passed_sec
            assert own <= within_sec, (
                f"{self.name} has not ended after {took:.2f} s, in {took - own:.2f} s of which others had the processor"
            )

        self.send(number)
        return self.end(in_time)

    def kill(self):
        """Kill the command and its stopped descendants."""
        if self._process.poll() is None:
            # A stopped process would hold Fast DDS' locks in shared memory, and other processes would wait for them.
            stopped = [each for each in _descendants(self.pid) if _state_and_parent(each)[0] == "T"]
            self._process.kill()
            self._process.wait()
            for each in stopped:
                with suppress(ProcessLookupError):
                    os.kill(each, signal.SIGKILL)


# Below the ephemeral ports of Linux, and different for each test process of this machine, because their domains differ.
_FIRST_PORT = 20_000 + 120 * int(os.environ["ROS_DOMAIN_ID"])
_PORTS = itertools.cycle(range(_FIRST_PORT, _FIRST_PORT + 120, 2))


def free_port():
    """Return a free port whose next port is also free. Both are not reserved, and may be returned again."""
    while True:
        port = next(_PORTS)
        with closing(socket.socket()) as one, closing(socket.socket()) as two, suppress(OSError):
            one.bind(("127.0.0.1", port))
            two.bind(("127.0.0.1", port + 1))
            return port


def listening_addresses(port):
    """Return the addresses on which this machine listens on a TCP port, from the kernel's lists; 0.0.0.0 for all of IPv4."""
    lines = [
        line.split() for table in ("tcp", "tcp6") for line in _read(f"/proc/net/{table}").splitlines()[1:]
    ]
    # State 0A is a listener. An address is written in hexadecimal digits in the machine's byte order.
    local = [fields[1].split(":") for fields in lines if fields[3] == "0A"]
    return {
        socket.inet_ntoa(bytes.fromhex(address)[::-1]) if len(address) == 8 else address
        for address, number in local
        if int(number, 16) == port
    }


def children_of(pid, word=""):
    """Return the children of all threads of a process with a word in their command lines.

    It compares the parent of each process, because `/proc/PID/task/*/children` omits children of a thread that is just ending.
    """
    numbers = (int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit())
    found = sorted(number for number in numbers if _state_and_parent(number)[1] == str(pid))
    return [each for each in found if word in _read(f"/proc/{each}/cmdline")]


def processor_sec(pid):
    """Return the processor time that a process has used, seconds; 0 if there is no such process."""
    fields = _read(f"/proc/{pid}/stat").rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


def _descendants(pid):
    """Yield all descendants of a process."""
    for child in children_of(pid):
        yield child
        yield from _descendants(child)


def wait_for_end_of(pid):
    """Wait until a process has ended that is not a child of this process."""
    news = News()
    with news:
        # A process that has ended but was not reaped by its parent is a zombie.
        news.wait_until(lambda: _state_and_parent(pid)[0] in ("", "Z"), lambda: f"process {pid} does not end")


def _state_and_parent(pid):
    """Return two fields of `/proc/PID/stat`; empty ones if there is no such process."""
    # They come after the name, which may contain any characters.
    return (*_read(f"/proc/{pid}/stat").rpartition(")")[2].split()[:2], "", "")[:2]


def _read(path):
    """Return the content of a file in `/proc`; an empty string if the process is gone."""
    with suppress(OSError):
        return Path(path).read_text(errors="replace")
    return ""


def in_order(expected, lines):
    """Return the first expected line that is missing or out of order; None if all are in order."""
    rest = iter(lines)
    return next((line for line in expected if line not in rest), None)
