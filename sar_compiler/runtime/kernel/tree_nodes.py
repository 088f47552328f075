"""The base classes of the kernel's nodes, and the ticker that ticks them.

Nodes are ticked without generators and without recursion. A node without children needs only the call of `tick`. A node
with children requests the tick of a child in `begin` and `resume`, and the `Ticker` stores the waiting nodes on a
stack.
"""

from collections.abc import Hashable
from typing import Any, ClassVar, Final

from librt.vecs import vec
from mypy_extensions import i32
from py_trees.common import Status

from sar_compiler.runtime.kernel.cells import CALLED, ENDED, INVALID, RUNNING, SKIPPED, STATUSES, number_of
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.leaf_protocol import NoStatusError

_INVALID: Final[Any] = Status.INVALID


class CellLayout:
    """The cells of a tree that is being built. Each new node adds its cells.

    Attributes:
        cells: The initial values of the numeric cells; the first cells are the statuses of the nodes.
        values: The initial values of the other cells.
        watched: Pairs of an entry and a cell. A node compares the entry's number of writes with the number in the cell.
    """

    def __init__(self, count: int) -> None:
        self.cells: list[int] = [INVALID] * count
        self.values: list[Any] = []
        self.watched: list[tuple[Any, int]] = []


class NodeBuilder:
    """The data from which a node is created.

    Args:
        index: The node's index in the tree.
        at: The cell that stores the node's status.
        behaviour: The node's behaviour.
        children: The nodes of the children.
        layout: The cells of the tree, to which the node adds its own cells.
    """

    def __init__(
        self, index: int, at: int, behaviour: Any, children: "list[TreeNode]", layout: CellLayout
    ) -> None:
        self.index = index
        self.status_cell = at
        self.behaviour = behaviour
        self.children = children
        self.layout = layout
        self.forgotten: list[int] = []
        self.forgotten_values: list[tuple[int, Any]] = []
        self.of_tick: list[int] = []

    def cell(self, first: int = 0, *, keeps: bool = False, of_tick: bool = False) -> int:
        """Add a cell for numbers, and return its index.

        Args:
            first: The initial value.
            keeps: Whether the value remains when the node ends or is halted; otherwise it becomes 0.
            of_tick: Whether the value also becomes 0 after an aborted tick.
        """
        cells = self.layout.cells
        cells.append(first)
        index = len(cells) - 1
        if not keeps:
            self.forgotten.append(index)
        if of_tick:
            self.of_tick.append(index)
        return index

    def value(self, first: Hashable, *, keeps: bool = False) -> int:
        """Add a cell for any hashable values, and return its index.

        Args:
            first: The initial value.
            keeps: Whether the value remains when the node ends or is halted; otherwise it becomes the initial value.
        """
        values = self.layout.values
        values.append(first)
        if not keeps:
            self.forgotten_values.append((len(values) - 1, first))
        return len(values) - 1

    def watch_entry(self, entry: Any, cell: int) -> None:
        """Register a cell that stores how often an entry had been written when the node last checked the entry."""
        self.layout.watched.append((entry, cell))


