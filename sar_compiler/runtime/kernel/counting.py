"""The parallel controls of BehaviorTree.CPP. They tick all children until enough children have ended."""

from typing import Final

from sar_compiler.errors import NodeError
from sar_compiler.runtime.kernel.cells import CALLED, ENDED, FAILURE, INVALID, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.tree_nodes import ControlNode, NodeBuilder, Ticker

_BITS: Final = 30
"""The number of children whose bits fit into one 32-bit cell."""


class ThresholdError(NodeError):
    """Raised if a parallel node is configured to wait for more children than it has."""


class CountingNode(ControlNode):
    """Ticks all children. A child that has ended is not ticked again before the next start of the node.

    Attributes:
        through: The first of the cells with one bit for each child. The bit is set when the child has ended.
        successes: The cell that stores the number of children that have succeeded.
        failures: The cell that stores the number of children that have failed.
        current: The cell that stores the index of the current child; used only during a tick.
        skips: The cell that stores the number of children that were skipped; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.through = part.cell()
        for _ in range(_BITS, len(part.children), _BITS):
            part.cell()
        self.successes, self.failures = part.cell(), part.cell()
        self.current, self.skips = part.cell(of_tick=True), part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Begin the tick with the first child that has not ended."""
        ticker.cells[self.status_cell] = RUNNING
        ticker.cells[self.current] = ticker.cells[self.skips] = 0
        return self.tick_unfinished(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue the tick after the current child was ticked."""
        return self.tick_unfinished(ticker, self.count_child(ticker, outcome))

    def tick_unfinished(self, ticker: Ticker, decision: int) -> int:
        """Tick the unfinished children, starting with the current child, until *decision* is not INVALID."""
        cells, children = ticker.cells, self.children
        while decision == INVALID:
            index = cells[self.current]
            if index == len(children):
                return self.end_tick(ticker, self.decide_at_the_end(ticker))
            outcome = INVALID
            place = self.through + int(index // _BITS)
            if not cells[place] >> index % _BITS & 1:
                self.behaviour.current_child = children[index].behaviour
                outcome = children[index].tick(ticker)
                if outcome == CALLED:
                    return CALLED
            decision = self.count_child(ticker, outcome)
        return self.end_tick(ticker, decision)

    def count_child(self, ticker: Ticker, outcome: int) -> int:
        """Count the current child's outcome. Return the node's outcome, or INVALID if it is still undecided."""
        cells, index = ticker.cells, ticker.cells[self.current]
        if outcome & ENDED:
            place = self.through + int(index // _BITS)
            cells[place] |= 1 << index % _BITS
            cells[self.failures if outcome == FAILURE else self.successes] += 1
        elif outcome == SKIPPED:
            cells[self.skips] += 1
        cells[self.current] = index + 1
        return self.decide_early(ticker)

    def threshold(self, port: str, wanted: int) -> int:
        """Convert an attribute's value to a number of children. The value -1 means all children.

        Raises:
            ThresholdError: If the value exceeds the number of children.
        """
        count = len(self.children)
        if wanted > count:
            message = (
                f"'{self.behaviour.name}' waits for {wanted} children, but has only {count}. Write at most {count} as {port}, or a "
                f"negative number to count from the end (-1: all)"
            )
            raise ThresholdError(message, self.behaviour.name)
        return wanted if wanted >= 0 else max(count + wanted + 1, 0)

    def decide_early(self, ticker: Ticker) -> int:  # noqa: ARG002 - for subclasses
        """Return the node's outcome, or INVALID if the children ticked so far do not determine it."""
        return INVALID

    def decide_at_the_end(self, ticker: Ticker) -> int:
        """Return the node's outcome after all children were ticked."""
        raise NotImplementedError

    def end_tick(self, ticker: Ticker, outcome: int) -> int:
        """End the tick with an outcome. SUCCESS and FAILURE also end the node."""
        cells = ticker.cells
        if not outcome & ENDED:
            self.break_off(ticker)
            return outcome
        message = f"{cells[self.successes]} succeeded, {cells[self.failures]} failed"
        self.behaviour.feedback_message = message
        return self.finish(ticker, outcome)


class ParallelNode(CountingNode):
    """A parallel node that may end after each child's tick, without ticking the other children.

    Attributes:
        enough: The cell that stores the required number of successes; used only during a tick.
        too_many: The cell that stores the number of failures after which the node fails; used only during a tick.
        counts_skips: The cell that contains 1 if skipped children are counted as successes; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.enough, self.too_many = part.cell(of_tick=True), part.cell(of_tick=True)
        self.counts_skips = part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Read the thresholds, and begin with the first child that has not ended."""
        cells, behaviour = ticker.cells, self.behaviour
        wanted: int = behaviour.success_count.get()
        cells[self.enough] = self.threshold("success_count", wanted)
        cells[self.too_many] = self.threshold("failure_count", behaviour.failure_count.get())
        cells[self.counts_skips] = int(wanted < 0)
        return super().begin(ticker)

    def decide_early(self, ticker: Ticker) -> int:
        """Return the node's outcome, or INVALID if not enough children have succeeded or failed yet."""
        cells = ticker.cells
        successes, failures = cells[self.successes], cells[self.failures]
        if cells[self.counts_skips]:
            successes += cells[self.skips]
        if successes >= cells[self.enough]:
            return SUCCESS
        if len(self.children) - failures < cells[self.enough] or failures == cells[self.too_many]:
            return FAILURE
        return INVALID

    def decide_at_the_end(self, ticker: Ticker) -> int:
        """Return SKIPPED if all children were skipped, otherwise RUNNING."""
        cells = ticker.cells
        if ticker.tells:
            self.behaviour.feedback_message = f"{cells[self.successes]} of {cells[self.enough]}"
        return SKIPPED if cells[self.skips] == len(self.children) else RUNNING


class ParallelAllNode(CountingNode):
    """A parallel node that ends when all children have ended.

    Attributes:
        too_many: The cell that stores the number of failures that makes the node fail; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.too_many = part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Read the threshold, and begin with the first child that has not ended."""
        ticker.cells[self.too_many] = self.threshold("max_failures", self.behaviour.max_failures.get())
        return super().begin(ticker)

    def decide_at_the_end(self, ticker: Ticker) -> int:
        """Return SKIPPED if all children were skipped, RUNNING if a child runs, otherwise SUCCESS or FAILURE."""
        cells, count = ticker.cells, len(self.children)
        skips, ended = cells[self.skips], cells[self.successes] + cells[self.failures]
        if skips == count:
            return SKIPPED
        if skips + ended == count:
            return FAILURE if cells[self.failures] >= cells[self.too_many] else SUCCESS
        if ticker.tells:
            self.behaviour.feedback_message = f"{ended} of {count}"
        return RUNNING
