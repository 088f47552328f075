"""Nodes that measure time, on the clock of the mission.

Stock py_trees reads the machine's clock, which is wrong for a robot on simulated time. The clock is looked at in
each tick; nothing happens between ticks.
"""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.errors import SarError
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.parents import Ticking, Wrapper, Yielding, ended
from sar_compiler.runtime.ports import Input

_MILLISECONDS = 1000.0


class DurationError(SarError):
    """A node is to wait for less than no time."""


class Countdown:
    """Counts a time down on a clock that may stand still, and may go back.

    A clock that goes back counts as one that stood still: what had passed stays passed, and nothing has to be
    waited for twice. A clock that leaps forward is believed.

    Args:
        clock: The clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._looked = 0.0
        self._end: float | None = None

    @property
    def started(self) -> bool:
        """Whether it is running or has run out."""
        return self._end is not None

    def start(self, seconds: float) -> None:
        """Begin to count from a number of seconds."""
        self._looked = self._clock.now()
        self._end = self._looked + seconds

    def stop(self) -> None:
        """Count no more."""
        self._end = None

    def remaining(self) -> float:
        """Return how many seconds are left, 0 at the end; also 0 if it was never started."""
        if self._end is None:
            return 0.0
        now = self._clock.now()
        if now < self._looked:
            self._end -= self._looked - now
        self._looked = now
        return max(self._end - now, 0.0)


class Delay(Yielding, Wrapper):
    """Waits before it ticks its child for the first time.

    Stock py_trees has a Timer to put before the child, which waits again whenever the sequence starts again.

    Args:
        name: The node's name.
        child: The child.
        delay_msec: How long to wait, in milliseconds.
        clock: What the time is measured with.
    """

    def __init__(self, name: str, child: Behaviour, delay_msec: Input[int], clock: Clock) -> None:
        super().__init__(name, child)
        self._delay_msec = delay_msec
        self._timer = Countdown(clock)

    def _work(self) -> Ticking:
        delay = seconds_of(self.name, "delay_msec", self._delay_msec.get())
        if not self._timer.started:
            self._timer.start(delay)
            self.status = Status.RUNNING
            self.feedback_message = time_left(delay)
            return Status.RUNNING if delay else self._pause()
        remaining = self._timer.remaining()
        self.feedback_message = time_left(remaining) if remaining else ""
        if remaining:
            return Status.RUNNING
        outcome = yield from self._tick_child()
        if ended(outcome):
            self._timer.stop()
        return outcome

    def _halt(self) -> None:
        self._timer.stop()
        super()._halt()


class Timeout(Wrapper):
    """Fails if its child is still running after a time; the child is halted without another tick.

    Stock py_trees ticks the child once more before it looks at the time, and reads the machine's clock.

    Args:
        name: The node's name.
        child: The child.
        msec: How long the child may run, in milliseconds; 0: as long as it likes.
        clock: What the time is measured with.
    """

    def __init__(self, name: str, child: Behaviour, msec: Input[int], clock: Clock) -> None:
        super().__init__(name, child)
        self._msec = msec
        self._timer = Countdown(clock)
        self._limited = False

    def _work(self) -> Ticking:
        limit = seconds_of(self.name, "msec", self._msec.get())
        if not self._timer.started:
            self._start(limit)
        elif self._limited and not self._timer.remaining():
            if self.decorated.status == Status.RUNNING:
                return self._time_out()
            # The time ran out over a child that was skipped: it begins with the child.
            self._start(limit)
        self.feedback_message = time_left(self._timer.remaining()) if self._limited else ""
        outcome = yield from self._tick_child()
        if ended(outcome):
            self._timer.stop()
            self.feedback_message = ""
        return outcome

    def _start(self, limit: float) -> None:
        self._timer.start(limit)
        self._limited = limit > 0
        self.status = Status.RUNNING

    def _time_out(self) -> Status:
        self._timer.stop()
        self._reset_children()
        self.feedback_message = "timed out"
        return Status.FAILURE

    def _halt(self) -> None:
        self._timer.stop()
        super()._halt()


class Sleep(Behaviour):
    """Waits, then succeeds.

    Stock py_trees' Timer reads the machine's clock.

    Args:
        name: The node's name.
        msec: How long to wait, in milliseconds; 0: not at all.
        clock: What the time is measured with.
    """

    def __init__(self, name: str, msec: Input[int], clock: Clock) -> None:
        super().__init__(name)
        self._msec = msec
        self._timer = Countdown(clock)

    def initialise(self) -> None:
        """Start the time."""
        self._timer.start(seconds_of(self.name, "msec", self._msec.get()))

    def update(self) -> Status:
        """Return RUNNING until the time is over, then SUCCESS."""
        remaining = self._timer.remaining()
        self.feedback_message = time_left(remaining) if remaining else ""
        return Status.RUNNING if remaining else Status.SUCCESS

    def terminate(self, new_status: Status) -> None:
        """Forget the time."""
        self._timer.stop()
        if new_status == Status.INVALID:
            self.feedback_message = ""


def seconds_of(name: str, port: str, milliseconds: int) -> float:
    """Return how long a node is to wait, in seconds.

    Args:
        name: The node's name.
        port: The attribute that says how long.
        milliseconds: What it says.

    Raises:
        DurationError: If that is less than no time.
    """
    if milliseconds < 0:
        message = f"'{name}' is to wait {milliseconds} milliseconds; {port} is 0 or more"
        raise DurationError(message)
    return milliseconds / _MILLISECONDS


def time_left(seconds: float) -> str:
    """Return what a node tells of the time that is left, in seconds."""
    return f"remaining: {seconds:.1f}s"
