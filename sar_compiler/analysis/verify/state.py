"""The state of a tree between two ticks, and how it is saved and restored."""

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

# The number of states in which growing values are searched, and the number of reported names.
_SAMPLE = 5000
_MOST_GROWING = 3


class EventAlphabet:
    """The possible events of a tree's stub leaves, numbered for the kernel.

    Args:
        simulated: The tree.

    Attributes:
        events: The event of each number.
        outcomes: The leaf of each number, and its outcome; None if the event is not an outcome.
        numbers: The number of each event, by the identities of the leaf and of the outcome (or of None).
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
        # By identity: two outcomes of a leaf may be equal.
        self.numbers[id(leaf), what, id(outcome)] = len(self.events)
        self.events.append(leaf.event(what, outcome))
        self.outcomes.append((leaf, outcome))

    def matching_events(self, pattern: EventPattern) -> set[int]:
        """Return the numbers of all events that a pattern matches."""
        return {number for number, event in enumerate(self.events) if pattern.matches(event)}


@dataclass(frozen=True)
class PreparedTree:
    """A tree with stub leaves, prepared for the search.

    Attributes:
        simulated: The tree.
        alphabet: Its events.
        entries: The values of its keys and facts.
        start: The numbers of their initial values.
        begun: The initial values of the cells of each node, by its behaviour.
        merged: The keys and facts with values that searches do not distinguish.
        plain_start: The numbers of the initial values for a run in which they are distinguished.
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
        """Prepare a tree.

        Raises:
            FrozenValueError: If a key holds a value that can neither be copied nor hashed.
        """
        prepared = cls(simulated, EventAlphabet(simulated))
        for board in (simulated.facts.board, simulated.compiled.board):
            NumberedBoard.from_board(board, prepared.entries)
        prepared.start.extend(prepared.entries.now)
        return prepared

    def merge(self, values: Mapping[str, MergedValues]) -> None:
        """Merge, in searches, values of entries given by absolute names; call it before the first tick."""
        if not values:
            return
        entries, merging = self.entries, ValueMerging(self.entries, values)
        merging.switch_off()
        self.plain_start.extend(entries.now)
        entries.restore(vec[i32](self.start))
        for board in (self.simulated.facts.board, self.simulated.compiled.board):
            assert isinstance(board, NumberedBoard)  # noqa: S101 - `of` has made it one
            board.merge(merging)
        self.start[:] = list(entries.now)
        self.merged.extend(values.values())


@dataclass(frozen=True)
class StateValues:
    """Describes the states of a tree.

    Attributes:
        simulated: The tree.
        steps: The steps that have visited its states.
        own: Returns the memory of the user's controls and decorators in the state that was restored last, by names.
    """

    simulated: SimulatedTree
    steps: TickSteps
    own: Callable[[], Mapping[str, object]]

    def fact_values(self) -> dict[str, object]:
        """Return the current facts, by their names."""
        return dict(sorted(self.simulated.fact_values().items()))

    def facts_and_keys(self, state: bytes | None = None) -> tuple[dict[str, object], dict[str, object]]:
        """Return the facts and the keys of the tree, by name, in a state or now."""
        if state is not None:
            self.steps.restore(state)
        return self.fact_values(), dict(sorted(self.simulated.compiled.board.values().items()))

    def values_in(self, state: bytes) -> dict[str, object]:
        """Return the keys of the tree, then the facts, in a state."""
        facts, keys = self.facts_and_keys(state)
        return {**keys, **facts}

    def growing_values(self, states: StateStore) -> tuple[tuple[str, int], ...]:
        """Return the keys, facts and cells with the most values in the last states, and the numbers of values."""
        values: dict[str, set[str]] = {}
        for state in states.states_between(max(len(states) - _SAMPLE, 0), len(states)):
            for name, value in {**self.values_in(state), **self.own()}.items():
                values.setdefault(name, set()).add(repr(value))
        counts = sorted(((name, len(found)) for name, found in values.items()), key=lambda each: -each[1])
        return tuple((name, count) for name, count in counts[:_MOST_GROWING] if count > 1)
