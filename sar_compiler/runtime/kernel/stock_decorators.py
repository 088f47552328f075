"""The kernel's nodes for py_trees' own decorators, whose `update` methods convert the child's status.

Between two ticks, cells store the state of the decorator. Each tick copies the state to the decorator's attributes and back.
"""

from collections.abc import Iterable
from typing import Any, Final

from py_trees import decorators
from py_trees.common import Status

from sar_compiler.runtime.frozen import freeze, thaw
from sar_compiler.runtime.kernel.cells import (
    CALLED,
    FAILURE,
    INVALID,
    RUNNING,
    SKIPPED,
    STATUSES,
    SUCCESS,
    number_of,
)
from sar_compiler.runtime.kernel.leaf_nodes import is_own
from sar_compiler.runtime.kernel.timing import Countdown
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, Ticker, TreeNode

_FAILURE: Final[Any] = Status.FAILURE

TURNING: tuple[type, ...] = (
    decorators.Condition,
    decorators.Inverter,
    decorators.PassThrough,
    decorators.FailureIsRunning,
    decorators.FailureIsSuccess,
    decorators.RunningIsFailure,
    decorators.RunningIsSuccess,
    decorators.SuccessIsFailure,
    decorators.SuccessIsRunning,
)
"""The decorators of py_trees that only convert the status of their child."""


class StockDecoratorNode(TreeNode):
    """The node for a decorator of py_trees.

    Attributes:
        turns: Whether the decorator only converts the status of the child.
        turned: The result of the conversion for each status of the child; CALLED if the result is not known yet.
        heard_status: The child's status at the last call of `update`; CALLED before the first call.
        heard_message: The child's feedback message at the last call of `update`.
        made: The status that the last call of `update` returned.
        message: The decorator's feedback message after the last call of `update`.
        terminates: Whether the decorator overrides `terminate`.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.child = part.children[0]
        self.turns: bool = type(part.behaviour) in TURNING
        self.turned = [CALLED] * len(STATUSES)
        self.heard_status, self.made = CALLED, INVALID
        self.heard_message: Any = None
        self.message: Any = None
        self.terminates: bool = is_own(part.behaviour, "terminate")

    def begin(self, ticker: Ticker) -> int:
        """Tick the child. If the node is not running, start the node first."""
        if ticker.cells[self.status_cell] != RUNNING:
            self.start(ticker)
        outcome = self.child.tick(ticker)
        return CALLED if outcome == CALLED else self.resume(ticker, outcome)

    def resume(self, ticker: Ticker, outcome: int) -> int:  # noqa: ARG002 - the status is used
        """Convert the child's status."""
        cells, child = ticker.cells, self.child
        status = self.update(ticker)
        if status != RUNNING:
            self.terminate(ticker, status)
            if status == INVALID:
                child.stop(ticker)
            if cells[child.status_cell] == RUNNING:
                child.stop(ticker)
        cells[self.status_cell] = status
        return SKIPPED if status == INVALID else status

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Terminate the node, and return its child."""
        self.terminate(ticker, INVALID)
        return [self.child]

    def stop_last(self, ticker: Ticker) -> None:
        """Reset the node's outcome."""
        ticker.cells[self.status_cell] = INVALID

    def start(self, ticker: Ticker) -> None:
        """Initialise the node in place of the `initialise` method of the py_trees class. By default, do nothing."""

    def update(self, ticker: Ticker) -> int:
        """Return the status that the `update` method of the py_trees class returns for the child's status."""
        status = ticker.cells[self.child.status_cell]
        if not self.turns:
            return self.call_update(ticker, status)
        if ticker.tells:
            return self.update_message(ticker, status)
        if self.turned[status] == CALLED:
            self.turned[status] = self.call_update(ticker, status)
        return self.turned[status]

    def update_message(self, ticker: Ticker, status: int) -> int:
        """Convert the child's status and message. Call `update` only if the status or message is new."""
        behaviour, heard = self.behaviour, self.child.behaviour.feedback_message
        is_known = status == self.heard_status and heard is self.heard_message
        if not is_known or behaviour.feedback_message is not self.message:
            self.made = self.call_update(ticker, status)
            self.heard_status, self.heard_message = status, heard
            self.message = behaviour.feedback_message
        return self.made

    def call_update(self, ticker: Ticker, status: int) -> int:
        """Call the `update` method of the py_trees class, and return the resulting status as a number."""
        self.child.behaviour.status = STATUSES[status]
        return ticker.number_of(self.behaviour, self.behaviour.update())

    def terminate(self, ticker: Ticker, status: int) -> None:  # noqa: ARG002
        """Terminate the node in place of the `terminate` method of the py_trees class."""
        if self.terminates:
            self.behaviour.terminate(STATUSES[status])


