"""The sequences and fallbacks of BehaviorTree.CPP. They tick their children in order until one decides."""

from sar_compiler.runtime.kernel.cells import FAILURE, INVALID, RUNNING, SKIPPED
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, OneChildNode, Ticker, reset, reset_all


class OrderedNode(OneChildNode):
    """Ticks its children in order until one of them returns the opposite of the status `hands_over`.

    Attributes:
        hands_over: The outcome after which the next child is ticked.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part, keeps=part.behaviour.keeps_place)
        self.hands_over: int = part.behaviour.hands_over

    def report_decision(self, ticker: Ticker, index: int, outcome: int) -> None:
        """Write into the feedback message which child has determined the node's outcome."""
        if not ticker.tells:
            return
        how = "failed" if outcome == FAILURE else "succeeded"
        self.behaviour.feedback_message = f"{self.children[index].behaviour.name} {how}"


class ResumingNode(OrderedNode):
    """A sequence or fallback that begins each tick with the child that was running in the previous tick.

    Attributes:
        skips: The cell that stores the number of children that were skipped.
        goes_back: Whether the node begins with the first child after an end or a halt.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.skips = part.cell()
        self.goes_back: bool = not part.behaviour.keeps_place

    def begin(self, ticker: Ticker) -> int:
        """Begin with the current child."""
        cells = ticker.cells
        if cells[self.status_cell] != RUNNING:
            cells[self.skips] = 0
            self.behaviour.feedback_message = ""
        return super().begin(ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Tick the next child after `hands_over` or SKIPPED. End the node after the opposite of `hands_over`."""
        if outcome == RUNNING:
            return RUNNING
        cells = ticker.cells
        if outcome == SKIPPED:
            cells[self.skips] += 1
        elif outcome != self.hands_over:
            return self.decide(ticker, outcome)
        cells[self.position] += 1
        return INVALID

    def decide(self, ticker: Ticker, outcome: int) -> int:
        """End the node with the current child's outcome."""
        cells, index = ticker.cells, ticker.cells[self.position]
        self.report_decision(ticker, index, outcome)
        cells[self.skips] = 0
        if self.goes_back:
            cells[self.position] = index = 0
        reset_all(self.children[index:], ticker)
        return self.set_outcome(ticker, outcome)

    def end(self, ticker: Ticker) -> int:
        """End the node after the last child. No child has determined the outcome."""
        cells = ticker.cells
        all_skipped = cells[self.skips] == len(self.children)
        cells[self.position] = 0
        return self.finish(ticker, SKIPPED if all_skipped else self.hands_over)


class PausingNode(ResumingNode):
    """A `ResumingNode` that returns RUNNING after each child that returns `hands_over` in its first tick.

    The node does not pause after the last child.

    Attributes:
        before: The cell that stores the status of the current child before its tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.before = part.cell()

    def next_child(self, ticker: Ticker) -> int:
        """Return the index of the current child, and store the current status of this child."""
        index = super().next_child(ticker)
        if index >= 0:
            ticker.cells[self.before] = ticker.cells[self.children[index].status_cell]
        return index

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return RUNNING if the child returned `hands_over` in its first tick and is not the last child."""
        cells = ticker.cells
        at_once = cells[self.before] != RUNNING
        cells[self.before] = INVALID
        decision = super().on_child_outcome(ticker, outcome)
        if outcome == self.hands_over and at_once and cells[self.position] < len(self.children):
            self.behaviour.wake()
            return RUNNING
        return decision


class ReactiveNode(OrderedNode):
    """A sequence or fallback that begins with the first child in each tick.

    Attributes:
        so_far: The cell that stores the outcome of the last child that was ticked and not skipped in this tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.so_far = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child."""
        cells = ticker.cells
        if cells[self.status_cell] != RUNNING:
            self.behaviour.feedback_message = ""
        cells[self.position] = 0
        cells[self.so_far] = SKIPPED
        return super().begin(ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """If the child is running, halt the other children. After `hands_over` or SKIPPED, tick the next child."""
        cells, children = ticker.cells, self.children
        index = cells[self.position]
        if outcome == RUNNING:
            reset_all(children[:index], ticker)
            reset_all(children[index + 1 :], ticker)
            self.reset_cells(ticker)
            return RUNNING
        if outcome == SKIPPED:
            reset(children[index], ticker)
        else:
            cells[self.so_far] = outcome
            if outcome != self.hands_over:
                self.report_decision(ticker, index, outcome)
                return self.finish(ticker, outcome)
        cells[self.position] = index + 1
        return INVALID

    def end(self, ticker: Ticker) -> int:
        """End the node with the outcome of the last child that was not skipped."""
        return self.finish(ticker, ticker.cells[self.so_far])