class TreeNode:
    """A node of the kernel. It ticks and stops one behaviour of py_trees.

    Args:
        part: The builder.

    Attributes:
        index: The node's index in the tree.
        status_cell: The cell that stores the node's status.
        behaviour: The node's behaviour.
        children: The nodes of the children.
        parent: The parent's node; None for the root.
        is_skippable: Whether the behaviour has the attribute `skipped`, which is True if the behaviour was skipped.
        heeds_end: Whether the node's next start depends on its last outcome.
        shows_itself: Whether the node updates its behaviour's status on every change.
        reached: The number of the tick in which the node was last reached; see `Ticker.reach`.
        first_cell: The first of the node's own numeric cells.
        last_cell: The cell after the node's own numeric cells.
        first_value: The first of the node's own other cells.
        last_value: The cell after the node's own other cells.
    """

    def __init__(self, part: NodeBuilder) -> None:
        self.index = part.index
        self.status_cell = part.status_cell
        self.behaviour = part.behaviour
        self.children = part.children
        self.parent: TreeNode | None = None
        for child in part.children:
            child.parent = self
        self.is_skippable: bool = hasattr(part.behaviour, "skipped")
        self.heeds_end = self.shows_itself = False
        self.reached = 0
        self.first_cell = self.last_cell = self.first_value = self.last_value = 0
        self._forgotten, self._forgotten_values = part.forgotten, part.forgotten_values
        self._of_tick = part.of_tick

    def tick(self, ticker: "Ticker") -> int:
        """Tick the node in this call and return the outcome, or request a tick from the ticker and return CALLED."""
        ticker.called = self
        return CALLED

    def branch_count(self, ticker: "Ticker") -> int:  # noqa: ARG002
        """Return in how many ways the next tick may continue, or 1 if this is not known."""
        return 1

    def begin(self, ticker: "Ticker") -> int:
        """Begin a tick. Return the node's outcome, or CALLED if the `tick` of a child has returned CALLED."""
        raise NotImplementedError

    def resume(self, ticker: "Ticker", outcome: int) -> int:
        """Continue a tick after a child was ticked.

        Args:
            ticker: The ticker.
            outcome: The outcome of the child.

        Returns:
            As for `begin`.
        """
        raise NotImplementedError

    def break_off(self, ticker: "Ticker") -> None:
        """After an error has aborted a tick, reset the cells that are used only during a tick."""
        cells = ticker.cells
        for cell in self._of_tick:
            cells[cell] = 0

    def stop(self, ticker: "Ticker") -> None:
        """Stop the node, whatever its status is, in the same way as `Behaviour.stop(Status.INVALID)`."""
        ticker.stop(self)

    def stop_first(self, ticker: "Ticker") -> "list[TreeNode]":
        """Begin to stop a node with children. Return the children that must be stopped, in reverse order."""
        raise NotImplementedError

    def stop_last(self, ticker: "Ticker") -> None:
        """Finish stopping a node with children, after these children were stopped."""
        raise NotImplementedError

    def reset_cells(self, ticker: "Ticker") -> None:
        """Reset the node's own cells, except for cells that were added with *keeps*."""
        cells = ticker.cells
        for cell in self._forgotten:
            cells[cell] = 0
        for place, first in self._forgotten_values:
            ticker.values[place] = first

    def reset_outcome(self, ticker: "Ticker") -> None:
        """Set the node's status to INVALID."""
        ticker.cells[self.status_cell] = INVALID
        if ticker.is_live:
            self.behaviour.status = _INVALID

    def write_status(self, cells: vec[i32]) -> None:
        """Copy the node's status from its cell to its behaviour."""
        status: Any = STATUSES[cells[self.status_cell]]
        if self.behaviour.status is not status:
            self.behaviour.status = status


class ChildlessNode(TreeNode):
    """A node without children. Except in step-by-step mode, one call of `tick` completes the tick."""

    def tick(self, ticker: "Ticker") -> int:
        """Tick the node."""
        if ticker.by_step:
            return super().tick(ticker)
        ticker.reach(self)
        return self.begin(ticker)

    def stop(self, ticker: "Ticker") -> None:
        """Reset the node's cells and status."""
        ticker.reach(self)
        self.reset_cells(ticker)
        ticker.cells[self.status_cell] = INVALID


class ChoosingNode(TreeNode):
    """A node without children whose tick may continue in several ways."""

    def tick(self, ticker: "Ticker") -> int:
        """Tick the node if the tick can continue in only one way. Otherwise request a tick."""
        return super().tick(ticker) if self.branch_count(ticker) > 1 else self.begin(ticker)


class Visit:
    """A record of a node at the end of its tick.

    Attributes:
        behaviour: The node's behaviour.
        outcome: The outcome of the tick.
        status: The node's status.
        message: The behaviour's feedback message.
        label: The leaf's `outcome_label`; empty if there is none.
    """

    def __init__(self, behaviour: Any, outcome: int, status: int) -> None:
        self.behaviour = behaviour
        self.outcome = outcome
        self.status = status
        self.message: str = behaviour.feedback_message
        self.label: str = getattr(behaviour, "outcome_label", "")


