"""Classes of ours that derive from py_trees' own, so that whoever looks at a tree of py_trees' knows them.

Of the stock classes they are only in name, and in what drawings show: SKIPPED and the mission's clock are unknown to those.
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


class _InOrder(OwnControl):
    """Children in order: one that comes to `hands_over` is followed by the next, the other end decides.

    Attributes:
        memory: Start with the running child (true) or with the first child (false) in the next tick.
    """

    node_class = ordering.ResumingNode
    hands_over = SUCCESS
    keeps_place = False
    memory = True

    def build_node(self, part: NodeBuilder) -> TreeNode:
        """Build the node, which depends on the memory."""
        return super().build_node(part) if self.memory else ordering.ReactiveNode(part)


class Sequence(_InOrder, composites.Sequence):
    """A sequence that ignores skipped children, and is skipped if all of them are.

    Stock py_trees stops at a skipped child, as if it had been interrupted.
    """


class Fallback(_InOrder, composites.Selector):
    """A fallback that ignores skipped children, and is skipped if all of them are.

    Stock py_trees takes a skipped child for one that failed.
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
    """Fails if its child is still running after a time, measured on the mission's clock."""

    node_class = StockTimeoutNode

    def __init__(self, name: str, child: Behaviour, duration: float, clock: Clock) -> None:
        super().__init__(name=name, child=child, duration=duration)
        self.clock = clock


class Timer(EngineBehaviour, timers.Timer):
    """Runs until a time has passed on the mission's clock, then succeeds."""

    node_class = timing.TimerNode

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self.clock = clock
