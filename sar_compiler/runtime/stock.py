"""Classes derived from those of py_trees, so that its tools recognise them.

Only their names and drawings are those of the stock classes, which support neither SKIPPED nor the mission's clock.
"""

from py_trees import composites, decorators, timers
from py_trees.behaviour import Behaviour

from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.kernel import ordering, timing
from sar_compiler.runtime.kernel.cells import FAILURE, SUCCESS
from sar_compiler.runtime.kernel.stock_decorators import StockTimeoutNode
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, TreeNode
from sar_compiler.runtime.parents import EngineBehaviour
from sar_compiler.runtime.ticking import OwnControl


class _OrderedComposite(OwnControl):
    """Children in order: after `hands_over` the next child is ticked; the other result ends the node.

    Attributes:
        memory: Start with the running child (true) or with the first child (false) in the next tick.
    """

    node_class = ordering.ResumingNode
    hands_over = SUCCESS
    keeps_place = False
    memory = True

    def build_node(self, part: NodeBuilder) -> TreeNode:
        """Build the node, whose class depends on the memory."""
        return super().build_node(part) if self.memory else ordering.ReactiveNode(part)


class Sequence(_OrderedComposite, composites.Sequence):
    """A sequence that ignores skipped children, and is skipped if all of them are.

    Stock py_trees stops at a skipped child, as if it had been interrupted.
    """


class Fallback(_OrderedComposite, composites.Selector):
    """A fallback that ignores skipped children, and is skipped if all of them are.

    Stock py_trees treats a skipped child as one that failed.
    """

    hands_over = FAILURE


class AsyncSequence(Sequence):
    """A sequence that pauses after every child that succeeds at once, so that it can be interrupted there."""

    node_class = ordering.PausingNode


class AsyncFallback(Fallback):
    """A fallback that pauses after every child that fails at once, so that it can be interrupted there."""

    node_class = ordering.PausingNode


class SequenceWithMemory(AsyncSequence):
    """An AsyncSequence that starts with the failed or halted child when it is started again."""

    keeps_place = True


class Timeout(EngineBehaviour, decorators.Timeout):
    """Fails if its child is still running after a time limit, measured by the mission's clock."""

    node_class = StockTimeoutNode

    def __init__(self, name: str, child: Behaviour, duration: float, clock: Clock) -> None:
        super().__init__(name=name, child=child, duration=duration)
        self.clock = clock


class Timer(EngineBehaviour, timers.Timer):
    """Runs for a time measured by the mission's clock, then succeeds."""

    node_class = timing.TimerNode

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self.clock = clock
