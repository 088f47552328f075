"""Controls and decorators of a user's classes, whose own `begin` and `resume` say which child comes next."""

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
_TOLD: Final = (*STATUSES, _INVALID)
# What a behaviour shows of itself; nobody's tick depends on it.
_SHOWN: Final = ("status", "feedback_message", "current_child", "skipped", "place")
_COLLECTIONS: Final = (list, dict, set)


class Claim:
    """What the record of a class says of its objects, to be held against what they do.

    Args:
        outcomes: The outcomes that a tick can have, as bits by their numbers.
        goes_on: The outcome after which the next child is ticked, where children are ticked in order; 0 for no such.
        deny: Is told of what the record excludes, in words.
    """

    def __init__(self, outcomes: int, goes_on: int, deny: Any) -> None:
        self.outcomes = outcomes
        self.goes_on = goes_on
        self._deny = deny

    def check_outcome(self, node: TreeNode, outcome: int) -> None:
        """See whether a node may have an outcome."""
        if not self.outcomes >> outcome & 1:
            listed = ", ".join([word for number, word in enumerate(WORDS) if self.outcomes >> number & 1])
            self._deny(
                node.behaviour,
                f"returned {WORDS[outcome]}; by its record it returns {listed or 'nothing'} here",
            )

    def check_order(self, node: TreeNode, place: int, before: int) -> None:
        """See whether a node may tick a child now, after the one before it has come to an outcome."""
        if self.goes_on and before not in (self.goes_on, SKIPPED):
            child, former = node.children[place].behaviour, node.children[place - 1].behaviour
            what = f"ticked '{child.name}' although '{former.name}' had returned {WORDS[before]}"
            self._deny(node.behaviour, f"{what}; its record has it go on only after {WORDS[self.goes_on]}")


class UserNode(OwnNode):
    """A control or decorator whose behaviour has `begin` and `resume`.

    What it remembers is in cells: those that it asked for, the index of the child in hand, and a timer. At its end, and when it is
    halted, its children are brought to rest and its cells hold again what they held at first.

    Attributes:
        in_hand: The cell with the index of the child that was ticked last.
        claim: What its record says of it; None where nobody asks.
    """

    def __init__(self, part: NodeBuilder) -> None:
        super().__init__(part)
        self.in_hand = part.cell()
        self.timer = Countdown(part)
        # The cells that the behaviour has asked for, in their order.
        self.own = [part.value(cell.first, keeps=cell.keeps) for cell in part.behaviour.cells]
        self.claim: Claim | None = None
        self._places = {id(child.behaviour): place for place, child in enumerate(part.children)}
        self._tick = Tick(self)
        self._has_current = hasattr(part.behaviour, "current_child")

    def ways(self, ticker: Ticker) -> int:
        """Return whether the time may be over, or not."""
        return self.timer.ways(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Ask the behaviour which child it needs first."""
        ticker.cells[self.at] = RUNNING
        return self.resume(ticker, INVALID)

    def resume(self, ticker: Ticker, outcome: int) -> int:
        """Tell the behaviour the outcome of the child in hand, and go on as it says; INVALID in place of the outcome if none was ticked yet."""
        behaviour, tick = self.behaviour, self._tick
        before = self._attributes(ticker)
        tick.ticker = ticker
        while True:
            begins = outcome == INVALID
            answer = behaviour.begin(tick) if begins else behaviour.resume(tick, _TOLD[outcome])
            if before is not None:
                self._compare(before)
            place: int = self._places.get(id(answer), -1)
            if place < 0:
                return self._come_to(ticker, answer, "begin" if begins else "resume")
            if self.claim is not None and not begins and place == ticker.cells[self.in_hand] + 1:
                self.claim.check_order(self, place, outcome)
            outcome = self._child(place, ticker).tick(ticker)
            if outcome == CALLED:
                return CALLED

    def _child(self, place: int, ticker: Ticker) -> TreeNode:
        """Return a child that is to be ticked, and that starts anew if it has ended before."""
        cells, child = ticker.cells, self.children[place]
        cells[self.in_hand] = place
        if self._has_current:
            self.behaviour.current_child = child.behaviour
        if cells[child.at] & ENDED:
            child.rest(ticker)
        return child

    def _come_to(self, ticker: Ticker, answer: Any, method: str) -> int:
        """Return the outcome that the behaviour has answered; one that is no RUNNING ends its work."""
        outcome = number_of(answer)
        if outcome == INVALID:
            if answer is not _INVALID:
                raise NoStatusError(self.behaviour, answer, method)
            outcome = SKIPPED
        if self.claim is not None:
            self.claim.check_outcome(self, outcome)
        if outcome == RUNNING:
            return RUNNING
        ticker.cells[self.at] = INVALID
        return self.finish(ticker, outcome)

    def stop_first(self, ticker: Ticker) -> list[TreeNode]:
        """Forget where the node was; return its running children, and bring the others back to rest."""
        if self._has_current:
            self.behaviour.current_child = None
        return super().stop_first(ticker)

    def _attributes(self, ticker: Ticker) -> Any:
        """Return the attributes of the behaviour where all runs are gone through, which puts back its cells alone."""
        if ticker.is_live:
            return None
        found: dict[str, Any] = {}
        for name, value in vars(self.behaviour).items():
            if name not in _SHOWN:
                found[name] = value.copy() if type(value) in _COLLECTIONS else value
        return found

    def _compare(self, before: dict[str, Any]) -> None:
        """Refuse a behaviour that keeps something in its attributes.

        Raises:
            UnsteadyError: If they are others than before.
        """
        behaviour = self.behaviour
        for name, value in vars(behaviour).items():
            was = before.get(name, self)
            if name in _SHOWN or value is was or (type(value) in _COLLECTIONS and value == was):
                continue
            cls = type(behaviour)
            message = (
                f"'{behaviour.name}' ({cls.__module__}.{cls.__qualname__}) changes its attribute '{name}' in a tick; what it "
                "remembers must be in a cell (self.cell()), or its runs cannot be gone through"
            )
            raise UnsteadyError(message)


class Tick:
    """What a control or decorator sees of the tick in hand.

    Attributes:
        ticker: What ticks.
    """

    def __init__(self, node: UserNode) -> None:
        self._node = node
        self.ticker: Any = None

    def __getitem__(self, cell: Any) -> Any:
        """Return what a cell holds."""
        return self.ticker.values[self._node.own[cell.number]]

    def __setitem__(self, cell: Any, value: Any) -> None:
        """Have a cell hold something, which must have a hash."""
        hash(value)
        self.ticker.values[self._node.own[cell.number]] = value

    @property
    def place(self) -> int:
        """The index of the child that was ticked last; 0 at the start."""
        place: int = self.ticker.cells[self._node.in_hand]
        return place

    def halt(self, child: Any) -> None:
        """Halt a child that runs; one that has ended only forgets how."""
        reset(self._node.children[self._node._places[id(child)]], self.ticker)

    def start_timer(self, seconds: float) -> None:
        """Begin to measure a time, in seconds, with the node's `clock`."""
        self._node.timer.start(seconds, self.ticker)

    def time_is_up(self) -> bool:
        """Return whether the time is over that was begun last; False if none was."""
        return self._node.timer.is_up(self.ticker)
