"""The ticks of a tree, from any state that it can be in."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sar_compiler.checks.verify.choices import Choices, UnsteadyError
from sar_compiler.checks.verify.conditions import ConditionError
from sar_compiler.checks.verify.exploring import Judgement, Transition
from sar_compiler.checks.verify.flat_leaves import FlatLeaves
from sar_compiler.checks.verify.outcomes import NOT_TICKED, WORDS
from sar_compiler.checks.verify.prepared import Prepared
from sar_compiler.checks.verify.rules import Rules
from sar_compiler.checks.verify.snapshots import Snapshots
from sar_compiler.checks.verify.timers import Timers
from sar_compiler.checks.verify.trail import Trail
from sar_compiler.runtime.flat import flatten
from sar_compiler.runtime.flat.cells import Cells
from sar_compiler.runtime.stub_leaf import Event

# How many states are looked at for what grows, and how much of it is told.
_SAMPLE = 5000
_MOST_GROWING = 3


class State(NamedTuple):
    """All that the next ticks depend on.

    Attributes:
        cells: The cells of the flat tree, as bytes where they are small numbers.
        keys: The entries of the tree's blackboard, as a number of their snapshot.
        facts: The facts, likewise.
        outcome: What the last tick came to.
        watched: What the properties remember.
    """

    cells: "bytes | tuple[Hashable, ...]"
    keys: int
    facts: int
    outcome: int
    watched: int


@dataclass(frozen=True)
class PlayedTick:
    """What happened in a tick, for those who read of it.

    Attributes:
        events: What the leaves did, in order.
        root: What the root came to; empty if the tick was not finished.
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
        ran: The indexes of the leaves that were ticked so far.
    """

    def __init__(self, prepared: Prepared, rules: Rules) -> None:
        self._simulated = prepared.simulated
        self._alphabet = prepared.alphabet
        self._facts = prepared.facts
        self._rules = rules
        self._choices = Choices()
        self._trail = Trail(rules.guarded)
        leaves = FlatLeaves(prepared, self._choices, self._trail)
        self.flat = flatten(self._simulated.root, leaves.builder)
        self.ran = leaves.ran
        self._times = Timers(self._choices, self._trail)
        self._cells: Cells = self.flat.initial()
        self._outcome = NOT_TICKED
        self._keys = Snapshots(self._simulated.compiled.board)
        self._start = self._state(NOT_TICKED, rules.monitors.start)

    def start(self) -> State:
        """Return the state before the first tick."""
        return self._start

    @property
    def path(self) -> tuple[int, ...]:
        """The choices of the last tick."""
        return self._choices.path

    def steps(self, state: Hashable) -> Iterator[Transition]:
        """Yield everything that the next tick can come to.

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
        self._go_to(state)
        return self._rules.judge(WORDS[state.outcome], state.watched, idle=idle)

    def played(self) -> PlayedTick:
        """Tell of the step that was yielded last."""
        known = self._alphabet.events
        # What is behind them follows an event while a condition holds.
        events = tuple(known[number] for number in self._trail.numbers if number < len(known))
        return PlayedTick(events, WORDS[self._outcome], self._values())

    def values_in(self, state: Hashable) -> dict[str, object]:
        """Return the facts and the keys of the tree in a state."""
        assert isinstance(state, State)  # noqa: S101
        self._go_to(state)
        return self._values()

    def growing(self, states: Sequence[Hashable]) -> tuple[tuple[str, int], ...]:
        """Return the facts and keys that have most values in the last of some states, with the numbers of values."""
        values: dict[str, set[str]] = {}
        for state in states[-_SAMPLE:]:
            for name, value in self.values_in(state).items():
                values.setdefault(name, set()).add(repr(value))
        counts = sorted(((name, len(found)) for name, found in values.items()), key=lambda each: -each[1])
        return tuple((name, count) for name, count in counts[:_MOST_GROWING] if count > 1)

    def _go_to(self, state: State) -> None:
        """Make the facts and keys as they are in a state."""
        self._keys.restore(state.keys)
        self._facts.number = state.facts

    def _values(self) -> dict[str, object]:
        self._facts.write_out()
        board = self._simulated.compiled.board
        prefix = f"{board.prefix}/"
        keys = {name.removeprefix(prefix): board.get(name) for name in board.names() if board.has(name)}
        return {**keys, **self._simulated.fact_values()}

    def _play(self, state: State) -> Transition:
        cells = self._cells
        cells[:] = state.cells
        self._go_to(state)
        self._trail.begin()
        self._outcome = NOT_TICKED
        try:
            self._outcome = outcome = self.flat.tick(cells, self._times)
        except (ConditionError, UnsteadyError):
            raise
        except Exception as error:  # noqa: BLE001 - whatever a leaf raises would end the mission
            return Transition(None, error=error)
        watched, broken = self._rules.monitors.after(state.watched, tuple(self._trail.numbers))
        return Transition(self._state(outcome, watched), self._trail.waits, broken)

    def _state(self, outcome: int, watched: int) -> State:
        self.flat.renumber(self._cells)
        cells: bytes | tuple[Hashable, ...]
        try:
            cells = bytes(self._cells)
        except (TypeError, ValueError):
            cells = tuple(self._cells)
        return State(cells, self._keys.take(), self._facts.number, outcome, watched)
