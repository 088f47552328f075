"""py_trees' nodes that measure time, on the mission's clock.

py_trees' own read the machine's clock, which is wrong for a robot on simulated time.
"""

from py_trees import decorators
from py_trees import timers as stock
from py_trees.behaviour import Behaviour

from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.flat.cells import FAILURE, INVALID, RUNNING, SUCCESS, Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Part, builds
from sar_compiler.runtime.flat.stock_decorators import decorated
from sar_compiler.runtime.flat.times import Times
from sar_compiler.runtime.parents import Built
from sar_compiler.runtime.timers import Countdown


class Timeout(Built, decorators.Timeout):
    """Fails if its child is still running after a time, measured on the mission's clock.

    py_trees' own Timeout reads the machine's clock, which is wrong for a robot on simulated time.

    Args:
        name: The node's name.
        child: The child.
        duration: How long the child may run, in seconds.
        clock: What the time is measured with.
    """

    def __init__(self, name: str, child: Behaviour, duration: float, clock: Clock) -> None:
        super().__init__(name=name, child=child, duration=duration)
        self.clock = clock


class Timer(Built, stock.Timer):
    """Runs until a time has passed on the mission's clock, then succeeds.

    py_trees' own Timer reads the machine's clock, which is wrong for a robot on simulated time.

    Args:
        name: The node's name.
        clock: What the time is measured with.
        duration: How long to run, in seconds; 0 or less: succeed at once.
    """

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self.clock = clock


@builds(Timeout)
def stock_timeout(part: Part) -> tuple[Tick, Stop]:
    """Build a Timeout of py_trees', on the mission's clock."""
    behaviour, (child,) = part.behaviour, part.children
    timer = Countdown(part)

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


@builds(Timer)
def stock_timer(part: Part) -> tuple[Tick, Stop]:
    """Build a Timer of py_trees', on the mission's clock."""
    at, behaviour = part.at, part.behaviour
    timer = Countdown(part)

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
