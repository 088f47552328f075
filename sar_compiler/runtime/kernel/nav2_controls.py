"""The controls of Nav2, such as RecoveryNode, PipelineSequence and RoundRobin."""

from typing import Final

from sar_compiler.errors import NodeError
from sar_compiler.runtime.kernel.cells import CALLED, FAILURE, INVALID, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.tree_nodes import (
    ControlNode,
    NodeBuilder,
    OneChildNode,
    Ticker,
    reset,
    reset_all,
)

_USUAL_RETRIES: Final = 1
"""The allowed number of recoveries if the value of the port `number_of_retries` is negative."""


class Nav2ControlError(NodeError):
    """Raised if a Nav2 control cannot handle the outcome of a child or the value of a port."""


class RecoveringNode(ControlNode):
    """Ticks the first child. If it fails, ticks the second child as a recovery, and then the first child again.

    Attributes:
        current: The cell that stores the index of the current child.
        retries: The cell that stores the number of recoveries. The number is not reset when a recovery is skipped.
        wanted: The cell that stores the allowed number of recoveries; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.current, self.retries, self.wanted = part.cell(), part.cell(), part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Read the allowed number of recoveries, and continue with the current child."""
        cells = ticker.cells
        number: int = self.behaviour.number_of_retries.get()
        cells[self.wanted] = number if number >= 0 else _USUAL_RETRIES
        cells[self.status_cell] = RUNNING
        if cells[self.retries] > cells[self.wanted]:
            return self.end_with(ticker, FAILURE)
        return self.tick_child(self.children[cells[self.current]], ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue the tick after the current child was ticked."""
        if outcome == RUNNING:
            ticker.cells[self.wanted] = 0
            return RUNNING
        after = self.after_main if ticker.cells[self.current] == 0 else self.on_recovery_outcome
        return after(ticker, outcome)

    def after_main(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the first child has ended or was skipped."""
        cells = ticker.cells
        if outcome != FAILURE or cells[self.retries] == cells[self.wanted]:
            return self.end_with(ticker, outcome)
        reset(self.children[0], ticker)
        cells[self.current] = 1
        return self.tick_child(self.children[1], ticker)

    def on_recovery_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the second child has ended or was skipped."""
        cells = ticker.cells
        if outcome == FAILURE:
            return self.end_with(ticker, FAILURE)
        reset(self.children[1], ticker)
        cells[self.current] = 0
        if outcome == SKIPPED:
            cells[self.wanted] = 0
            return self.set_outcome(ticker, FAILURE)
        cells[self.retries] += 1
        if ticker.tells:
            self.behaviour.feedback_message = f"recovery {cells[self.retries]} of {cells[self.wanted]}"
        return self.tick_child(self.children[0], ticker)

    def end_with(self, ticker: Ticker, outcome: int) -> int:
        """End the node with an outcome, which may be SKIPPED, and reset all cells."""
        ticker.cells[self.status_cell] = INVALID
        return self.finish(ticker, outcome)


class PipelineNode(OneChildNode):
    """In each tick, ticks the children from the first one to the furthest one that has been reached so far.

    Attributes:
        furthest: The cell that stores the index of the furthest child that has run.
        skips: The cell that stores the number of children that were skipped; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part, of_tick=True)
        self.furthest, self.skips = part.cell(), part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child."""
        self.break_off(ticker)
        return self.resume(ticker, INVALID)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """If the child fails, fail. If the furthest child is running, return RUNNING. Else go to the next child."""
        cells, index = ticker.cells, ticker.cells[self.position]
        if outcome == FAILURE:
            return self.finish(ticker, FAILURE)
        if outcome == RUNNING and index >= cells[self.furthest]:
            self.break_off(ticker)
            cells[self.furthest] = index
            return self.set_outcome(ticker, RUNNING)
        cells[self.skips] += int(outcome == SKIPPED)
        cells[self.position] = index + 1
        return INVALID

    def end(self, ticker: Ticker) -> int:
        """Halt running children. Return SUCCESS, or SKIPPED if all children were skipped."""
        all_skipped = ticker.cells[self.skips] == len(self.children)
        return self.finish(ticker, SKIPPED if all_skipped else SUCCESS)


class RoundRobinNode(OneChildNode):
    """Ticks its children in turn until one succeeds. The next start begins with the child after the successful one.

    If `wrap_around` is false, the node ends without success after the last child.

    Attributes:
        failures: The cell that stores the number of children that have failed.
        skips: The cell that stores the number of children that were skipped; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.failures, self.skips = part.cell(), part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Continue with the current child."""
        ticker.cells[self.skips] = 0
        return super().begin(ticker)

    def next_child(self, ticker: Ticker) -> int:
        """Return the index of the current child, or -1 if all children have failed or were skipped."""
        cells = ticker.cells
        is_over = cells[self.failures] + cells[self.skips] >= len(self.children)
        return -1 if is_over else cells[self.position]

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return SUCCESS or RUNNING if the current child returned it. Otherwise tick the next child, if any."""
        cells = ticker.cells
        if outcome == RUNNING:
            cells[self.skips] = 0
            return RUNNING
        is_last = cells[self.position] + 1 == len(self.children)
        cells[self.failures] += int(outcome == FAILURE)
        cells[self.skips] += int(outcome == SKIPPED)
        if is_last and not self.behaviour.wrap_around.get():
            return self.end(ticker)
        position = 0 if is_last else cells[self.position] + 1
        if outcome == SUCCESS:
            self.finish(ticker, SUCCESS)
        cells[self.position] = position
        return SUCCESS if outcome == SUCCESS else INVALID

    def end(self, ticker: Ticker) -> int:
        """Return FAILURE, or SKIPPED if all children were skipped."""
        all_skipped = ticker.cells[self.skips] == len(self.children)
        ticker.cells[self.status_cell] = INVALID
        return self.finish(ticker, SKIPPED if all_skipped else FAILURE)


