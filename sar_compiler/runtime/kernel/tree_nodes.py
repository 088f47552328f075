"""Nodes, which define the behaviour of each tree node in a tick, and the ticker that runs them.

A node is ticked without generators and without recursion. A node without children is ticked by `tick` alone. A node with
children returns the next child in `begin` and `resume`, and the `Ticker` keeps the waiting nodes on a stack.
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
    """The cells of a tree while its nodes are built.

    Attributes:
        cells: The initial value of each numeric cell; the first cells are the statuses of the nodes.
        values: The initial value of each other cell.
        watched: The entries whose numbers of writes nodes compare, with the cells that hold such a number.
    """

    def __init__(self, count: int) -> None:
        self.cells: list[int] = [INVALID] * count
        self.values: list[Any] = []
        self.watched: list[tuple[Any, int]] = []


class NodeBuilder:
    """The builder of a node.

    Args:
        index: Its index in the tree.
        at: The cell of its status.
        behaviour: The behaviour.
        children: Its children, which are already built.
        layout: The cells of the tree.
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
        """Add a cell with a non-negative number, and return its index.

        Args:
            first: The initial value.
            keeps: Whether it is kept when the node ends or is halted; else it becomes 0.
            of_tick: Whether it also becomes 0 after an aborted tick.
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
        """Add a cell with any other hashable value, and return its index.

        Args:
            first: The initial value.
            keeps: As for `cell`; else it becomes the initial value.
        """
        values = self.layout.values
        values.append(first)
        if not keeps:
            self.forgotten_values.append((len(values) - 1, first))
        return len(values) - 1

    def watch_entry(self, entry: Any, cell: int) -> None:
        """Register a cell with the entry's number of writes at the node's last check."""
        self.layout.watched.append((entry, cell))


class TreeNode:
    """Define how a behaviour is ticked and stopped.

    Args:
        part: The builder.

    Attributes:
        index: Its index in the tree.
        at: The cell of its status.
        behaviour: The behaviour.
        children: Its children.
        around: Its parent; None for the root.
        is_skippable: Whether the behaviour records that it was skipped.
        heeds_end: Whether its last outcome matters while it does not run. It does not matter if each start is like
            the first.
        shows_itself: Whether the node updates its behaviour's status on every change.
        reached: The number of the tick in which the node was reached last, see `Ticker.reach`.
        first_cell, last_cell, first_value, last_value: The start of its own cells, and the first one after them.
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
        """Return the outcome of a tick; CALLED, and itself in `ticker.called`, if it needs more than this call."""
        ticker.called = self
        return CALLED

    def branch_count(self, ticker: "Ticker") -> int:  # noqa: ARG002
        """Return the number of ways in which the node may begin a tick, if known in advance; only an optimisation."""
        return 1

    def begin(self, ticker: "Ticker") -> int:
        """Begin a tick; return its outcome, or what a child's `tick` returned if that is CALLED."""
        raise NotImplementedError

    def resume(self, ticker: "Ticker", outcome: int) -> int:
        """Continue a tick.

        Args:
            ticker: The ticker.
            outcome: The outcome of the child that was called.

        Returns:
            As for `begin`.
        """
        raise NotImplementedError

    def break_off(self, ticker: "Ticker") -> None:
        """Clean up when a tick is aborted because a descendant has raised an error: reset the cells of the tick."""
        cells = ticker.cells
        for cell in self._of_tick:
            cells[cell] = 0

    def stop(self, ticker: "Ticker") -> None:
        """Stop the node like `Behaviour.stop(Status.INVALID)`, whatever its status is."""
        ticker.stop(self)

    def stop_first(self, ticker: "Ticker") -> "list[TreeNode]":
        """Begin to stop a node with children; return the children to stop, the last one first."""
        raise NotImplementedError

    def stop_last(self, ticker: "Ticker") -> None:
        """Stop a node with children, after its children."""
        raise NotImplementedError

    def reset_cells(self, ticker: "Ticker") -> None:
        """Reset the node's own cells, except for those that keep their values."""
        cells = ticker.cells
        for cell in self._forgotten:
            cells[cell] = 0
        for place, first in self._forgotten_values:
            ticker.values[place] = first

    def reset_outcome(self, ticker: "Ticker") -> None:
        """Reset the node's outcome."""
        ticker.cells[self.status_cell] = INVALID
        if ticker.is_live:
            self.behaviour.status = _INVALID

    def write_status(self, cells: vec[i32]) -> None:
        """Set the behaviour's status from the cells."""
        status: Any = STATUSES[cells[self.status_cell]]
        if self.behaviour.status is not status:
            self.behaviour.status = status