class StockCountingNode(StockDecoratorNode):
    """The node for a decorator of py_trees that counts outcomes of its child.

    Attributes:
        count: The cell that stores the count. A node without a limit does not use this cell.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.count = part.cell()
        self.known: dict[int, int] = {}

    def attribute(self) -> str:
        """Return the name of the behaviour's attribute that stores the count; empty if no count is needed."""
        raise NotImplementedError

    def start(self, ticker: Ticker) -> None:
        """Start with a count of 0."""
        self.behaviour.initialise()
        ticker.cells[self.count] = 0

    def update(self, ticker: Ticker) -> int:
        """Count the child's outcome, and return the node's status."""
        attribute = self.attribute()
        if not attribute:
            return super().update(ticker)
        cells = ticker.cells
        if ticker.tells:
            return self.count_on(ticker, attribute)
        place = int(cells[self.count]) * len(STATUSES) + int(cells[self.child.status_cell])
        known = self.known.get(place, -1)
        if known < 0:
            status = self.count_on(ticker, attribute)
            known = self.known[place] = int(cells[self.count]) * len(STATUSES) + status
        cells[self.count] = known // len(STATUSES)
        return known % len(STATUSES)

    def count_on(self, ticker: Ticker, attribute: str) -> int:
        """Call the behaviour's `update`, which counts the child's outcome, and return the node's status."""
        setattr(self.behaviour, attribute, ticker.cells[self.count])
        status = super().update(ticker)
        ticker.cells[self.count] = getattr(self.behaviour, attribute)
        return status

    def terminate(self, ticker: Ticker, status: int) -> None:  # noqa: ARG002
        """Reset the count."""
        self.reset_cells(ticker)


class StockRepeatNode(StockCountingNode):
    """The node for a Repeat of py_trees."""

    def attribute(self) -> str:
        """Return the name of the attribute that stores the count; empty if repetitions are unlimited."""
        return "success" if self.behaviour.num_success > 0 else ""


class StockRetryNode(StockCountingNode):
    """The node for a Retry of py_trees."""

    def attribute(self) -> str:
        """Return the name of the attribute that stores the count."""
        return "failures"


class StockGuardNode(StockDecoratorNode):
    """The node for an EternalGuard of py_trees."""

    def begin(self, ticker: Ticker) -> int:
        """Tick the child if the condition is true."""
        if self.holds():
            return super().begin(ticker)
        if ticker.cells[self.child.status_cell] == RUNNING:
            self.child.stop(ticker)
        ticker.cells[self.status_cell] = FAILURE
        return FAILURE

    def holds(self) -> bool:
        """Return whether the condition is true."""
        result = self.behaviour.condition()
        if isinstance(result, Status):
            return result is not _FAILURE
        if not isinstance(result, bool):
            message = f"'{self.behaviour.name}': the condition must return a bool or a status, not {result!r}"
            raise RuntimeError(message)  # noqa: TRY004 - py_trees raises this type
        return result


