"""Nodes: what each behaviour does in a tick, and what ticks them.

A node is ticked without generators and without recursion. One without children is ticked by `tick` alone. One with
children says in `begin` and `resume` which child it needs next, and the `Ticker` keeps those that wait on a stack.
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
        cells: The first content of each cell with a number; the first cells are the statuses of the nodes.
        values: The first content of each cell with another value.
        watched: The entries of which nodes compare how often they were written, with the cells that hold a count.
    """

    def __init__(self, count: int) -> None:
        self.cells: list[int] = [INVALID] * count
        self.values: list[Any] = []
        self.watched: list[tuple[Any, int]] = []


class NodeBuilder:
    """A node that is to be built.

    Args:
        index: Its index in the tree.
        at: The cell of its status.
        behaviour: The behaviour.
        children: Its children, which are built already.
        layout: The cells of the tree.
    """

    def __init__(
        self, index: int, at: int, behaviour: Any, children: "list[TreeNode]", layout: CellLayout
    ) -> None:
        self.index = index
        self.at = at
        self.behaviour = behaviour
        self.children = children
        self.layout = layout
        self.forgotten: list[int] = []
        self.forgotten_values: list[tuple[int, Any]] = []
        self.of_tick: list[int] = []

    def cell(self, first: int = 0, *, keeps: bool = False, of_tick: bool = False) -> int:
        """Add a cell with a number that is 0 or more; return its index.

        Args:
            first: What it holds at first.
            keeps: Whether it goes on holding what it does when the node ends or is halted; else it is 0 from then on.
            of_tick: Whether it is 0 as well after a tick that is broken off.
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
        """Add a cell with any other value that can be hashed; return its index.

        Args:
            first: What it holds at first.
            keeps: As that of `cell`; else it is the first value from then on.
        """
        values = self.layout.values
        values.append(first)
        if not keeps:
            self.forgotten_values.append((len(values) - 1, first))
        return len(values) - 1

    def watch(self, entry: Any, cell: int) -> None:
        """Register a cell that holds how often an entry had been written when the node looked at it last."""
        self.layout.watched.append((entry, cell))


class TreeNode:
    """What a behaviour does in a tick, and how it is stopped.

    Args:
        part: What it is built of.

    Attributes:
        index: Its index in the tree.
        at: The cell of its status.
        behaviour: The behaviour.
        children: Its children.
        around: The node whose child it is; None for the root.
        is_skippable: Whether the behaviour tells that it was skipped.
        heeds_end: Whether it matters, while the node does not run, if and how it has ended. It does not where each start is
            as the first.
        shows_itself: Whether the node gives its behaviour its status whenever that changes.
        reached: The number of the tick in which the node was reached last, see `Ticker.reach`.
        first_cell, last_cell, first_value, last_value: Where the cells of its own begin, and the first behind them.
    """

    def __init__(self, part: NodeBuilder) -> None:
        self.index = part.index
        self.at = part.at
        self.behaviour = part.behaviour
        self.children = part.children
        self.around: TreeNode | None = None
        for child in part.children:
            child.around = self
        self.is_skippable: bool = hasattr(part.behaviour, "skipped")
        self.heeds_end = self.shows_itself = False
        self.reached = 0
        self.first_cell = self.last_cell = self.first_value = self.last_value = 0
        self._forgotten, self._forgotten_values = part.forgotten, part.forgotten_values
        self._of_tick = part.of_tick

    def tick(self, ticker: "Ticker") -> int:
        """Return the outcome of a tick; CALLED, and itself in `ticker.called`, if that takes more than this call."""
        ticker.called = self
        return CALLED

    def ways(self, ticker: "Ticker") -> int:  # noqa: ARG002
        """Return in how many ways the node may begin a tick, as far as that is known before: it saves time, no more."""
        return 1

    def begin(self, ticker: "Ticker") -> int:
        """Begin a tick; return its outcome, or what a child's `tick` returned if that is CALLED."""
        raise NotImplementedError

    def resume(self, ticker: "Ticker", outcome: int) -> int:
        """Go on with a tick.

        Args:
            ticker: What ticks the node.
            outcome: The outcome of the child that was called.

        Returns:
            As `begin`.
        """
        raise NotImplementedError

    def break_off(self, ticker: "Ticker") -> None:
        """Do what is left to do when a tick is broken off because a node below has raised: forget what is of the tick."""
        cells = ticker.cells
        for cell in self._of_tick:
            cells[cell] = 0

    def stop(self, ticker: "Ticker") -> None:
        """Stop the node as `Behaviour.stop(Status.INVALID)` does, whatever its status is."""
        ticker.stop(self)

    def stop_first(self, ticker: "Ticker") -> "list[TreeNode]":
        """Begin to stop a node with children; return those that are to be stopped, the last one first."""
        raise NotImplementedError

    def stop_last(self, ticker: "Ticker") -> None:
        """Stop a node with children, after these."""
        raise NotImplementedError

    def forget(self, ticker: "Ticker") -> None:
        """Forget where the node was: all that its cells hold, but for those that keep it."""
        cells = ticker.cells
        for cell in self._forgotten:
            cells[cell] = 0
        for place, first in self._forgotten_values:
            ticker.values[place] = first

    def rest(self, ticker: "Ticker") -> None:
        """Forget how the node has ended."""
        ticker.cells[self.at] = INVALID
        if ticker.is_live:
            self.behaviour.status = _INVALID

    def show(self, cells: vec[i32]) -> None:
        """Give the behaviour the status that the cells say."""
        status: Any = STATUSES[cells[self.at]]
        if self.behaviour.status is not status:
            self.behaviour.status = status