class NonblockingNode(OneChildNode):
    """Ticks all children in every tick, including successful ones, until one fails or no child is running.

    Attributes:
        runs: The cell that contains 1 if a child runs; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part, of_tick=True)
        self.runs = part.cell(of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child."""
        self.reset_cells(ticker)
        return self.resume(ticker, INVALID)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return FAILURE if the current child has failed. Otherwise continue with the next child.

        Raises:
            Nav2ControlError: If the child was skipped.
        """
        cells, index = ticker.cells, ticker.cells[self.position]
        if outcome == FAILURE:
            return self.finish(ticker, FAILURE)
        if outcome == SKIPPED:
            name = self.children[index].behaviour.name
            message = f"'{name}' was skipped, but '{self.behaviour.name}' does not accept skipped children"
            raise Nav2ControlError(message, self.behaviour.name)
        cells[self.runs] |= int(outcome == RUNNING)
        cells[self.position] = index + 1
        return INVALID

    def end(self, ticker: Ticker) -> int:
        """Return RUNNING if a child is running, and otherwise SUCCESS."""
        if not ticker.cells[self.runs]:
            return self.finish(ticker, SUCCESS)
        self.reset_cells(ticker)
        return self.set_outcome(ticker, RUNNING)


class PersistentNode(OneChildNode):
    """A sequence that stores the index of its current child on the blackboard. A halt does not reset the index."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part, of_tick=True)

    def begin(self, ticker: Ticker) -> int:
        """Read the index, and continue with the child at this index.

        Raises:
            Nav2ControlError: If the index is negative.
        """
        place: int = self.behaviour.current_child_idx.get()
        if place < 0:
            message = f"'{self.behaviour.name}' cannot begin with child {place}. The index of a child must be at least 0"
            raise Nav2ControlError(message, self.behaviour.name)
        ticker.cells[self.position] = place
        return super().begin(ticker)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return FAILURE or RUNNING if the current child returned it. Otherwise tick the next child."""
        cells = ticker.cells
        if outcome == RUNNING:
            cells[self.position] = 0
            return RUNNING
        if outcome == FAILURE:
            return self.start_over(ticker, FAILURE)
        cells[self.position] += 1
        self.behaviour.current_child_idx.set(cells[self.position])
        return INVALID

    def end(self, ticker: Ticker) -> int:
        """Return SUCCESS after the last child."""
        return self.start_over(ticker, SUCCESS)

    def start_over(self, ticker: Ticker, outcome: int) -> int:
        """End the node with an outcome, and make the next start begin with the first child."""
        self.finish(ticker, outcome)
        self.behaviour.current_child_idx.set(0)
        return outcome


_RESUMED: Final = 0
_PAUSED: Final = 1
_ON_PAUSE: Final = 2
_ON_RESUME: Final = 3
_NEXT: Final = (_RESUMED, _PAUSED, _PAUSED, _RESUMED)


class PauseResumeNode(ControlNode):
    """Ticks the child for the current mode. The modes are resumed, paused, pausing and resuming.

    The node's first child is a leaf whose status is the request: FAILURE to pause, RUNNING to resume. A request to pause is accepted unless
    the node is paused, and a request to resume is accepted only if the node is paused. SKIPPED requests both, and the node always pauses.

    Attributes:
        asking: The cell that contains 1 while the leaf with the request is ticked.
        mode: The cell that stores the current mode, which is also the index of the mode's child.
    """

    asks_whether_it_starts = True

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.asked, self.branches = part.children[0], part.children[1:]
        self.asking, self.mode = part.cell(of_tick=True), part.cell(_RESUMED)

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf that returns the request to pause or resume."""
        cells = ticker.cells
        if self.starts(ticker):
            cells[self.mode] = _RESUMED
        cells[self.status_cell] = RUNNING
        cells[self.asking] = 1
        outcome = self.asked.tick(ticker)
        return CALLED if outcome == CALLED else self.resume(ticker, outcome)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the request leaf or the child of the current mode was ticked."""
        cells = ticker.cells
        if cells[self.asking]:
            cells[self.asking] = 0
            self.asked.reset_outcome(ticker)
            return self.on_query_outcome(ticker, outcome)
        if outcome == RUNNING:
            return RUNNING
        if outcome == FAILURE or cells[self.mode] == _RESUMED:
            return self.set_outcome(ticker, FAILURE if outcome == FAILURE else SUCCESS)
        return self.next_mode(ticker)

    def on_query_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Change the mode if the request leaf's outcome requests this, and tick the child of the resulting mode."""
        cells = ticker.cells
        is_paused = cells[self.mode] == _PAUSED
        pauses = (outcome == SKIPPED) if is_paused else (outcome in (FAILURE, SKIPPED))
        if pauses or (is_paused and outcome == RUNNING):
            reset_all(self.branches, ticker)
            cells[self.mode] = _ON_PAUSE if pauses else _ON_RESUME
        if cells[self.mode] >= len(self.branches):
            return self.next_mode(ticker)
        return self.tick_child(self.branches[cells[self.mode]], ticker)

    def next_mode(self, ticker: Ticker) -> int:
        """Switch to the mode that follows the current mode, and return RUNNING."""
        ticker.cells[self.mode] = _NEXT[ticker.cells[self.mode]]
        return RUNNING
