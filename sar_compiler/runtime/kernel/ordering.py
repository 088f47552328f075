"""Sequences and fallbacks of BehaviorTree.CPP: children in order, until one of them decides."""

from sar_compiler.runtime.kernel.cells import CALLED, FAILURE, INVALID, RUNNING, SKIPPED
from sar_compiler.runtime.kernel.tree_nodes import ControlNode, Part, Ticker, reset, reset_all


class OrderedNode(ControlNode):
    """Ticks children in order: one with the outcome that hands over is followed by the next, the other end decides.

    Attributes:
        hands_over: The outcome after which the next child is ticked.
        position: The cell with the index of the child in hand.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.hands_over: int = part.behaviour.hands_over
        self.position = part.cell()

    def break_off(self, ticker: Ticker) -> None:
        """Make the child in hand the current one."""
        self.point_at(ticker.cells[self.position])

    def tell(self, ticker: Ticker, index: int, outcome: int) -> None:
        """Report which child has decided, as the feedback message."""
        if not ticker.tells:
            return
        how = "failed" if outcome == FAILURE else "succeeded"
        self.behaviour.feedback_message = f"{self.children[index].behaviour.name} {how}"


class ResumingNode(OrderedNode):
    """One that resumes with the child that was running.

    Attributes:
        skips: The cell with the number of children that were skipped.
        goes_back: Whether it begins with the first child after an end or a halt.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.skips = part.cell()
        self.goes_back = True

    def begin(self, ticker: Ticker) -> int:
        """Begin with the child in hand."""
        cells = ticker.cells
        if cells[self.at] != RUNNING:
            cells[self.skips] = 0
            self.behaviour.feedback_message = ""
        cells[self.at] = RUNNING
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Tick the children from the one in hand on, whose outcome may be known; INVALID if it is to be ticked."""
        outcome = self.advance(ticker, outcome)
        if outcome == INVALID:
            if self.children:
                self.point_at(len(self.children) - 1)
            return self.finish(ticker)
        if outcome in (RUNNING, CALLED):
            return outcome
        return self.decide(ticker, outcome)

    def advance(self, ticker: Ticker, outcome: int) -> int:
        """Tick children until one does not hand over; return its outcome, INVALID if all children have."""
        cells, children, hands_over = ticker.cells, self.children, self.hands_over
        index, count = cells[self.position], len(children)
        while True:
            if outcome == INVALID:
                if index == count:
                    return INVALID
                outcome = children[index].tick(ticker)
            if outcome == SKIPPED:
                cells[self.skips] += 1
            elif outcome != hands_over:
                self.point_at(index)
                return outcome
            index += 1
            cells[self.position] = index
            outcome = INVALID

    def decide(self, ticker: Ticker, outcome: int) -> int:
        """End because of the child in hand."""
        cells, index = ticker.cells, ticker.cells[self.position]
        self.tell(ticker, index, outcome)
        cells[self.skips] = 0
        if self.goes_back:
            cells[self.position] = index = 0
        reset_all(self.children[index:], ticker)
        cells[self.at] = outcome
        return outcome

    def finish(self, ticker: Ticker) -> int:
        """End because no child has decided."""
        cells = ticker.cells
        all_skipped = cells[self.skips] == len(self.children)
        cells[self.position] = cells[self.skips] = 0
        reset_all(self.children, ticker)
        if all_skipped:
            return SKIPPED
        cells[self.at] = self.hands_over
        return self.hands_over

    def forget(self, ticker: Ticker) -> None:
        """Forget which child was in hand."""
        ticker.cells[self.skips] = 0
        if self.goes_back:
            ticker.cells[self.position] = 0


class PausingNode(ResumingNode):
    """One that also pauses after each child that hands over in its first tick, unless that is the last child.

    Attributes:
        before: The cell with the status of the child in hand before it was ticked.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.before = part.cell()
        self.goes_back = not part.behaviour.keeps_place

    def advance(self, ticker: Ticker, outcome: int) -> int:
        """Tick children until one does not hand over, or a pause comes."""
        cells = ticker.cells
        while True:
            index = cells[self.position]
            if outcome == INVALID:
                if index == len(self.children):
                    return INVALID
                child = self.children[index]
                self.behaviour.current_child = child.behaviour
                cells[self.before] = cells[child.at]
                outcome = child.tick(ticker)
                if outcome == CALLED:
                    return CALLED
            at_once = cells[self.before] != RUNNING
            cells[self.before] = INVALID
            if outcome not in (SKIPPED, self.hands_over):
                return outcome
            cells[self.position] = index + 1
            if outcome == SKIPPED:
                cells[self.skips] += 1
            elif at_once and index + 1 < len(self.children):
                self.behaviour.wake()
                return RUNNING
            outcome = INVALID


class ReactiveNode(OrderedNode):
    """One that ticks every child again in each tick.

    Attributes:
        end: The cell with the outcome so far, of this tick.
    """

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.end = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child."""
        cells = ticker.cells
        if cells[self.at] != RUNNING:
            self.behaviour.feedback_message = ""
        cells[self.at] = RUNNING
        cells[self.position] = 0
        cells[self.end] = SKIPPED
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Tick the children from the one in hand on, whose outcome may be known; INVALID if it is to be ticked."""
        cells, children = ticker.cells, self.children
        index, count = cells[self.position], len(children)
        while True:
            if outcome == INVALID:
                if index == count:
                    return self.finish(ticker, cells[self.end])
                child = children[index]
                self.behaviour.current_child = child.behaviour
                cells[self.position] = index
                outcome = child.tick(ticker)
            if outcome == CALLED:
                return CALLED
            if outcome == RUNNING:
                reset_all(children[:index], ticker)
                reset_all(children[index + 1 :], ticker)
                self.forget(ticker)
                return RUNNING
            if outcome == SKIPPED:
                reset(children[index], ticker)
            else:
                cells[self.end] = outcome
                if outcome != self.hands_over:
                    self.tell(ticker, index, outcome)
                    return self.finish(ticker, outcome)
            index += 1
            outcome = INVALID

    def finish(self, ticker: Ticker, outcome: int) -> int:
        """End, with an outcome."""
        self.forget(ticker)
        reset_all(self.children, ticker)
        return self.pass_on(ticker, outcome)

    def forget(self, ticker: Ticker) -> None:
        """Forget what belongs to a single tick."""
        ticker.cells[self.position] = ticker.cells[self.end] = 0