class ChildlessNode(TreeNode):
    """A node without children, which is ticked in passing unless all nodes are ticked step by step."""

    def tick(self, ticker: "Ticker") -> int:
        """Tick the node."""
        if ticker.by_step:
            return super().tick(ticker)
        ticker.reach(self)
        return self.begin(ticker)

    def stop(self, ticker: "Ticker") -> None:
        """Bring the node to rest, whatever its status is."""
        ticker.reach(self)
        self.forget(ticker)
        ticker.cells[self.at] = INVALID


class ChoosingNode(TreeNode):
    """A node without children that may go on in several ways; it is ticked in passing where there is one."""

    def tick(self, ticker: "Ticker") -> int:
        """Tick the node, unless it may go on in several ways."""
        return super().tick(ticker) if self.ways(ticker) > 1 else self.begin(ticker)


class Visit:
    """A node that was ticked, as it was at the end of its tick.

    Attributes:
        behaviour: The behaviour.
        outcome: The outcome of its tick.
        status: Its status.
        message: Its feedback message.
        label: What it has said that it answers (`answer_label`), where it is a leaf that says so.
    """

    def __init__(self, behaviour: Any, outcome: int, status: int) -> None:
        self.behaviour = behaviour
        self.outcome = outcome
        self.status = status
        self.message: str = behaviour.feedback_message
        self.label: str = getattr(behaviour, "answer_label", "")