class Ticker:
    """The state of a tree, and the stack machine that ticks its nodes.

    Args:
        cells: The cells with numbers.
        values: The cells with other values.
        times: The timers of the nodes.

    Attributes:
        called: The node whose tick is requested when a tick returns CALLED.
        is_live: Whether the tree is live: between two ticks, each behaviour has the status that its cell stores.
        is_strict: Whether a `NoStatusError` is raised if a result is not a status. Otherwise the result is only logged.
        by_step: Whether a leaf is ticked by request, like any other node, instead of in one call.
        tells: Whether the behaviours' messages and current children are read.
        visits: A list to which the visits of ticked nodes are added, in the order in which their ticks end; None if no visits are needed.
    """

    def __init__(self, cells: vec[i32], values: list[Any], times: Times) -> None:
        self.cells = cells
        self.values = values
        self.times = times
        self.called: TreeNode | None = None
        self.is_live = False
        self.is_strict = False
        self.by_step = False
        self.tells = True
        self.visits: list[Visit] | None = None

    def run(self, node: TreeNode) -> int:
        """Tick a node, and return the outcome: RUNNING, SUCCESS, FAILURE or SKIPPED.

        The visits of ticked descendants are recorded, but not the visit of the node itself.
        """
        waiting: list[TreeNode] = []
        self.reach(node)
        try:
            outcome = node.begin(self)
            while True:
                if outcome == CALLED:
                    waiting.append(node)
                    called = self.called
                    assert called is not None  # noqa: S101 - guaranteed by CALLED
                    node = called
                    self.reach(node)
                    outcome = node.begin(self)
                    continue
                if not waiting:
                    return outcome
                if self.visits is not None:
                    self.record_visit(node, outcome)
                node = waiting.pop()
                outcome = node.resume(self, outcome)
        except BaseException:
            for broken in (node, *reversed(waiting)):
                broken.break_off(self)
            raise

    def reach(self, node: TreeNode) -> None:
        """Prepare a node for a tick or a stop. The ticker of a live tree then copies the behaviour's status."""

    def stop(self, node: TreeNode) -> None:
        """Stop a node with children, and its descendants."""
        self.reach(node)
        waiting, left = [node], [node.stop_first(self)]
        while waiting:
            if not left[-1]:
                left.pop()
                waiting.pop().stop_last(self)
                continue
            child = left[-1].pop()
            if child.children:
                self.reach(child)
                waiting.append(child)
                left.append(child.stop_first(self))
            else:
                child.stop(self)

    def run_unseen(self, node: TreeNode) -> int:
        """Tick a node like `run`, but do not record visits. A `TryCatch` uses this method when it is halted."""
        visits, self.visits = self.visits, None
        try:
            return self.run(node)
        finally:
            self.visits = visits

    def number_of(self, behaviour: Any, result: Any) -> int:
        """Convert the result of `update()` to a status number. Log any other result, and treat it as INVALID.

        Raises:
            NoStatusError: If the ticker is strict, and the result is not a status.
        """
        number = number_of(result)
        if number == INVALID and result is not _INVALID:
            if self.is_strict:
                raise NoStatusError(behaviour, result)
            behaviour.logger.error(
                f"A behaviour returned an invalid status, setting to INVALID [{result}][{behaviour.name}]"
            )
        return number

    def record_visit(self, node: TreeNode, outcome: int) -> None:
        """Record the visit of a node, and whether the node was skipped."""
        visits, behaviour = self.visits, node.behaviour
        if node.is_skippable:
            behaviour.skipped = outcome == SKIPPED
        if visits is not None:
            visits.append(Visit(behaviour, outcome, self.cells[node.status_cell]))


def reset(child: TreeNode, ticker: Ticker) -> None:
    """Halt a child if it is running. Otherwise only reset the outcome of the child."""
    status = ticker.cells[child.status_cell]
    if status == RUNNING:
        child.stop(ticker)
    elif status != INVALID:
        child.reset_outcome(ticker)


def reset_all(children: list[TreeNode], ticker: Ticker) -> None:
    """Reset children, in order."""
    for child in children:
        reset(child, ticker)


def running_children(children: list[TreeNode], ticker: Ticker) -> list[TreeNode]:
    """Return the running children in reverse order, and reset the outcomes of all other children."""
    found: list[TreeNode] = []
    for child in children:
        status = ticker.cells[child.status_cell]
        if status == RUNNING:
            found.append(child)
        elif status != INVALID:
            child.reset_outcome(ticker)
    found.reverse()
    return found


class OwnNode(TreeNode):
    """A node that follows the rules of BehaviorTree.CPP. It resets its children when it has ended.

    In BehaviorTree.CPP, only a running node can be halted, and an ended node keeps some state, such as the turn of a
    RoundRobin. py_trees' composites stop ended children before a restart. For a node of this class, this only resets the outcome.

    Attributes:
        asks_whether_it_starts: Whether the first tick of an activation differs from later ticks; see `starts`.
    """

    asks_whether_it_starts: ClassVar[bool] = False

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.is_reset: bool = self.asks_whether_it_starts and is_reset(part.behaviour)
        self.heeds_end = self.is_reset

    def starts(self, ticker: Ticker) -> bool:
        """Return whether the tick is the first tick of an activation."""
        status = ticker.cells[self.status_cell]
        return status == INVALID or (status != RUNNING and not self.is_reset)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Reset the node's cells, return its running children, and reset the outcomes of all other children."""
        if ticker.cells[self.status_cell] != RUNNING:
            self.reset_outcome(ticker)
            return []
        self.reset_cells(ticker)
        return running_children(self.children, ticker)

    def stop_last(self, ticker: Ticker) -> None:
        """Reset the node's message and outcome."""
        self.behaviour.feedback_message = ""
        ticker.cells[self.status_cell] = INVALID

    def tick_child(self, child: TreeNode, ticker: Ticker) -> int:
        """Tick a child, and continue the tick of this node. Return the outcome of this node, or CALLED."""
        outcome = child.tick(ticker)
        return CALLED if outcome == CALLED else self.resume(ticker, outcome)

    def set_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Set the node's status to an outcome, except for SKIPPED, and return the outcome."""
        if outcome != SKIPPED:
            ticker.cells[self.status_cell] = outcome
        return outcome

    def finish(self, ticker: Ticker, outcome: int) -> int:
        """End the node with an outcome, and reset its cells and children."""
        self.reset_cells(ticker)
        reset_all(self.children, ticker)
        return self.set_outcome(ticker, outcome)