class ChildlessNode(TreeNode):
    """A node without children, which is ticked directly unless all nodes are ticked step by step."""

    def tick(self, ticker: "Ticker") -> int:
        """Tick the node."""
        if ticker.by_step:
            return super().tick(ticker)
        ticker.reach(self)
        return self.begin(ticker)

    def stop(self, ticker: "Ticker") -> None:
        """Reset the node, whatever its status is."""
        ticker.reach(self)
        self.reset_cells(ticker)
        ticker.cells[self.status_cell] = INVALID


class ChoosingNode(TreeNode):
    """A node without children with several possible continuations; it is ticked directly if there is one."""

    def tick(self, ticker: "Ticker") -> int:
        """Tick the node, unless it has several possible continuations."""
        return super().tick(ticker) if self.branch_count(ticker) > 1 else self.begin(ticker)


class Visit:
    """A ticked node, as it was at the end of its tick.

    Attributes:
        behaviour: The behaviour.
        outcome: The outcome of its tick.
        status: Its status.
        message: Its feedback message.
        label: The `outcome_label` of a leaf that has one.
    """

    def __init__(self, behaviour: Any, outcome: int, status: int) -> None:
        self.behaviour = behaviour
        self.outcome = outcome
        self.status = status
        self.message: str = behaviour.feedback_message
        self.label: str = getattr(behaviour, "outcome_label", "")


class Ticker:
    """Ticks nodes.

    Args:
        cells: The cells with numbers.
        values: The cells with other values.
        times: The timers.

    Attributes:
        called: The node to tick first, after CALLED.
        is_live: Whether only ticks change the cells, so that the statuses of behaviours agree with them.
        is_strict: Whether a result that is no status raises a `NoStatusError` instead of being logged.
        by_step: Whether leaves are called like all other nodes, and not directly.
        tells: Whether the nodes' messages and current children are read.
        visits: Receives the ticked nodes, in the order of their ends; None if they are not needed.
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

        The ticked descendants are visits; the node itself is not.
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
        """Prepare a node that a tick is about to start or stop; a live tree synchronises its behaviour."""

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
        """Tick a node as `run` does, without reporting a visit (`TryCatch` while it is halted)."""
        visits, self.visits = self.visits, None
        try:
            return self.run(node)
        finally:
            self.visits = visits

    def number_of(self, behaviour: Any, answer: Any) -> int:
        """Return the number of the result of `update()`; INVALID, with a log message, if it is no status.

        Raises:
            NoStatusError: If the ticker is strict, and the result is no status.
        """
        number = number_of(answer)
        if number == INVALID and answer is not _INVALID:
            if self.is_strict:
                raise NoStatusError(behaviour, answer)
            behaviour.logger.error(
                f"A behaviour returned an invalid status, setting to INVALID [{answer}][{behaviour.name}]"
            )
        return number

    def record_visit(self, node: TreeNode, outcome: int) -> None:
        """Record that a node was ticked."""
        visits, behaviour = self.visits, node.behaviour
        if node.is_skippable:
            behaviour.skipped = outcome == SKIPPED
        if visits is not None:
            visits.append(Visit(behaviour, outcome, self.cells[node.status_cell]))


def reset(child: TreeNode, ticker: Ticker) -> None:
    """Reset a child: halt it if it is running, else only reset its outcome."""
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
    """Return the running children, the last one first, and reset the others."""
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
    """A node that follows BehaviorTree.CPP's rules: it resets its children when it has ended.

    Only a running node can be halted there; one that has ended keeps the state that outlasts its end, such as the turn of a
    RoundRobin. py_trees' composites stop ended children, too, before a restart, which only resets them.

    Attributes:
        asks_whether_it_starts: Whether it behaves differently in the first tick of an activation, see `starts`.
    """

    asks_whether_it_starts: ClassVar[bool] = False

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.is_reset: bool = self.asks_whether_it_starts and is_reset(part.behaviour)
        self.heeds_end = self.is_reset

    def starts(self, ticker: Ticker) -> bool:
        """Return whether a tick is the first one of an activation."""
        status = ticker.cells[self.status_cell]
        return status == INVALID or (status != RUNNING and not self.is_reset)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Reset the node's position; return its running children, and reset the others."""
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
        """Tick a child, and continue after it; return the outcome of the node, or CALLED."""
        outcome = child.tick(ticker)
        return CALLED if outcome == CALLED else self.resume(ticker, outcome)

    def set_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return an outcome, which becomes the node's status unless it is SKIPPED."""
        if outcome != SKIPPED:
            ticker.cells[self.status_cell] = outcome
        return outcome

    def finish(self, ticker: Ticker, outcome: int) -> int:
        """End the node with an outcome: reset its position and its children."""
        self.reset_cells(ticker)
        reset_all(self.children, ticker)
        return self.set_outcome(ticker, outcome)