class Ticker:
    """Ticks nodes.

    Args:
        cells: The cells with numbers.
        values: The cells with other values.
        times: The timers.

    Attributes:
        called: The node that has to be ticked first, after CALLED.
        is_live: Whether the cells are changed by ticks only, so that the statuses of behaviours agree with them.
        is_strict: Whether an answer that is no status raises a `NoStatusError`, and is not only logged.
        by_step: Whether leaves are called like all other nodes, and not in passing.
        tells: Whether anybody reads what nodes tell of themselves: their messages, and which child is the current one.
        visits: Where the nodes go that are ticked, in the order of their ends; None where nobody looks.
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

        The nodes below it that are ticked are visits; it is none itself.
        """
        waiting: list[TreeNode] = []
        self.reach(node)
        try:
            outcome = node.begin(self)
            while True:
                if outcome == CALLED:
                    waiting.append(node)
                    called = self.called
                    assert called is not None  # noqa: S101 - CALLED says so
                    node = called
                    self.reach(node)
                    outcome = node.begin(self)
                    continue
                if not waiting:
                    return outcome
                if self.visits is not None:
                    self.note(node, outcome)
                node = waiting.pop()
                outcome = node.resume(self, outcome)
        except BaseException:
            for broken in (node, *reversed(waiting)):
                broken.break_off(self)
            raise

    def reach(self, node: TreeNode) -> None:
        """Be told that a tick is about to begin or stop a node; a tree that is ticked for real keeps its behaviour in step."""

    def stop(self, node: TreeNode) -> None:
        """Stop a node with children, and the nodes below it."""
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
        """Return the number of what an `update()` has returned; INVALID, and a word in the log, for what is no status.

        Raises:
            NoStatusError: If the ticker is strict, and the answer no status.
        """
        number = number_of(answer)
        if number == INVALID and answer is not _INVALID:
            if self.is_strict:
                raise NoStatusError(behaviour, answer)
            behaviour.logger.error(
                f"A behaviour returned an invalid status, setting to INVALID [{answer}][{behaviour.name}]"
            )
        return number

    def note(self, node: TreeNode, outcome: int) -> None:
        """Note that a node was ticked."""
        visits, behaviour = self.visits, node.behaviour
        if node.is_skippable:
            behaviour.skipped = outcome == SKIPPED
        if visits is not None:
            visits.append(Visit(behaviour, outcome, self.cells[node.at]))


def reset(child: TreeNode, ticker: Ticker) -> None:
    """Bring a child back to rest: halt it if it is running, else only forget how it ended."""
    status = ticker.cells[child.at]
    if status == RUNNING:
        child.stop(ticker)
    elif status != INVALID:
        child.rest(ticker)


def reset_all(children: list[TreeNode], ticker: Ticker) -> None:
    """Bring children back to rest, in order."""
    for child in children:
        reset(child, ticker)


def running(children: list[TreeNode], ticker: Ticker) -> list[TreeNode]:
    """Return the children that run, the last one first, and bring the others back to rest."""
    found: list[TreeNode] = []
    for child in children:
        status = ticker.cells[child.at]
        if status == RUNNING:
            found.append(child)
        elif status != INVALID:
            child.rest(ticker)
    found.reverse()
    return found


class OwnNode(TreeNode):
    """A node that keeps BehaviorTree.CPP's rules: it resets its children when its own work is over.

    Only one that runs can be halted there; one that has ended keeps what outlasts its end, as RoundRobin whose turn it is.
    py_trees' composites stop what has ended, too, before they start it again: that brings it to rest, and no more.

    Attributes:
        asks_whether_it_starts: Whether it does something else in the first tick of an activation, see `starts`.
    """

    asks_whether_it_starts: ClassVar[bool] = False

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.is_reset: bool = self.asks_whether_it_starts and is_reset(part.behaviour)
        self.heeds_end = self.is_reset

    def starts(self, ticker: Ticker) -> bool:
        """Return whether a tick is the first one of an activation."""
        status = ticker.cells[self.at]
        return status == INVALID or (status != RUNNING and not self.is_reset)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Forget where the node was; return its running children, and bring the others back to rest."""
        if ticker.cells[self.at] != RUNNING:
            self.rest(ticker)
            return []
        self.forget(ticker)
        return running(self.children, ticker)

    def stop_last(self, ticker: Ticker) -> None:
        """Forget what the node told, and how it has ended."""
        self.behaviour.feedback_message = ""
        ticker.cells[self.at] = INVALID

    def tick_child(self, child: TreeNode, ticker: Ticker) -> int:
        """Tick a child, and go on after it; return the outcome of the node, or CALLED."""
        outcome = child.tick(ticker)
        return CALLED if outcome == CALLED else self.resume(ticker, outcome)

    def come_to(self, ticker: Ticker, outcome: int) -> int:
        """Return an outcome, which is the node's status from now on unless it is SKIPPED."""
        if outcome != SKIPPED:
            ticker.cells[self.at] = outcome
        return outcome

    def finish(self, ticker: Ticker, outcome: int) -> int:
        """End the node's work with an outcome: forget where it was, and bring the children to rest."""
        self.forget(ticker)
        reset_all(self.children, ticker)
        return self.come_to(ticker, outcome)