class ControlNode(OwnNode):
    """A node with several children. It also sets the `current_child` of its py_trees behaviour."""

    def tick_child(self, child: TreeNode, ticker: Ticker) -> int:
        """Make a child the current child, and tick it. Return the outcome of this node, or CALLED."""
        if ticker.tells:
            self.behaviour.current_child = child.behaviour
        return super().tick_child(child, ticker)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Reset the node's cells and current child, return the running children, and reset all other children."""
        self.behaviour.current_child = None
        return super().stop_first(ticker)


class OneChildNode(ControlNode):
    """A control that ticks one child after another. `next_child` selects the child to tick.

    Args:
        part: The builder.
        keeps: Whether the node keeps the current index when it ends or is halted.
        of_tick: Whether the node needs the current index only within a tick.

    Attributes:
        position: The cell that stores the index of the current child.
    """

    def __init__(self, part: NodeBuilder, *, keeps: bool = False, of_tick: bool = False) -> None:
        super().__init__(part)
        self.position = part.cell(keeps=keeps, of_tick=of_tick)

    def begin(self, ticker: Ticker) -> int:
        """Begin with the current child."""
        ticker.cells[self.status_cell] = RUNNING
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the current child. The outcome INVALID means that this child must still be ticked."""
        behaviour, children = self.behaviour, self.children
        while True:
            if outcome == INVALID:
                index = self.next_child(ticker)
                if index < 0:
                    return self.end(ticker)
                child = children[index]
                if ticker.tells:
                    behaviour.current_child = child.behaviour
                outcome = child.tick(ticker)
                if outcome == CALLED:
                    return CALLED
            outcome = self.on_child_outcome(ticker, outcome)
            if outcome != INVALID:
                return outcome

    def next_child(self, ticker: Ticker) -> int:
        """Return the index of the next child, or -1 if no child is left."""
        index = ticker.cells[self.position]
        return index if index < len(self.children) else -1

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Process the current child's outcome. Return this node's outcome, or INVALID if it is undecided."""
        raise NotImplementedError

    def end(self, ticker: Ticker) -> int:
        """End the node after the last child, and return the node's outcome."""
        raise NotImplementedError


class DecoratorNode(OwnNode):
    """A decorator. `begin` decides whether to tick the child, and `on_child_outcome` converts the outcome."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.child = part.children[0]

    def begin(self, ticker: Ticker) -> int:
        """Tick the child."""
        ticker.cells[self.status_cell] = RUNNING
        return self.tick_child(self.child, ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue the tick after the child was ticked. If the child has ended, reset it."""
        if outcome & ENDED:
            self.child.reset_outcome(ticker)
        return self.on_child_outcome(ticker, outcome)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Convert the child's outcome to the node's outcome. By default, both are equal."""
        return self.set_outcome(ticker, outcome)


def is_reset(behaviour: Any) -> bool:
    """Return whether the parent of a node resets the node to INVALID. Composites of py_trees do not.

    A node's status alone does not show whether a tick starts the node; the parent matters, too. BehaviorTree.CPP starts a node that is
    IDLE. Its controls and decorators reset their children to IDLE (here INVALID) when they themselves have ended. A child with SUCCESS or
    FAILURE below such a parent was therefore ticked earlier in the same activation and continues: WhileDoElse ticks its condition again
    without resetting it. py_trees never resets a child that has ended, but starts any child that is not RUNNING. So below a parent of
    py_trees, and at the root, a node with SUCCESS or FAILURE starts. If a parent shares its status with its child (`is_its_child`), the
    grandparent determines the result.
    """
    parent = behaviour.parent
    while getattr(parent, "is_its_child", False):
        parent = parent.parent
    return hasattr(parent, "is_its_child")
