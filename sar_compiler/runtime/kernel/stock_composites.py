"""The kernel's nodes for py_trees' own composites."""

from typing import Any, Final

from py_trees.common import ParallelPolicy

from sar_compiler.runtime.kernel.cells import CALLED, FAILURE, INVALID, IS_2_3, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, Ticker, TreeNode

_NOWHERE: Final = -2


class StockNode(TreeNode):
    """The base class for composites of py_trees. A child keeps its status until it is restarted or stopped.

    The composite's status depends on the statuses of its children, not on the outcomes of their ticks.

    Attributes:
        pointed: The index of py_trees' current child; `_NOWHERE` if this index is not known.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.pointed = _NOWHERE

    def reset_cells(self, ticker: Ticker) -> None:
        """Reset the cells of the node, and forget the index of its `current_child` in py_trees."""
        super().reset_cells(ticker)
        self.pointed = _NOWHERE

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Return the children that are not idle, in reverse order."""
        self.behaviour.current_child = None
        cells = ticker.cells
        return [child for child in reversed(self.children) if cells[child.status_cell] != INVALID]

    def stop_last(self, ticker: Ticker) -> None:
        """Reset the node's cells and outcome."""
        self.reset_cells(ticker)
        ticker.cells[self.status_cell] = INVALID

    def point_at(self, ticker: Ticker, index: int) -> None:
        """Set the `current_child` of the py_trees behaviour to the child at an index; -1 is the last child."""
        if index != self.pointed and ticker.tells:
            self.pointed = index
            self.behaviour.current_child = self.children[index].behaviour if self.children else None


class StockSequenceNode(StockNode):
    """The node for a Sequence of py_trees, with or without memory.

    Attributes:
        position: The cell that stores the index of the current child.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.memory: bool = part.behaviour.memory
        self.position = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child, or with the running child if the node has memory."""
        cells = ticker.cells
        if cells[self.status_cell] != RUNNING:
            stop_all(self.children, ticker)
            cells[self.position] = 0
            self.pointed = _NOWHERE
        elif not self.memory:
            cells[self.position] = 0
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the current child. The outcome INVALID means that this child must still be ticked."""
        cells, children = ticker.cells, self.children
        index, count = cells[self.position], len(children)
        status = SUCCESS
        while index < count:
            cells[self.position] = index
            child = children[index]
            if outcome == INVALID and child.tick(ticker) == CALLED:
                return CALLED
            outcome, status = INVALID, cells[child.status_cell]
            if status != SUCCESS:
                break
            index += 1
        return self.end_tick(ticker, status)

    def end_tick(self, ticker: Ticker, status: int) -> int:
        """End the tick with a status."""
        cells, index = ticker.cells, ticker.cells[self.position]
        self.point_at(ticker, index)
        if status != SUCCESS and not self.memory:
            stop_all(self.children[index + 1 :], ticker)
        if status == INVALID and not IS_2_3:
            self.stop(ticker)
            return SKIPPED
        if status != RUNNING or not self.memory:
            cells[self.position] = 0
        cells[self.status_cell] = status
        return SKIPPED if status == INVALID else status

    def break_off(self, ticker: Ticker) -> None:
        """Set the `current_child` of the py_trees behaviour after an exception has aborted the tick."""
        self.point_at(ticker, ticker.cells[self.position])


class StockSelectorNode(StockNode):
    """The node for a Selector of py_trees, with or without memory.

    Attributes:
        position: The cell that stores the index of the running child.
        current: The cell that stores the index of the current child; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.memory: bool = part.behaviour.memory
        self.position, self.current = part.cell(), part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Begin with the first child, or with the running child if the node has memory."""
        cells = ticker.cells
        if cells[self.status_cell] != RUNNING:
            self.pointed = _NOWHERE
            self.point_at(ticker, 0)
        previous = cells[self.position]
        if self.memory:
            for child in self.children[:previous]:
                if IS_2_3 or cells[child.status_cell] != INVALID:
                    child.stop(ticker)
        cells[self.current] = previous if self.memory else 0
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the current child. The outcome INVALID means that this child must still be ticked."""
        cells, children = ticker.cells, self.children
        index, count = cells[self.current], len(children)
        while index < count:
            child = children[index]
            cells[self.current] = index
            if outcome == INVALID and child.tick(ticker) == CALLED:
                return CALLED
            outcome, status = INVALID, cells[child.status_cell]
            if status not in (INVALID, FAILURE):
                return self.decide(ticker, status)
            index += 1
        self.point_at(ticker, -1)
        self.reset_cells(ticker)
        cells[self.status_cell] = FAILURE
        return FAILURE

    def decide(self, ticker: Ticker, status: int) -> int:
        """End the tick with the status of the current child."""
        cells, index = ticker.cells, ticker.cells[self.current]
        self.point_at(ticker, index)
        if index != cells[self.position]:
            stop_all(self.children[index + 1 :], ticker)
        cells[self.position] = index if status == RUNNING else 0
        cells[self.current] = 0
        cells[self.status_cell] = status
        return status


