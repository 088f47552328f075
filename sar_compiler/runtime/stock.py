"""Controls, decorators and leaves derived from classes of py_trees, so that py_trees' tools recognise them.

The tools show the names and shapes of the py_trees classes. The behaviour is implemented in this project, because the py_trees classes
support neither SKIPPED nor the mission's clock.
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
    """A composite that ticks its children in order until a child returns a status other than `hands_over`.

    Attributes:
        memory: Whether each tick starts with the running child; otherwise, it starts with the first child.
    """

    node_class = ordering.ResumingNode
    hands_over = SUCCESS
    keeps_place = False
    memory = True

    def build_node(self, part: NodeBuilder) -> TreeNode:
        """Create the node in the kernel. Its class depends on whether the composite has memory."""
        return super().build_node(part) if self.memory else ordering.ReactiveNode(part)


class Sequence(_OrderedComposite, composites.Sequence):
    """A sequence that ignores skipped children, and is skipped if all its children are skipped.

    py_trees' own sequence ends at a skipped child, as if the child had been interrupted.
    """


class Fallback(_OrderedComposite, composites.Selector):
    """A fallback that ignores skipped children, and is skipped if all its children are skipped.

    py_trees' own selector treats a skipped child like a failed child.
    """

    hands_over = FAILURE


class AsyncSequence(Sequence):
    """A sequence that can be halted between children. It returns RUNNING after a child that succeeds at once."""

    node_class = ordering.PausingNode


class AsyncFallback(Fallback):
    """A fallback that can be halted between children. It returns RUNNING after a child that fails at once."""

    node_class = ordering.PausingNode


class SequenceWithMemory(AsyncSequence):
    """An AsyncSequence. When it restarts, it begins with the child that failed or was halted."""

    keeps_place = True


class Timeout(EngineBehaviour, decorators.Timeout):
    """Fails if its child is still running after a time limit. The mission's clock measures the time."""

    node_class = StockTimeoutNode

    def __init__(self, name: str, child: Behaviour, duration: float, clock: Clock) -> None:
        super().__init__(name=name, child=child, duration=duration)
        self.clock = clock


class Timer(EngineBehaviour, timers.Timer):
    """Runs for a given time on the mission's clock, and then succeeds."""

    node_class = timing.TimerNode

    def __init__(self, name: str, clock: Clock, duration: float = 5.0) -> None:
        super().__init__(name, duration)
        self.clock = clock
