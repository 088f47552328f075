"""Prepares a tree for searches, and describes the states of the tree between two ticks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from librt.vecs import vec
from mypy_extensions import i32
from py_trees.behaviour import Behaviour

from sar_compiler.analysis.leaf_vocabulary import EventPattern
from sar_compiler.analysis.merging import MergedValues, ValueMerging
from sar_compiler.analysis.numbered_board import NumberedBoard
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.numbering import StateStore
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.runtime.events import HALTED, RETURNED, STARTED, Event
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.outcomes import Outcome

# The number of last states in which growing values are searched, and the maximum number of reported names.
_SAMPLE = 5000
_MAX_GROWING = 3


class EventAlphabet:
    """The possible events of a tree's stub leaves. Each event has a number.

    Args:
        simulated: The tree.

    Attributes:
        events: The events, by number.
        outcomes: The leaf of each event, and the outcome (None if the event is not an outcome), by number.
        numbers: The number of each event, by the leaf's identity, the kind of event, and the outcome's identity.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        self.events: list[Event] = []
        self.outcomes: list[tuple[StubLeaf, Outcome | None]] = []
        self.numbers: dict[tuple[int, str, int], int] = {}
        for leaf in simulated.leaves:
            for outcome in leaf.outcomes:
                self._add(leaf, RETURNED, outcome)
            self._add(leaf, STARTED)
            self._add(leaf, HALTED)

    def _add(self, leaf: StubLeaf, what: str, outcome: Outcome | None = None) -> None:
        # By identity, because two outcomes of a leaf may be equal.
        self.numbers[id(leaf), what, id(outcome)] = len(self.events)
        self.events.append(leaf.event(what, outcome))
        self.outcomes.append((leaf, outcome))

    def matching_events(self, pattern: EventPattern) -> set[int]:
        """Return the numbers of all events that a pattern matches."""
        return {number for number, event in enumerate(self.events) if pattern.matches(event)}


@dataclass(frozen=True)
class PreparedTree:
    """A tree with stub leaves that is prepared for searches.

    Attributes:
        simulated: The tree.
        alphabet: The possible events of the tree.
        entries: The values of keys and facts.
        start: The numbers of the initial values in `entries`.
        begun: The initial contents of each node's cells, by the node's behaviour.
        merged: The keys and facts whose values are merged in searches.
        plain_start: The numbers of the initial values for a run without merged values.
    """

    simulated: SimulatedTree
    alphabet: EventAlphabet
    entries: EntryCells = field(default_factory=EntryCells)
    start: list[int] = field(default_factory=list)
    begun: dict[Behaviour, tuple[list[int], list[Any]]] = field(default_factory=dict)
    merged: list[MergedValues] = field(default_factory=list)
    plain_start: list[int] = field(default_factory=list)

    @classmethod
    def prepare(cls, simulated: SimulatedTree) -> "PreparedTree":
        """Prepare a tree for searches.

        Raises:
            FrozenValueError: If a key holds a value that can neither be copied nor hashed.
        """
        prepared = cls(simulated, EventAlphabet(simulated))
        for board in (simulated.facts.board, simulated.compiled.board):
            NumberedBoard.from_board(board, prepared.entries)
        prepared.start.extend(prepared.entries.now)
        return prepared

    def merge(self, values: Mapping[str, MergedValues]) -> None:
        """Let searches merge the values of the given entries. Call this method before the first tick."""
        if not values:
            return
        entries, merging = self.entries, ValueMerging(self.entries, values)
        merging.switch_off()
        self.plain_start.extend(entries.now)
        entries.restore(vec[i32](self.start))
        for board in (self.simulated.facts.board, self.simulated.compiled.board):
            assert isinstance(board, NumberedBoard)  # noqa: S101 - converted by `prepare`
            board.merge(merging)
        self.start[:] = list(entries.now)
        self.merged.extend(values.values())


@dataclass(frozen=True)
class StateValues:
    """Describes the states of a tree.

    Attributes:
        simulated: The tree.
        steps: The steps that have visited the states.
        own: Returns the cells of the user's controls and decorators in the last restored state, by name.
    """

    simulated: SimulatedTree
    steps: TickSteps
    own: Callable[[], Mapping[str, object]]

    def fact_values(self) -> dict[str, object]:
        """Return the current values of the facts, by name."""
        return dict(sorted(self.simulated.fact_values().items()))

    def facts_and_keys(self, state: bytes | None = None) -> tuple[dict[str, object], dict[str, object]]:
        """Return the facts and the keys in a state as two dictionaries. The default is the current state."""
        if state is not None:
            self.steps.restore(state)
        return self.fact_values(), dict(sorted(self.simulated.compiled.board.values().items()))

    def values_in(self, state: bytes) -> dict[str, object]:
        """Return the keys and facts in a state as one dictionary."""
        facts, keys = self.facts_and_keys(state)
        return {**keys, **facts}

    def growing_values(self, states: StateStore) -> tuple[tuple[str, int], ...]:
        """Return the entries with the most different values in the last states, and the numbers of values."""
        values: dict[str, set[str]] = {}
        for state in states.states_between(max(len(states) - _SAMPLE, 0), len(states)):
            for name, value in {**self.values_in(state), **self.own()}.items():
                values.setdefault(name, set()).add(repr(value))
        counts = sorted(((name, len(found)) for name, found in values.items()), key=lambda each: -each[1])
        return tuple((name, count) for name, count in counts[:_MAX_GROWING] if count > 1)