class StockParallelNode(StockNode):
    """The node for a Parallel of py_trees, with any policy.

    Attributes:
        current: The cell that stores the index of the current child; used only during a tick.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        behaviour = part.behaviour
        behaviour.validate_policy_configuration()
        policy = behaviour.policy
        self.synchronise: bool = policy.synchronise
        if self.synchronise:
            # A child that has succeeded is not ticked again.
            for child in part.children:
                child.heeds_end = True
        self.one_is_enough: bool = isinstance(policy, ParallelPolicy.SuccessOnOne)
        self.needed: list[TreeNode] = part.children
        if isinstance(policy, ParallelPolicy.SuccessOnSelected):
            of_behaviour: dict[Any, TreeNode] = {child.behaviour.id: child for child in part.children}
            self.needed = [of_behaviour[chosen.id] for chosen in policy.children]
        self.current = part.cell()

    def begin(self, ticker: Ticker) -> int:
        """Begin the tick with the first child."""
        cells = ticker.cells
        if cells[self.status_cell] != RUNNING:
            stop_all(self.children, ticker)
            self.pointed, self.behaviour.current_child = _NOWHERE, None
        if self.synchronise:
            # A child that has succeeded is skipped, unless other code has stopped it.
            for child in self.children:
                ticker.reach(child)
        cells[self.current] = 0
        return self.tick_unfinished(ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:  # noqa: ARG002 - the status is used
        """Continue the tick after the current child was ticked."""
        ticker.cells[self.current] += 1
        return self.tick_unfinished(ticker)

    def tick_unfinished(self, ticker: Ticker) -> int:
        """Tick the current child and all later children, and then set the node's status."""
        cells = ticker.cells
        index = cells[self.current]
        for child in self.children[index:]:
            cells[self.current] = index
            succeeded = self.synchronise and cells[child.status_cell] == SUCCESS
            if not succeeded and child.tick(ticker) == CALLED:
                return CALLED
            index += 1
        cells[self.current] = 0
        status = self.decide(ticker)
        if status != RUNNING:
            for child in self.children:
                if cells[child.status_cell] == RUNNING:
                    child.stop(ticker)
        cells[self.status_cell] = status
        return status

    def decide(self, ticker: Ticker) -> int:
        """After all children were ticked, return the node's status, and make the decisive child the current one."""
        cells, children = ticker.cells, self.children
        for index, child in enumerate(children):
            if cells[child.status_cell] == FAILURE:
                self.point_at(ticker, index)
                return FAILURE
        if self.one_is_enough:
            for index in range(len(children) - 1, -1, -1):
                if cells[children[index].status_cell] == SUCCESS:
                    self.point_at(ticker, index)
                    return SUCCESS
            self.point_at(ticker, -1)
            return RUNNING if children else SUCCESS
        for child in self.needed:
            if cells[child.status_cell] != SUCCESS:
                self.point_at(ticker, -1)
                return RUNNING
        self.pointed = _NOWHERE
        self.behaviour.current_child = self.needed[-1].behaviour if children else None
        return SUCCESS

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Return the children to stop, in reverse order. The running children are last, so they are stopped first."""
        cells = ticker.cells
        children = super().stop_first(ticker)
        ended = [child for child in children if cells[child.status_cell] != RUNNING]
        return ended + [child for child in children if cells[child.status_cell] == RUNNING]


def stop_all(children: list[TreeNode], ticker: Ticker) -> None:
    """Stop the children that are not idle."""
    cells = ticker.cells
    for child in children:
        if cells[child.status_cell] != INVALID:
            child.stop(ticker)
