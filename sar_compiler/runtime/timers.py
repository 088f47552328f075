"""Nodes that measure time, on the clock of the mission.

Stock py_trees reads the machine's clock, which is wrong for a robot on simulated time. The clock is looked at in
each tick; nothing happens between ticks.
"""

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.flat.cells import (
    ENDED,
    FAILURE,
    INVALID,
    RUNNING,
    SKIPPED,
    SUCCESS,
    Cells,
    Stop,
    Tick,
)
from sar_compiler.runtime.flat.parts import Part, builds, halted_with_child, reset, ticked
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Built, Wrapper, Yielding
from sar_compiler.runtime.ports import Input

_MILLISECONDS = 1000.0


class DurationError(SarError):
    """A node is to wait for less than no time."""


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
        self.clock = clock


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
        self.clock = clock


class Sleep(Built):
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
        self.clock = clock


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


_OFF, _COUNTING, _UP, _UNLIMITED = range(4)


class Countdown:
    """A node's timer: a cell with what it does, and one with its token while it counts.

    It is not asked again once it was up.

    Args:
        part: The node.
    """

    def __init__(self, part: Part) -> None:
        self._index = part.index
        self.state = part.cell(_OFF)
        self.token = part.cell(0)

    def start(self, seconds: float, cells: Cells, times: Times) -> None:
        """Begin to count from a number of seconds."""
        cells[self.state] = _COUNTING
        cells[self.token] = times.start(self._index, seconds)

    def is_up(self, cells: Cells, times: Times) -> bool:
        """Return whether the time is over."""
        if cells[self.state] == _COUNTING and times.is_up(self._index, cells[self.token]):
            self.stop(cells, _UP)
        return bool(cells[self.state] == _UP)

    def left(self, cells: Cells, times: Times) -> str:
        """Return what is told of the time that is left."""
        return time_left(times.remaining(self._index, cells[self.token]))

    def stop(self, cells: Cells, state: int = _OFF) -> None:
        """Count no more."""
        cells[self.state], cells[self.token] = state, 0


@builds(Delay)
def delay(part: Part) -> tuple[Tick, Stop]:
    """Build a Delay."""
    at, behaviour = part.at, part.behaviour
    tick_child, timer = ticked(part), Countdown(part)

    def tick(cells: Cells, times: Times) -> int:
        seconds = seconds_of(behaviour.name, "delay_msec", behaviour._delay_msec.get())
        if cells[timer.state] == _OFF:
            timer.start(seconds, cells, times)
            cells[at] = RUNNING
            behaviour.feedback_message = time_left(seconds)
            if not seconds:
                behaviour._wake()
            return RUNNING
        if not timer.is_up(cells, times):
            behaviour.feedback_message = timer.left(cells, times)
            cells[at] = RUNNING
            return RUNNING
        behaviour.feedback_message = ""
        outcome = tick_child(cells, times)
        if outcome & ENDED:
            timer.stop(cells)
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    return tick, halted_with_child(part, timer.state, timer.token)


@builds(Timeout)
def timeout(part: Part) -> tuple[Tick, Stop]:
    """Build a Timeout."""
    at, behaviour, (child,) = part.at, part.behaviour, part.children
    tick_child, timer = ticked(part), Countdown(part)

    def tick(cells: Cells, times: Times) -> int:
        seconds = seconds_of(behaviour.name, "msec", behaviour._msec.get())
        if cells[timer.state] == _OFF:
            start(seconds, cells, times)
        elif timer.is_up(cells, times):
            if cells[child.at] == RUNNING:
                return time_out(cells, times)
            start(seconds, cells, times)
        limited = cells[timer.state] == _COUNTING
        behaviour.feedback_message = timer.left(cells, times) if limited else ""
        outcome = tick_child(cells, times)
        if outcome & ENDED:
            timer.stop(cells)
            behaviour.feedback_message = ""
        if outcome != SKIPPED:
            cells[at] = outcome
        return outcome

    def start(seconds: float, cells: Cells, times: Times) -> None:
        if seconds:
            timer.start(seconds, cells, times)
        else:
            timer.stop(cells, _UNLIMITED)
        cells[at] = RUNNING

    def time_out(cells: Cells, times: Times) -> int:
        timer.stop(cells)
        reset(child, cells, times)
        behaviour.feedback_message = "timed out"
        cells[at] = FAILURE
        return FAILURE

    return tick, halted_with_child(part, timer.state, timer.token)


@builds(Sleep)
def sleep(part: Part) -> tuple[Tick, Stop]:
    """Build a Sleep."""
    at, behaviour = part.at, part.behaviour
    timer = Countdown(part)

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            timer.start(seconds_of(behaviour.name, "msec", behaviour._msec.get()), cells, times)
        if timer.is_up(cells, times):
            behaviour.feedback_message = ""
            timer.stop(cells)
            cells[at] = SUCCESS
            return SUCCESS
        behaviour.feedback_message = timer.left(cells, times)
        cells[at] = RUNNING
        return RUNNING

    def stop(cells: Cells, times: Times) -> None:  # noqa: ARG001
        timer.stop(cells)
        behaviour.feedback_message = ""
        cells[at] = INVALID

    return tick, stop
