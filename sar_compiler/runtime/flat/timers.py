"""Nodes that measure time: those of `runtime.timers`, and py_trees' on the mission's clock."""

from sar_compiler.runtime import py_trees_timers
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
from sar_compiler.runtime.flat.decorators import ticked
from sar_compiler.runtime.flat.parts import Part, builds, halted_by, reset
from sar_compiler.runtime.flat.stock_decorators import decorated
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.timers import Delay, Sleep, Timeout, seconds_of, time_left

_OFF, _COUNTING, _UP, _UNLIMITED = range(4)


class _Timer:
    """A node's timer: a cell with what it does, and one with its token while it counts.

    It is not asked again once it was up.

    Args:
        part: The node.
    """

    def __init__(self, part: Part) -> None:
        self._index = part.index
        self.state = part.cell(_OFF)
        self._token = part.cell(0)

    def start(self, seconds: float, cells: Cells, times: Times) -> None:
        """Begin to count from a number of seconds."""
        cells[self.state] = _COUNTING
        cells[self._token] = times.start(self._index, seconds)

    def is_up(self, cells: Cells, times: Times) -> bool:
        """Return whether the time is over."""
        if cells[self.state] == _COUNTING and times.is_up(self._index, cells[self._token]):
            self.stop(cells, _UP)
        return bool(cells[self.state] == _UP)

    def left(self, cells: Cells, times: Times) -> str:
        """Return what is told of the time that is left."""
        return time_left(times.remaining(self._index, cells[self._token]))

    def stop(self, cells: Cells, state: int = _OFF) -> None:
        """Count no more."""
        cells[self.state], cells[self._token] = state, 0


@builds(Delay)
def delay(part: Part) -> tuple[Tick, Stop]:
    """Build a Delay."""
    at, behaviour = part.at, part.behaviour
    tick_child, timer = ticked(part), _Timer(part)

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

    return tick, _halted(part, timer)


@builds(Timeout)
def timeout(part: Part) -> tuple[Tick, Stop]:
    """Build a Timeout."""
    at, behaviour, (child,) = part.at, part.behaviour, part.children
    tick_child, timer = ticked(part), _Timer(part)

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

    return tick, _halted(part, timer)


@builds(py_trees_timers.Timeout)
def stock_timeout(part: Part) -> tuple[Tick, Stop]:
    """Build a Timeout of py_trees', on the mission's clock."""
    behaviour, (child,) = part.behaviour, part.children
    timer = _Timer(part)

    def initialise(cells: Cells, times: Times) -> None:
        timer.start(behaviour.duration, cells, times)
        behaviour.feedback_message = ""

    def update(cells: Cells, times: Times) -> int:
        status: int = cells[child.at]
        if status != RUNNING:
            behaviour.feedback_message = ""
            return status
        if timer.is_up(cells, times):
            behaviour.feedback_message = "timed out"
            return FAILURE
        behaviour.feedback_message = timer.left(cells, times)
        return RUNNING

    def terminate(cells: Cells, status: int) -> None:  # noqa: ARG001
        timer.stop(cells)

    return decorated(part, initialise, update, terminate)


@builds(Sleep)
def sleep(part: Part) -> tuple[Tick, Stop]:
    """Build a Sleep."""
    at, behaviour = part.at, part.behaviour
    timer = _Timer(part)

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


@builds(py_trees_timers.Timer)
def stock_timer(part: Part) -> tuple[Tick, Stop]:
    """Build a Timer of py_trees', on the mission's clock."""
    at, behaviour = part.at, part.behaviour
    timer = _Timer(part)

    def tick(cells: Cells, times: Times) -> int:
        if cells[at] != RUNNING:
            timer.start(behaviour.duration, cells, times)
        if timer.is_up(cells, times):
            behaviour.feedback_message = f"timer ran out [{behaviour.duration}]"
            timer.stop(cells)
            cells[at] = SUCCESS
            return SUCCESS
        behaviour.feedback_message = "still running"
        cells[at] = RUNNING
        return RUNNING

    def stop(cells: Cells, times: Times) -> None:  # noqa: ARG001
        timer.stop(cells)
        cells[at] = INVALID

    return tick, stop


def _halted(part: Part, timer: _Timer) -> Stop:
    (child,) = part.children

    def halt(cells: Cells, times: Times) -> None:
        timer.stop(cells)
        reset(child, cells, times)

    return halted_by(part, halt)
