"""The ticks of a tree, from any state that it can be in.

Almost all of the time of a verification goes by in the leaves here and in the controls around them.
"""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sar_compiler.checks.verify.choices import Choices, UnsteadyError
from sar_compiler.checks.verify.events import Trail
from sar_compiler.checks.verify.exploring import Judgement, Transition
from sar_compiler.checks.verify.monitors import Rules
from sar_compiler.checks.verify.property_conditions import ConditionError
from sar_compiler.checks.verify.state import NOT_TICKED, NUMBERS, Prepared, State, StateStore
from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, SKIPPED, WORDS
from sar_compiler.runtime.kernel.table import flatten, known_node
from sar_compiler.runtime.kernel.times import Times
from sar_compiler.runtime.kernel.tree_nodes import Part, Ticker, TreeNode
from sar_compiler.runtime.stub_leaf import ANSWERED, HALTED, STARTED, Event, StubLeaf


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
        prepared: Their tree.
        choices: Decide what is answered.
        trail: Is told what happens; the bit of a leaf is that of its node.

    Attributes:
        ran: The indexes of the leaves that were ticked.
    """

    def __init__(self, prepared: Prepared, choices: Choices, trail: Trail) -> None:
        self.ran: set[int] = set()
        self.facts = prepared.facts
        self.numbers = prepared.alphabet.numbers
        self.choices = choices
        self.trail = trail

    def node_of(self, part: Part) -> TreeNode:
        """Build the node of a behaviour, whether it is a leaf or not.

        Raises:
            NotFlatError: If its rules are not known.
        """
        if isinstance(part.behaviour, StubLeaf):
            return StubNode(part, self)
        node = known_node(part)
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

    def tick(self, ticker: Ticker) -> int:
        """Tick the leaf."""
        self._ran.add(self.index)
        return self._node.tick(ticker)

    begin = tick

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
        self._started, self._halted = (leaves.numbers[id(leaf), what, id(None)] for what in (STARTED, HALTED))
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

    begin = tick

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
                NUMBERS[answer.status],
                answer if answer.then else None,
            )
            for answer in reversed(facts.options(leaf))
        ]
        if facts.decide_alone(leaf):
            self._known[facts.number] = replies
        return replies


_STARTED, _UP = 1, 2


class Timers(Times):
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


@dataclass(frozen=True)
class PlayedTick:
    """The events and results of a tick, for reports.

    Attributes:
        events: What the leaves did, in order.
        root: The root's status; empty if the tick was not finished.
        values: The facts and the keys of the tree afterwards.
    """

    events: tuple[Event, ...]
    root: str
    values: dict[str, object]


class TreeStepper:
    """Plays ticks of a simulated tree in its flat form.

    Args:
        prepared: The tree with stub leaves.
        rules: What is watched.

    Raises:
        NotFlatError: If the tree has a node whose rules are not known.

    Attributes:
        flat: The flat form.
        states: Takes and restores its states.
        ran: The indexes of the leaves that were ticked so far.
    """

    def __init__(self, prepared: Prepared, rules: Rules) -> None:
        self._alphabet = prepared.alphabet
        self._rules = rules
        self._choices = Choices()
        self._trail = Trail(rules.guarded)
        leaves = LeafNodes(prepared, self._choices, self._trail)
        self.flat = flatten(prepared.simulated.root, leaves.node_of)
        self.ran = leaves.ran
        self._ticker = self.flat.ticker(Timers(self._choices, self._trail))
        self.states = StateStore(prepared, self.flat, self._ticker)
        self._outcome = NOT_TICKED
        self._start = self.states.take(NOT_TICKED, rules.monitors.start)

    def start(self) -> State:
        """Return the state before the first tick."""
        return self._start

    @property
    def path(self) -> tuple[int, ...]:
        """The choices of the last tick."""
        return self._choices.path

    def steps(self, state: Hashable) -> Iterator[Transition]:
        """Yield every possible result of the next tick.

        Raises:
            ConditionError: If a condition of a property cannot be evaluated.
            UnsteadyError: If the tree does not do the same twice.
        """
        assert isinstance(state, State)  # noqa: S101 - there are no others
        choices = self._choices
        choices.begin()
        while True:
            yield self._play(state)
            if not choices.advance():
                return

    def judge(self, state: Hashable, *, idle: bool | None) -> Judgement:
        """Judge a state."""
        assert isinstance(state, State)  # noqa: S101
        self.states.restore_boards(state)
        return self._rules.judge(WORDS[state.outcome], state.watched, idle=idle)

    def played(self) -> PlayedTick:
        """Return what happened in the step that was yielded last."""
        known = self._alphabet.events
        # Numbers above these are those of guarded events, which go with another one.
        events = tuple(known[number] for number in self._trail.numbers if number < len(known))
        return PlayedTick(events, WORDS[self._outcome], self.states.values())

    def _play(self, state: State) -> Transition:
        states = self.states
        states.restore(state)
        self._trail.begin()
        self._outcome = NOT_TICKED
        try:
            self._outcome = outcome = self.flat.tick(self._ticker)
        except (ConditionError, UnsteadyError):
            raise
        except Exception as error:  # noqa: BLE001 - whatever a leaf raises would end the mission
            return Transition(None, error=error)
        watched, broken = self._rules.monitors.after(state.watched, tuple(self._trail.numbers))
        return Transition(states.take(outcome, watched), self._trail.waits, broken)