class ControlNode(OwnNode):
    """A control: it has several children, and tells py_trees which of them is the current one."""

    def tick_child(self, child: TreeNode, ticker: Ticker) -> int:
        """Tick a child, which is the current one, and go on after it; return the outcome of the node, or CALLED."""
        if ticker.tells:
            self.behaviour.current_child = child.behaviour
        return super().tick_child(child, ticker)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Forget where the node was; return its running children, and bring the others back to rest."""
        self.behaviour.current_child = None
        return super().stop_first(ticker)


class InTurnNode(ControlNode):
    """A control that ticks one child after the other: `next_child` says which, and `take` what comes of its outcome.

    Args:
        part: What it is built of.
        keeps: Whether it remembers which child was in hand when it ends or is halted.
        of_tick: Whether it begins with the first child in each tick.

    Attributes:
        position: The cell with the index of the child in hand.
    """

    def __init__(self, part: NodeBuilder, *, keeps: bool = False, of_tick: bool = False) -> None:
        super().__init__(part)
        self.position = part.cell(keeps=keeps, of_tick=of_tick)

    def begin(self, ticker: Ticker) -> int:
        """Begin with the child in hand."""
        ticker.cells[self.at] = RUNNING
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Go on after the child in hand; INVALID in place of its outcome if it is to be ticked."""
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
            outcome = self.take(ticker, outcome)
            if outcome != INVALID:
                return outcome

    def next_child(self, ticker: Ticker) -> int:
        """Return the index of the child that is to be ticked next; -1 if there is none left."""
        index = ticker.cells[self.position]
        return index if index < len(self.children) else -1

    def take(self, ticker: Ticker, outcome: int) -> int:
        """Take the outcome of the child in hand; return that of the node if it decides, else INVALID."""
        raise NotImplementedError

    def end(self, ticker: Ticker) -> int:
        """Return the outcome after the last child."""
        raise NotImplementedError


class DecoratorNode(OwnNode):
    """A decorator: `begin` decides whether its child is ticked, and `after` what is made of its outcome."""

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.child = part.children[0]

    def begin(self, ticker: Ticker) -> int:
        """Tick the child."""
        ticker.cells[self.at] = RUNNING
        return self.tick_child(self.child, ticker)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Go on after the child, which is left at rest if it has ended."""
        if outcome & ENDED:
            self.child.rest(ticker)
        return self.after(ticker, outcome)

    def after(self, ticker: Ticker, outcome: int) -> int:
        """Return the outcome, given that of the child; as it is if the decorator says nothing else."""
        return self.come_to(ticker, outcome)


def is_reset(behaviour: Any) -> bool:
    """Return whether a node's parent resets it to INVALID before starting it again; stock parents do not.

    That decides which ticks start a node, rather than go on with it; the status alone cannot tell. BehaviorTree.CPP
    starts a node that is IDLE, and its controls and decorators reset their children to that (here INVALID) when their own
    work is over. A child with SUCCESS or FAILURE below such a parent was therefore ticked earlier in the same work and
    goes on: WhileDoElse ticks its condition again without resetting it. py_trees never resets a child that has ended; it
    starts any that is not RUNNING. So below a stock parent, SUCCESS and FAILURE mean that the node starts, and so they do
    at the root, which is ticked again after its end. A parent that is one node with its child (`is_its_child`) resets
    nothing by itself; the one around it decides.
    """
    around = behaviour.parent
    while getattr(around, "is_its_child", False):
        around = around.parent
    return hasattr(around, "is_its_child")
