"""Waiting on a machine that may be busy: as long as something moves, and by the time that a process was given."""

import os
import threading
import time
from contextlib import suppress
from pathlib import Path

# What has brought nothing new for so long will not come, however busy the machine is.
SILENCE_SEC = 60.0
# What has brought news for so long, and never what is waited for, goes round in circles.
ENDLESS_SEC = 600.0


class News(threading.Condition):
    """A condition that counts what happens; whoever waits gives up when nothing has happened for long."""

    def __init__(self):
        super().__init__()
        self._count = 0

    def tell(self):
        """Say, holding the lock, that something has happened."""
        self._count += 1
        self.notify_all()

    def wait_until(self, wanted, complaint, silence_sec=SILENCE_SEC, pid=None):
        """Wait, holding the lock, until something is so, and return it; fail with a complaint when nothing moves any more.

        Args:
            wanted: Returns what is waited for, or nothing yet; called at every news, and ten times a second.
            complaint: Returns what is said if it never is.
            silence_sec: How long nothing may happen, seconds.
            pid: Whose news it is; by default this process's. What it waits for a processor, once half of that has
                passed, does not count: who computes in silence has no more to say for that.
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
    """How long the threads of a process waited for a processor, from now on, because others had them.

    Where the kernel does not tell, it is nothing.

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
        """Look again; a thread that has ended keeps what was seen last of it."""
        self._now.update(self._waited())

    @property
    def sec(self):
        """The sum over all threads, when it was looked last, seconds."""
        return sum(waited - self._before.get(task, 0.0) for task, waited in self._now.items())


class Stopwatch:
    """How long something takes a process that others keep from the processor.

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
        """The same, without what the process's threads waited for a processor; to be read now and then."""
        self._delay.look()
        return self.passed_sec - self._delay.sec
