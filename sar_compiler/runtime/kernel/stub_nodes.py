"""Nodes of stub leaves, and timers, that try every possibility."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, SKIPPED, WORDS
from sar_compiler.runtime.kernel.choices import Choices
from sar_compiler.runtime.kernel.table import known_node
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.trail import Trail
from sar_compiler.runtime.kernel.tree_nodes import Part, Ticker, TreeNode
from sar_compiler.runtime.stub_leaf import ANSWERED, HALTED, STARTED, StubLeaf


class _Reply(NamedTuple):
    """An answer that is possible.

    Attributes:
        event: The number of its event.
        outcome: The outcome of the tick.
        change: The answer, if it changes facts or keys.
    """

    event: int
    outcome: int
    change: Answer | None


class LeafNodes:
    """Builds the nodes of leaves.

    Args:
        facts: What answers depend on and change: `number` tells the facts as they are now; see `RememberedFacts`.
        numbers: The number of each event, by the identities of the leaf and of the answer (or of None).
        choices: Decide what is answered.
        trail: Is told what happens; the bit of a leaf is that of its node.

    Attributes:
        ran: The indexes of the leaves that were ticked.
    """

    def __init__(
        self, facts: Any, numbers: Mapping[tuple[int, str, int], int], choices: Choices, trail: Trail
    ) -> None:
        self.ran: set[int] = set()
        self.facts = facts
        self.numbers = numbers
        self.choices = choices
        self.trail = trail

    def node_of(self, part: Part) -> TreeNode:
        """Build the node of a behaviour, whether it is a leaf or not.

        Raises:
            NotFlatError: If its rules are not known.
        """
        if isinstance(part.behaviour, StubLeaf):
            return StubNode(part, self)
        node: TreeNode = known_node(part)
        return node if part.children else NotedNode(part, node, self.ran)


class NotedNode(TreeNode):
    """A leaf of the language whose turns are noted.

    Args:
        part: What it is built of.
        node: What ticks it.
        ran: Where its index is noted.
    """

    def __init__(self, part: Part, node: TreeNode, ran: set[int]) -> None:
        super().__init__(part)
        self._node = node
        self._ran = ran
        self.heeds_end = node.heeds_end

    def tick(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        self._ran.add(self.index)
        return self._node.tick(ticker)

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        return self.tick(ticker)

    def stop(self, ticker: Ticker) -> None:
        """Stop the leaf."""
        self._node.stop(ticker)


class StubNode(TreeNode):
    """A leaf that does what `StubLeaf` does in `initialise`, `update` and `terminate`.

    Args:
        part: What it is built of.
        leaves: What the leaves of a tree share.
    """

    def __init__(self, part: Part, leaves: LeafNodes) -> None:
        super().__init__(part)
        self._leaves = leaves
        self._bit = 1 << part.index
        leaf = part.behaviour
        self._started = leaves.numbers[id(leaf), STARTED, id(None)]
        self._halted = leaves.numbers[id(leaf), HALTED, id(None)]
        self._known: dict[int, Sequence[_Reply]] = {}

    def tick(self, ticker: Ticker) -> int:
        """Start the leaf, unless it runs, and take one of its answers."""
        leaves, cells = self._leaves, ticker.cells
        trail, facts = leaves.trail, leaves.facts
        leaves.ran.add(self.index)
        if cells[self.at] != RUNNING:
            trail.changed |= self._bit
            trail.take(self._started)
        replies = self._known.get(facts.number)
        if replies is None:
            replies = self._replies()
        event, outcome, change = replies[leaves.choices.pick(len(replies))]
        trail.take(event)
        if change is not None:
            facts.change(self.behaviour, change)
        if outcome == RUNNING:
            trail.going_on |= self._bit
        else:
            trail.changed |= self._bit
        if outcome != SKIPPED:
            cells[self.at] = outcome
        return outcome

    def begin(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        return self.tick(ticker)

    def stop(self, ticker: Ticker) -> None:
        """Halt the leaf if it runs."""
        trail = self._leaves.trail
        if ticker.cells[self.at] == RUNNING:
            trail.changed |= self._bit
            trail.take(self._halted)
        ticker.cells[self.at] = INVALID

    def _replies(self) -> Sequence[_Reply]:
        """Return what the leaf can answer now, and keep it if it depends on facts only.

        The last one comes first: leaves name their setbacks after their successes, and among runs of as many
        ticks those with setbacks are found first, which are shorter to read.
        """
        leaf, facts = self.behaviour, self._leaves.facts
        replies = [
            _Reply(
                self._leaves.numbers[id(leaf), ANSWERED, id(answer)],
                WORDS.index(answer.status),
                answer if answer.then else None,
            )
            for answer in reversed(facts.options(leaf))
        ]
        if facts.decide_alone(leaf):
            self._known[facts.number] = replies
        return replies


_STARTED, _UP = 1, 2


class ChosenTimes(Times):
    """Timers of which each may be up at any look, or at a later one.

    Args:
        choices: Decide whether a timer is up.
        trail: Is told what is waited for; the bit of a timer is that of its node.
    """

    def __init__(self, choices: Choices, trail: Trail) -> None:
        self._choices = choices
        self._trail = trail

    def start(self, index: int, seconds: float) -> int:
        """Start a timer; one without any time is up at once."""
        self._trail.changed |= 1 << index
        return _STARTED if seconds > 0 else _UP

    def is_up(self, index: int, token: int) -> bool:
        """Choose whether a timer is up."""
        if token == _UP or self._choices.pick(2) == 1:
            self._trail.changed |= 1 << index
            return True
        self._trail.going_on |= 1 << index
        return False

    def remaining(self, index: int, token: int) -> float:  # noqa: ARG002 - as the protocol has it
        """Return 0: the time left is not known."""
        return 0.0
