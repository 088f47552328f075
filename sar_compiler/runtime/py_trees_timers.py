"""py_trees' nodes that measure time, on the mission's clock.

py_trees' own read the machine's clock, which is wrong for a robot on simulated time.
"""

from py_trees import decorators
from py_trees import timers as stock
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime import timers
from sar_compiler.runtime.clock import Clock


class Timeout(decorators.Timeout):
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
        self._timer = timers.Countdown(clock)

    def initialise(self) -> None:
        """Start the time."""
        self._timer.start(self.duration)
        self.feedback_message = ""

    def update(self) -> Status:
        """Pass the child's status on, or fail once the time is over."""
        if self.decorated.status != Status.RUNNING:
            self.feedback_message = ""
            return self.decorated.status
        remaining = self._timer.remaining()
        if not remaining:
            self.feedback_message = "timed out"
            return Status.FAILURE
        self.feedback_message = timers.time_left(remaining)
        return Status.RUNNING


class Timer(stock.Timer):
    """Runs until a time has passed on the mission's clock, then succeeds.

    py_trees' own Timer reads the machine's clock, which is wrong for a robot on simulated time.

    Args:
        name: The node's name.
        clock: What the time is measured with.
        duration: How long to run, in seconds; 0 or less: succeed at once.
    """

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self._timer = timers.Countdown(clock)

    def initialise(self) -> None:
        """Start the time."""
        self._timer.start(self.duration)

    def update(self) -> Status:
        """Return RUNNING until the time is over, then SUCCESS."""
        if self._timer.remaining():
            # Without the time left, which would make every tick look like a change.
            self.feedback_message = "still running"
            return Status.RUNNING
        self.feedback_message = f"timer ran out [{self.duration}]"
        return Status.SUCCESS
