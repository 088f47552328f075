"""Defines the nodes with which a search tries all outcomes of leaves and all possibilities of timers."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from sar_compiler.analysis.state_search.choices import Choices
from sar_compiler.analysis.state_search.trail import Trail
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.errors import SarError
from sar_compiler.runtime.events import HALTED, RETURNED, STARTED
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, SKIPPED, WORDS
from sar_compiler.runtime.kernel.entry_cells import Memo, OutcomeMemo
from sar_compiler.runtime.kernel.table import known_node
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.tree_nodes import ChoosingNode, NodeBuilder, Ticker, TreeNode
from sar_compiler.runtime.language_nodes import ScriptCondition
from sar_compiler.runtime.outcomes import Outcome


class Reply:
    """An outcome that a leaf can return in a search.

    Attributes:
        declared: The declared outcome.
        event: The number of the outcome's event.
        outcome: The number of the outcome's status.
        change: Changes facts and keys; None if the outcome changes nothing.
        effect: The cache of the changes.
    """

    def __init__(self, event: int, leaf: StubLeaf, outcome: Outcome, memo: Callable[..., Memo]) -> None:
        self.declared = outcome
        self.event = event
        self.outcome = WORDS.index(outcome.status)
        self.change: Callable[[], None] | None = None
        if outcome.then:
            self.change = lambda: leaf.change(outcome)
            self.effect = memo(leaf.entries([outcome.then]))


class LeafNodes:
    """Builds the search nodes of leaves.

    Args:
        board: A numbered board, whose cells contain all entries.
        numbers: The number of each event, by the leaf's identity, the kind of event, and the outcome's identity.
        choices: Choose the outcomes.
        trail: Records the events.
        stub: Builds the node of a stub leaf; by default a `StubNode`.

    Attributes:
        ran: The indices of the leaves that were ticked.
    """

    def __init__(
        self,
        board: Any,
        numbers: Mapping[tuple[int, str, int], int],
        choices: Choices,
        trail: Trail,
        stub: "Callable[[NodeBuilder, LeafNodes], TreeNode] | None" = None,
    ) -> None:
        self.ran: set[int] = set()
        self.board = board
        self.numbers = numbers
        self.choices = choices
        self.trail = trail
        self._stub = stub or StubNode

    def node_of(self, part: NodeBuilder) -> TreeNode:
        """Build the search node of a behaviour. The behaviour may also be a control or a decorator.

        Raises:
            NotFlatError: If no node is known for the behaviour's class.
        """
        behaviour = part.behaviour
        if isinstance(behaviour, StubLeaf):
            return self._stub(part, self)
        node: TreeNode = known_node(part)
        if part.children:
            return node
        if isinstance(behaviour, ScriptCondition):
            script = behaviour.script
            if script.entry is not None:
                script.is_remembered = True
                memo = OutcomeMemo(self.board.cells, self.board.cells.place_of(script.entry.name))
                return ConditionLeafNode(part, node, self.ran, memo)
        return RecordedLeafNode(part, node, self.ran)


class RecordedLeafNode(ChoosingNode):
    """A leaf of the tree language that records whether it was ticked.

    Args:
        part: The builder of the node.
        node: The node that ticks the leaf.
        ran: The set to which the index of a ticked leaf is added.
    """

    def __init__(self, part: NodeBuilder, node: TreeNode, ran: set[int]) -> None:
        super().__init__(part)
        self._node = node
        self._ran = ran
        self.heeds_end = node.heeds_end

    def branch_count(self, ticker: Ticker) -> int:
        """Return the number of ways in which the next tick of the leaf can continue."""
        return self._node.branch_count(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        self._ran.add(self.index)
        return self._node.tick(ticker)

    def stop(self, ticker: Ticker) -> None:
        """Halt the leaf."""
        self._node.stop(ticker)


class ConditionLeafNode(RecordedLeafNode):
    """A condition that reads a single blackboard entry. It caches a result for each content of this entry.

    Args:
        part: The builder of the node.
        node: The node that ticks the leaf.
        ran: The set to which the index of a ticked leaf is added.
        memo: The cache of the results.
    """

    def __init__(self, part: NodeBuilder, node: TreeNode, ran: set[int], memo: OutcomeMemo) -> None:
        super().__init__(part, node, ran)
        self._memo = memo
        self._ticker: Ticker | None = None

    def tick(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        return self.begin(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        self._ran.add(self.index)
        self._ticker = ticker
        outcome = self._memo.call(self._tick)
        ticker.cells[self.status_cell] = outcome
        return outcome

    def _tick(self) -> int:
        assert self._ticker is not None  # noqa: S101 - set by `begin`
        return self._node.tick(self._ticker)


class StubNode(ChoosingNode):
    """A leaf that behaves like a `StubLeaf`, and tries every possible outcome in each tick.

    Args:
        part: The builder of the node.
        leaves: The shared context of all leaves.
    """

    def __init__(self, part: NodeBuilder, leaves: LeafNodes) -> None:
        super().__init__(part)
        self._trail = leaves.trail
        self._choices = leaves.choices
        self._ran = leaves.ran
        self._bit = leaves.trail.bit(part.index)
        leaf: StubLeaf = part.behaviour
        numbers = leaves.numbers
        self._started = numbers[id(leaf), STARTED, id(None)]
        self._halted = numbers[id(leaf), HALTED, id(None)]
        # The statuses are tried in reverse order. Leaves declare failures after successes. So among runs of equal
        # length, the runs with failures are found first, which are easier to read.
        ranks = {
            status: rank for rank, status in enumerate(dict.fromkeys(each.status for each in leaf.outcomes))
        }
        self._replies = [
            Reply(numbers[id(leaf), RETURNED, id(outcome)], leaf, outcome, leaves.board.memo)
            for outcome in sorted(leaf.outcomes, key=lambda each: -ranks[each.status])
        ]
        conditions = [outcome.when for outcome in leaf.outcomes if outcome.when]
        self._asked: Memo | None = leaves.board.memo(leaf.entries(conditions)) if conditions else None
        # Created once, because each access would create a new method object.
        self._find_possible: Callable[[], list[Reply]] = self._possible_replies

    def branch_count(self, ticker: Ticker) -> int:  # noqa: ARG002
        """Return the number of possible outcomes, or 1 if a condition raises an error.

        The tick then raises the same error.
        """
        try:
            return len(self._possible())
        except SarError:
            return 1

    def begin(self, ticker: Ticker) -> int:
        """Start the leaf if it is not running, choose a possible outcome, and return the outcome's status."""
        cells, trail = ticker.cells, self._trail
        self._ran.add(self.index)
        if cells[self.status_cell] != RUNNING:
            trail.start(self._bit)
            trail.add_event(self._started)
        replies = self._possible()
        reply = self._apply_reply(replies[self._choices.pick(len(replies))])
        outcome = reply.outcome
        if outcome == RUNNING:
            trail.mark_running(self._bit)
        else:
            trail.mark_ended(self._bit)
        if outcome != SKIPPED:
            cells[self.status_cell] = outcome
        return outcome

    def stop(self, ticker: Ticker) -> None:
        """Halt the leaf if it is running."""
        if ticker.cells[self.status_cell] == RUNNING:
            self._trail.mark_ended(self._bit)
            self._trail.add_event(self._halted)
        ticker.cells[self.status_cell] = INVALID

    def _apply_reply(self, reply: Reply) -> Reply:
        """Apply the effects of an outcome, and return the outcome."""
        self._trail.add_event(reply.event)
        if reply.change is not None:
            reply.effect.call(reply.change)
        return reply

    def _possible(self) -> list[Reply]:
        """Return the outcomes that are possible now."""
        if self._asked is None:
            return self._replies
        possible: list[Reply] = self._asked.call(self._find_possible)
        return possible

    def _possible_replies(self) -> list[Reply]:
        possible = self.behaviour.options()
        return [reply for reply in self._replies if any(reply.declared is each for each in possible)]


_STARTED: Final = 1
_UP: Final = 2


class ChosenTimes(Times):
    """Provides timers for a search.

    Each check of a timer tries both possibilities: that the timer has expired, and that it has not.

    Args:
        choices: Decide whether a timer has expired.
        trail: Records the waits.
    """

    def __init__(self, choices: Choices, trail: Trail) -> None:
        self._choices = choices
        self._trail = trail

    def branch_count(self) -> int:
        """Return 2, because a timer has either expired or not expired."""
        return 2

    def start(self, index: int, seconds: float) -> int:
        """Start a timer, and return a token for the timer. A timer with the duration 0 expires immediately."""
        self._trail.start(self._trail.bit(index))
        return _STARTED if seconds > 0 else _UP

    def is_up(self, index: int, token: int) -> bool:
        """Choose whether a timer has expired."""
        if token == _UP or self._choices.pick(2) == 1:
            self._trail.mark_ended(self._trail.bit(index))
            return True
        self._trail.mark_running(self._trail.bit(index))
        return False
