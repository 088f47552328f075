"""py_trees' nodes that measure time, on the mission's clock.

py_trees' own read the machine's clock, which is wrong for a robot on simulated time.
"""

from py_trees import decorators
from py_trees import timers as stock
from py_trees.behaviour import Behaviour

from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.kernel.stock_decorators import StockTimeoutNode
from sar_compiler.runtime.kernel.timing import WaitingNode
from sar_compiler.runtime.parents import Built


class Timeout(Built, decorators.Timeout):
    """Fails if its child is still running after a time, measured on the mission's clock.

    py_trees' own Timeout reads the machine's clock, which is wrong for a robot on simulated time.

    Args:
        name: The node's name.
        child: The child.
        duration: How long the child may run, in seconds.
        clock: What the time is measured with.
    """

    node_class = StockTimeoutNode

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

    node_class = WaitingNode

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self.clock = clock

    def seconds(self) -> float:
        """Return how long to run, in seconds."""
        return float(self.duration)

    def tell(self, left: str) -> None:
        """Tell whether time is left, as py_trees' own does."""
        self.feedback_message = "still running" if left else f"timer ran out [{self.duration}]"
