"""The kernel's nodes for user-written controls and decorators, whose `begin` and `resume` choose a child."""

from typing import Any, Final

from py_trees.common import Status

from sar_compiler.errors import UnsteadyError
from sar_compiler.runtime.kernel.cells import (
    CALLED,
    ENDED,
    INVALID,
    RUNNING,
    SKIPPED,
    STATUSES,
    WORDS,
    number_of,
)
from sar_compiler.runtime.kernel.timing import Countdown
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, OwnNode, Ticker, TreeNode, reset
from sar_compiler.runtime.leaf_protocol import NoStatusError

_INVALID: Final[Any] = Status.INVALID
_RESUME_STATUSES: Final = (*STATUSES, _INVALID)
# The attributes of a behaviour that may change in a tick, because no tick depends on them.
_SHOWN: Final = ("status", "feedback_message", "current_child", "skipped", "place")
_COLLECTIONS: Final = (list, dict, set)


class Claim:
    """Checks whether a node behaves as its class has declared.

    Args:
        outcomes: The allowed outcomes of a tick, as a bit set of their numbers.
        goes_on: The outcome after which the next child is ticked, if children are ticked in order; otherwise 0.
        deny: Function that is called with the behaviour and a description of each violation of the declaration.
    """

    def __init__(self, outcomes: int, goes_on: int, deny: Any) -> None:
        self.outcomes = outcomes
        self.goes_on = goes_on
        self._deny = deny

    def check_outcome(self, node: TreeNode, outcome: int) -> None:
        """Check whether the class declaration allows an outcome of the node."""
        if not self.outcomes >> outcome & 1:
            listed = ", ".join([word for number, word in enumerate(WORDS) if self.outcomes >> number & 1])
            self._deny(
                node.behaviour,
                f"returned {WORDS[outcome]}, but its declaration allows only {listed or 'nothing'} here",
            )

    def check_order(self, node: TreeNode, place: int, before: int) -> None:
        """Check whether the class declaration allows the node to tick the child at *place* after the outcome *before*."""
        if self.goes_on and before not in (self.goes_on, SKIPPED):
            child, former = node.children[place].behaviour, node.children[place - 1].behaviour
            what = f"ticked '{child.name}' although '{former.name}' had returned {WORDS[before]}"
            self._deny(
                node.behaviour, f"{what}, but its declaration allows that only after {WORDS[self.goes_on]}"
            )