class ControlNode(OwnNode):
    """A control: it has several children, and reports the current one to py_trees."""

    def tick_child(self, child: TreeNode, ticker: Ticker) -> int:
        """Tick a child as the current one, and continue after it; return the outcome of the node, or CALLED."""
        if ticker.tells:
            self.behaviour.current_child = child.behaviour
        return super().tick_child(child, ticker)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Reset the node's position; return its running children, and reset the others."""
        self.behaviour.current_child = None
        return super().stop_first(ticker)


class OneChildNode(ControlNode):
    """A control that ticks one child after the other: `next_child` chooses it, and `on_child_outcome` handles its outcome.

    Args:
        part: The builder.
        keeps: Whether it keeps the current index when it ends or is halted.
        of_tick: Whether it begins with the first child in each tick.

    Attributes:
        position: The cell with the index of the current child.
    """

    def __init__(self, part: NodeBuilder, *, keeps: bool = False, of_tick: bool = False) -> None:
        super().__init__(part)
        self.position = part.cell(keeps=keeps, of_tick=of_tick)

    def begin(self, ticker: Ticker) -> int:
        """Begin with the current child."""
        ticker.cells[self.status_cell] = RUNNING
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the current child; the outcome INVALID means that it has to be ticked."""
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
        """Return the index of the next child; -1 if there is none left."""
        index = ticker.cells[self.position]
        return index if index < len(self.children) else -1

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Handle the outcome of the current child; return the node's outcome if it is decided, else INVALID."""
        raise NotImplementedError

    def end(self, ticker: Ticker) -> int:
        """Return the outcome after the last child."""
        raise NotImplementedError


class DecoratorNode(OwnNode):
    """A decorator: `begin` decides whether its child is ticked, and `on_child_outcome` converts the outcome."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.child = part.children[0]

    def begin(self, ticker: Ticker) -> int:
        """Tick the child."""
        ticker.cells[self.status_cell] = RUNNING
        return self.tick_child(self.child, ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Continue after the child, which is reset if it has ended."""
        if outcome & ENDED:
            self.child.reset_outcome(ticker)
        return self.on_child_outcome(ticker, outcome)

    def on_child_outcome(self, ticker: Ticker, outcome: int) -> int:
        """Return the node's outcome for that of the child, by default unchanged."""
        return self.set_outcome(ticker, outcome)


def is_reset(behaviour: Any) -> bool:
    """Return whether a node's parent resets it to INVALID before a restart; stock parents do not.

    This determines which ticks start a node, which the status alone cannot. BehaviorTree.CPP starts a node that is IDLE,
    and its controls and decorators reset their children to that (here INVALID) when they have ended. A child with SUCCESS
    or FAILURE below such a parent was therefore ticked earlier in the same activation and continues: WhileDoElse ticks its
    condition again without resetting it. py_trees never resets a child that has ended; it starts any that is not RUNNING.
    So below a stock parent, SUCCESS and FAILURE mean that the node starts, and so they do at the root, which is ticked again
    after its end. A parent that is one node with its child (`is_its_child`) resets nothing by itself; its own parent decides.
    """
    around = behaviour.parent
    while getattr(around, "is_its_child", False):
        around = around.parent
    return hasattr(around, "is_its_child")
