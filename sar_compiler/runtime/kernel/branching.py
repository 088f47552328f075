"""The branching controls of BehaviorTree.CPP: the status of a child, or a value, selects the child to tick."""

from typing import Any, Final

from sar_compiler.runtime.kernel.cells import FAILURE, INVALID, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.tree_nodes import (
    ControlNode,
    NodeBuilder,
    OneChildNode,
    Ticker,
    TreeNode,
    reset,
    reset_all,
    running_children,
)
from sar_compiler.runtime.operators import equal_texts

_NONE: Final = 0


class IfThenElseNode(ControlNode):
    """Ticks the condition until it ends, and then ticks one of the branches.

    Attributes:
        chosen: The cell that stores the index of the branch, or 0 while the condition has not ended.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.chosen = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the condition, or continue with the branch."""
        ticker.cells[self.status_cell] = RUNNING
        return self.tick_child(self.children[ticker.cells[self.chosen]], ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the condition or the branch was ticked."""
        cells = ticker.cells
        if cells[self.chosen] == _NONE and outcome in (SUCCESS, FAILURE):
            cells[self.chosen] = 1 if outcome == SUCCESS else 2
            self.behaviour.feedback_message = "then" if outcome == SUCCESS else "else"
            if cells[self.chosen] < len(self.children):
                return self.tick_child(self.children[cells[self.chosen]], ticker)
            cells[self.chosen] = _NONE
            return self.set_outcome(ticker, FAILURE)
        return RUNNING if outcome == RUNNING else self.finish(ticker, outcome)


class WhileDoElseNode(ControlNode):
    """In each tick, ticks the condition first, and then one of the branches.

    Attributes:
        branch: The cell that stores the index of the current branch, or 0 for the condition.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.branch = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the condition."""
        ticker.cells[self.status_cell] = RUNNING
        ticker.cells[self.branch] = _NONE
        return self.tick_child(self.children[_NONE], ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue the tick after the condition or a branch was ticked."""
        cells, count = ticker.cells, len(self.children)
        if cells[self.branch] == _NONE and outcome in (SUCCESS, FAILURE):
            branch = 1 if outcome == SUCCESS else 2
            other = 3 - branch
            self.behaviour.feedback_message = "do" if outcome == SUCCESS else "else"
            if branch < count:
                if other < count:
                    reset(self.children[other], ticker)
                cells[self.branch] = branch
                return self.tick_child(self.children[branch], ticker)
        cells[self.branch] = _NONE
        return RUNNING if outcome == RUNNING else self.finish(ticker, outcome)


class SwitchNode(ControlNode):
    """Ticks the child whose case equals the value of a variable, or the last child if there is no such case.

    Attributes:
        cases: The ports with the cases.
        running: The cell that stores the number of the running or current child, counted from 1; 0 if there is no such child.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        behaviour = part.behaviour
        self.variable: Any = behaviour.variable
        self.numbers: Any = behaviour.enums.numbers
        self.cases: list[Any] = [
            getattr(behaviour, f"case_{number}") for number in range(1, len(part.children))
        ]
        self.running = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Tick the selected child. If another child was running, halt that child first."""
        cells = ticker.cells
        selected = self.select()
        before = cells[self.running]
        if before not in (_NONE, selected + 1):
            reset(self.children[before - 1], ticker)
        cells[self.running] = selected + 1
        return self.tick_child(self.children[selected], ticker)

    def select(self) -> int:
        """Return the index of the child to tick. A variable or case without a value never matches."""
        variable = self.variable.get(None)
        if variable is not None:
            for index, case in enumerate(self.cases):
                text = case.get(None)
                if text is not None and equal_texts(variable, text, self.numbers):
                    self.behaviour.feedback_message = f"case {index + 1}"
                    return index
        self.behaviour.feedback_message = "no case"
        return len(self.cases)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Return the outcome of the child."""
        cells = ticker.cells
        if outcome != RUNNING:
            cells[self.running] = _NONE
            if outcome == SKIPPED:
                return SKIPPED
            reset_all(self.children, ticker)
        return self.set_outcome(ticker, outcome)


class TryCatchNode(OneChildNode):
    """Ticks all children except the last one in order. If one of these children fails, ticks the last child.

    Attributes:
        skips: The cell that stores the number of children that were skipped.
        catching: The cell that contains 1 while the last child is the current child.
        catches: Whether the last child is ticked once when the node is halted.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.last = len(self.children) - 1
        self.catches = False
        self.skips, self.catching = part.cell(), part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Continue with the current child."""
        if ticker.cells[self.status_cell] != RUNNING:
            self.reset_cells(ticker)
            self.behaviour.feedback_message = ""
        return super().begin(ticker)

    def next_child(self, ticker: Ticker) -> int:
        """Return the index of the current child, or -1 if no child has failed and only the last one remains."""
        if ticker.cells[self.catching]:
            return self.last
        index = super().next_child(ticker)
        return index if index < self.last else -1

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """After a failure, continue with the last child. Otherwise continue with the next child."""
        cells = ticker.cells
        if outcome == RUNNING:
            return RUNNING
        if cells[self.catching]:
            return self.finish(ticker, FAILURE)
        if outcome == FAILURE:
            failed = self.children[cells[self.position]].behaviour
            self.behaviour.feedback_message = f"{failed.name} failed"
            cells[self.catching] = 1
            reset_all(self.children, ticker)
        else:
            cells[self.position] += 1
            cells[self.skips] += int(outcome == SKIPPED)
        return INVALID

    def end(self, ticker: Ticker) -> int:
        """End the node, because no child has failed."""
        all_skipped = ticker.cells[self.skips] == self.last
        return self.finish(ticker, SKIPPED if all_skipped else SUCCESS)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Return the running children. Leave out the last child if the halt must tick it once."""
        cells = ticker.cells
        self.catches = False
        try:
            if cells[self.status_cell] == RUNNING and not cells[self.catching]:
                self.catches = bool(self.behaviour.catch_on_halt.get())
        except BaseException:
            reset_all(self.children, ticker)
            raise
        finally:
            if not self.catches:
                self.reset_child(ticker)
        return running_children(self.children[: self.last] if self.catches else self.children, ticker)

    def stop_last(self, ticker: Ticker) -> None:
        """If `catch_on_halt` is set and the last child was not the current child, tick the last child once."""
        if self.catches:
            try:
                ticker.run_unseen(self.children[self.last])
            finally:
                self.reset_child(ticker)
                reset_all(self.children, ticker)
        super().stop_last(ticker)

    def reset_child(self, ticker: Ticker) -> None:
        """Reset the node's cells, and clear the `current_child` of the py_trees behaviour."""
        self.reset_cells(ticker)
        self.behaviour.current_child = None
