"""Waiting on a busy machine: limits depend on progress, and on the processor time that a process received."""

import os
import threading
import time
from contextlib import suppress
from pathlib import Path

# Seconds without news after which a wait fails, however busy the machine is.
SILENCE_SEC = 60.0
# Seconds after which a wait fails in any case: there is news, but never the expected one.
ENDLESS_SEC = 600.0


class News(threading.Condition):
    """A condition variable that counts news. A wait fails if there is no news for long."""

    def __init__(self):
        super().__init__()
        self._count = 0

    def tell(self):
        """Report news; the caller holds the lock."""
        self._count += 1
        self.notify_all()

    def wait_until(self, wanted, complaint, silence_sec=SILENCE_SEC, pid=None):
        """Wait, holding the lock, until a function returns a true value, and return it; fail if there is no news for long.

        Args:
            wanted: Returns the result, or a false value; called at every news, and ten times a second.
            complaint: Returns the message of the failure.
            silence_sec: The longest time without news, seconds.
            pid: The process that makes the news; by default this one. After half of the time, its waiting for a processor
                is not counted, because a process that computes silently is slower on a busy machine.
        """
        began = heard = time.monotonic()
        count, others = self._count, None
        while not (found := wanted()):
            now = time.monotonic()
            if self._count != count:
                count, heard, others = self._count, now, None
            elif others is None and now - heard > silence_sec / 2:
                others = Delay(os.getpid() if pid is None else pid)
            elif others is not None:
                others.look()
            silent_sec = now - heard - (others.sec if others else 0.0)
            assert silent_sec < silence_sec and now - began < ENDLESS_SEC, complaint()  # noqa: PT018
            self.wait(0.1)
        return found


class Delay:
    """The time that the threads of a process wait for a processor from now on.

    It is 0 if the kernel does not report it.

    Args:
        pid: The process.
    """

    def __init__(self, pid):
        self._tasks = Path(f"/proc/{pid}/task")
        self._before = self._waited()
        self._now = dict(self._before)

    def _waited(self):
        found = {}
        with suppress(OSError):
            for task in list(self._tasks.iterdir()):
                with suppress(OSError, IndexError):
                    found[task.name] = int((task / "schedstat").read_text().split()[1]) / 1e9
        return found

    def look(self):
        """Read the times again; a thread that has ended keeps its last time."""
        self._now.update(self._waited())

    @property
    def sec(self):
        """The sum over all threads at the last reading, seconds."""
        return sum(waited - self._before.get(task, 0.0) for task, waited in self._now.items())


class Stopwatch:
    """Measures durations of a process, with and without its waiting for a processor.

    Args:
        pid: The process; by default this one.
    """

    def __init__(self, pid=None):
        self._delay = Delay(os.getpid() if pid is None else pid)
        self._began = time.monotonic()

    @property
    def passed_sec(self):
        """The time that has passed since the beginning, seconds."""
        return time.monotonic() - self._began

    @property
    def own_sec(self):
        """The time that has passed without the threads' waiting for a processor, seconds; read it regularly."""
        self._delay.look()
        return self.passed_sec - self._delay.sec