class StockOneShotNode(StockDecoratorNode):
    """The node for a OneShot of py_trees.

    Attributes:
        final: The cell that stores the final status of the child. The status is never reset.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        behaviour = part.behaviour
        self.final = part.cell(number_of(behaviour.final_status), keeps=True)
        self.counts: list[int] = [number_of(status) for status in behaviour.policy.value]

    def begin(self, ticker: Ticker) -> int:
        """Tick the child, or return its final status if it has one."""
        final = ticker.cells[self.final]
        if final == INVALID:
            return super().begin(ticker)
        if ticker.cells[self.child.status_cell] == RUNNING:
            self.child.stop(ticker)
        ticker.cells[self.status_cell] = final
        return final

    def update(self, ticker: Ticker) -> int:
        """Return the child's status. Only called while the child has no final status."""
        return super().update(ticker) if ticker.tells else ticker.cells[self.child.status_cell]

    def terminate(self, ticker: Ticker, status: int) -> None:
        """Store the final status."""
        if ticker.cells[self.final] == INVALID and status in self.counts:
            self.behaviour.feedback_message = "oneshot completed"
            ticker.cells[self.final] = status
            if ticker.is_live:
                self.behaviour.final_status = STATUSES[status]


class StockForEachNode(StockDecoratorNode):
    """The node for a ForEach of py_trees. It copies the items of the list when it starts.

    Attributes:
        waiting: The cell that stores the remaining items.
        has_item: The cell that contains 1 while there is a current item.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.waiting, self.has_item = part.value(()), part.cell()

    def start(self, ticker: Ticker) -> None:
        """Copy the items of the list, and write the first item."""
        behaviour = self.behaviour
        items: Any = behaviour.blackboard.get(behaviour.source_key) or []
        if not isinstance(items, Iterable):
            message = (
                f"'{behaviour.name}': '{behaviour.source_key}' must be a list, but has the value {items!r}"
            )
            raise TypeError(message)
        ticker.values[self.waiting] = tuple(freeze(item) for item in items)
        self.write_next_item(ticker)

    def write_next_item(self, ticker: Ticker) -> None:
        """Write the next item to the blackboard, if there is one."""
        cells, values = ticker.cells, ticker.values
        cells[self.has_item] = 0
        if values[self.waiting]:
            first, *others = values[self.waiting]
            item = thaw(first)
            self.behaviour.blackboard.set(self.behaviour.target_key, item)
            values[self.waiting] = tuple(others)
            cells[self.has_item] = int(item is not None)

    def update(self, ticker: Ticker) -> int:
        """Return SUCCESS if no item is left, RUNNING if the next item begins, and else the child's status."""
        cells = ticker.cells
        if not cells[self.has_item]:
            return SUCCESS
        if cells[self.child.status_cell] == SUCCESS:
            self.write_next_item(ticker)
            if cells[self.has_item]:
                return RUNNING
        return cells[self.child.status_cell]

    def terminate(self, ticker: Ticker, status: int) -> None:  # noqa: ARG002
        """Remove the remaining items."""
        self.reset_cells(ticker)


class StockTimeoutNode(StockDecoratorNode):
    """The node for a Timeout of py_trees. The node measures the time with the mission's clock."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.timer = Countdown(part)

    def start(self, ticker: Ticker) -> None:
        """Start the timer."""
        self.timer.start(self.behaviour.duration, ticker)
        self.behaviour.feedback_message = ""

    def update(self, ticker: Ticker) -> int:
        """Return FAILURE if the child is still running after the time limit."""
        behaviour, status = self.behaviour, ticker.cells[self.child.status_cell]
        if status != RUNNING:
            behaviour.feedback_message = ""
            return status
        if self.timer.is_up(ticker):
            behaviour.feedback_message = "timed out"
            return FAILURE
        behaviour.feedback_message = self.timer.remaining_message(ticker)
        return RUNNING

    def terminate(self, ticker: Ticker, status: int) -> None:  # noqa: ARG002
        """Stop the timer."""
        self.reset_cells(ticker)