class UserNode(OwnNode):
    """A control or decorator whose behaviour defines the methods `begin` and `resume`.

    The node's state is in the cells that the behaviour has added, the index of the current child, and a timer. When the node ends or is
    halted, the children are reset and the cells get their initial values again.

    Attributes:
        in_hand: The cell that stores the index of the child that was ticked last.
        own: The cells that the behaviour has added.
        claim: The checks against the class's declaration; None if they are not required.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.in_hand = part.cell()
        self.timer = Countdown(part)
        self.own = [part.value(cell.first, keeps=cell.keeps) for cell in part.behaviour.cells]
        self.claim: Claim | None = None
        self._places = {id(child.behaviour): place for place, child in enumerate(part.children)}
        self._tick = Tick(self)
        self._has_current = hasattr(part.behaviour, "current_child")

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of possible results of the timer check."""
        return self.timer.branch_count(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Call the behaviour's `begin`, and tick the child that it returns."""
        ticker.cells[self.status_cell] = RUNNING
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Call the behaviour's `resume`, or `begin` if *outcome* is INVALID. Tick the child that it returns."""
        behaviour, tick = self.behaviour, self._tick
        before = self._attributes(ticker)
        tick.ticker = ticker
        while True:
            begins = outcome == INVALID
            answer = behaviour.begin(tick) if begins else behaviour.resume(tick, _RESUME_STATUSES[outcome])
            if before is not None:
                self._compare(before)
            place: int = self._places.get(id(answer), -1)
            if place < 0:
                return self._apply_outcome(ticker, answer, "begin" if begins else "resume")
            if self.claim is not None and not begins and place == ticker.cells[self.in_hand] + 1:
                self.claim.check_order(self, place, outcome)
            outcome = self._child(place, ticker).tick(ticker)
            if outcome == CALLED:
                return CALLED

    def _child(self, place: int, ticker: Ticker) -> TreeNode:
        """Return the child at an index for a tick. If the child ended before, reset its outcome first."""
        cells, child = ticker.cells, self.children[place]
        cells[self.in_hand] = place
        if self._has_current:
            self.behaviour.current_child = child.behaviour
        if cells[child.status_cell] & ENDED:
            child.reset_outcome(ticker)
        return child

    def _apply_outcome(self, ticker: Ticker, answer: Any, method: str) -> int:
        """Apply and return the outcome returned by the behaviour. Every outcome except RUNNING ends the node."""
        outcome = number_of(answer)
        if outcome == INVALID:
            if answer is not _INVALID:
                raise NoStatusError(self.behaviour, answer, method)
            outcome = SKIPPED
        if self.claim is not None:
            self.claim.check_outcome(self, outcome)
        if outcome == RUNNING:
            return RUNNING
        ticker.cells[self.status_cell] = INVALID
        return self.finish(ticker, outcome)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Reset the node's cells and current child, return the running children, and reset all other children."""
        if self._has_current:
            self.behaviour.current_child = None
        return super().stop_first(ticker)

    def _attributes(self, ticker: Ticker) -> Any:
        """Return a copy of the behaviour's attributes for `_compare`; None in a live tree, whose attributes may change."""
        if ticker.is_live:
            return None
        found: dict[str, Any] = {}
        for name, value in vars(self.behaviour).items():
            if name not in _SHOWN:
                found[name] = value.copy() if type(value) in _COLLECTIONS else value
        return found

    def _compare(self, before: dict[str, Any]) -> None:
        """Check that no attribute of the behaviour has changed, because only the state in cells can be restored.

        Raises:
            UnsteadyError: If an attribute has changed.
        """
        behaviour = self.behaviour
        for name, value in vars(behaviour).items():
            was = before.get(name, self)
            if name in _SHOWN or value is was or (type(value) in _COLLECTIONS and value == was):
                continue
            cls = type(behaviour)
            message = (
                f"'{behaviour.name}' ({cls.__module__}.{cls.__qualname__}) changes its attribute '{name}' during a tick. Store this state "
                f"in a cell (self.cell()), so that all runs can be explored"
            )
            raise UnsteadyError(message)


class Tick:
    """Gives a control or decorator access to its cells, its timer and its children during a tick.

    Attributes:
        ticker: The ticker of the current tick.
    """

    def __init__(self, node: UserNode) -> None:
        self._node = node
        self.ticker: Any = None

    def __getitem__(self, cell: Any) -> Any:
        """Return the value of a cell."""
        return self.ticker.values[self._node.own[cell.number]]

    def __setitem__(self, cell: Any, value: Any) -> None:
        """Set the value of a cell. The value must be hashable."""
        hash(value)
        self.ticker.values[self._node.own[cell.number]] = value

    @property
    def child_index(self) -> int:
        """The index of the child that was ticked last, or 0 if no child was ticked yet."""
        place: int = self.ticker.cells[self._node.in_hand]
        return place

    def halt(self, child: Any) -> None:
        """Halt a child if it is running. Otherwise only reset the outcome of the child."""
        reset(self._node.children[self._node._places[id(child)]], self.ticker)

    def start_timer(self, seconds: float) -> None:
        """Start the node's timer with a duration in seconds, as measured by the node's `clock`."""
        self._node.timer.start(seconds, self.ticker)

    def time_is_up(self) -> bool:
        """Return True if the node's timer was started and has expired."""
        return self._node.timer.is_up(self.ticker)
