"""Commands of the project as processes: started, listened to, and ended by tests."""

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

# What tells of a failure that nobody caught.
_TRACEBACK = "Traceback (most recent call last)"


class Command:
    """A running command; all it prints is kept line by line, standard output and error together.

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
        # So that a mission does not find the journal of another test's; whoever wants one found names it.
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
        """The process."""
        return self._process.pid

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

    def wait_for(self, text):
        """Wait, as long as it prints, until a line holds a text; fail with all that was printed if none does."""
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
        """Wait, as long as it prints, until something is so, and return it; `what` says what never came."""
        with self._news:
            complaint = lambda: f"{what} of {self.name} did not come:\n{self.output}"  # noqa: E731
            return self._news.wait_until(wanted, complaint, silence_sec, self.pid)

    @property
    def is_over(self):
        """Whether it has ended, and all that it has printed was read."""
        return self._process.poll() is not None and not self._reader.is_alive()

    def send(self, number):
        """Send a signal."""
        self._process.send_signal(number)

    def end(self, meanwhile=lambda: None):
        """Wait, as long as it prints, for the command to end by itself; return its exit status.

        Args:
            meanwhile: Called ten times a second as long as it runs; may fail the test.
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
            # Python's fault handler then says where every thread is.
            self.send(signal.SIGABRT)
            self._reader.join(5.0)
            message = f"{error}:\n{self.output}"
            raise AssertionError(message) from None
        self._reader.join(SILENCE_SEC)
        assert _TRACEBACK not in self.output, self.output
        return self._process.returncode

    def stop(self, number=signal.SIGINT, within_sec=2.0):
        """Have the command end in order and in time; return its exit status.

        Args:
            number: The signal.
            within_sec: How long that may take, seconds, without what its threads waited for a processor.
        """
        watch = Stopwatch(self._process.pid)

        # Not asked once it has ended: when it is found to have is a matter of the time that this process is given.
        def in_time():
            own, took = watch.own_sec, watch.passed_sec
            assert own <= within_sec, (
                f"{self.name} has not ended after {took:.2f} s, in {took - own:.2f} s of which others had the processor"
            )

        self.send(number)
        return self.end(in_time)

    def kill(self):
        """See that nothing is left of it, whatever the test did."""
        if self._process.poll() is None:
            # One that a test has stopped would keep Fast DDS' locks in shared memory, and others would wait for them.
            stopped = [each for each in _descendants(self.pid) if _state_and_parent(each)[0] == "T"]
            self._process.kill()
            self._process.wait()
            for each in stopped:
                with suppress(ProcessLookupError):
                    os.kill(each, signal.SIGKILL)


# Below those that Linux gives to anybody, and for each test process of this machine others: none has another one's domain.
_FIRST_PORT = 20_000 + 120 * int(os.environ["ROS_DOMAIN_ID"])
_PORTS = itertools.cycle(range(_FIRST_PORT, _FIRST_PORT + 120, 2))


def free_port():
    """Return a port that is free, and the next one with it; both stay free until they are used, and can be had again."""
    while True:
        port = next(_PORTS)
        with closing(socket.socket()) as one, closing(socket.socket()) as two, suppress(OSError):
            one.bind(("127.0.0.1", port))
            two.bind(("127.0.0.1", port + 1))
            return port


def listening_addresses(port):
    """Return the addresses on which this machine listens to a TCP port, as the kernel lists them; 0.0.0.0 for all of IPv4."""
    lines = [
        line.split() for table in ("tcp", "tcp6") for line in _read(f"/proc/net/{table}").splitlines()[1:]
    ]
    # State 0A is a listener; an address is in hexadecimal digits, its bytes in the machine's order.
    local = [fields[1].split(":") for fields in lines if fields[3] == "0A"]
    return {
        socket.inet_ntoa(bytes.fromhex(address)[::-1]) if len(address) == 8 else address
        for address, number in local
        if int(number, 16) == port
    }


def children_of(pid, word=""):
    """Return the children of a process, whichever of its threads has begun them, with a word in their command lines.

    By what each process says of its parent: `/proc/PID/task/*/children` leaves out those of a thread that is just ending.
    """
    numbers = (int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit())
    found = sorted(number for number in numbers if _state_and_parent(number)[1] == str(pid))
    return [each for each in found if word in _read(f"/proc/{each}/cmdline")]


def processor_sec(pid):
    """Return the processor time that a process has used, seconds; 0 if there is no such process."""
    fields = _read(f"/proc/{pid}/stat").rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


def _descendants(pid):
    """Yield the children of a process, and theirs."""
    for child in children_of(pid):
        yield child
        yield from _descendants(child)


def wait_for_end_of(pid):
    """Wait until a process has ended that is nobody's child here."""
    news = News()
    with news:
        # Who has died, and was not asked for by its parent, is there as a zombie.
        news.wait_until(lambda: _state_and_parent(pid)[0] in ("", "Z"), lambda: f"process {pid} does not end")


def _state_and_parent(pid):
    """Return two fields of `/proc/PID/stat`; empty ones if there is no such process."""
    # They come after the name, which may hold anything.
    return (*_read(f"/proc/{pid}/stat").rpartition(")")[2].split()[:2], "", "")[:2]


def _read(path):
    """Return what a file in `/proc` says; nothing of a process that is gone."""
    with suppress(OSError):
        return Path(path).read_text(errors="replace")
    return ""


def in_order(expected, lines):
    """Return the first of the expected lines that does not come after those before it; None if all do."""
    rest = iter(lines)
    return next((line for line in expected if line not in rest), None)
