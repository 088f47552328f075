"""The state of a tree between two ticks: what it consists of, how it is taken, and how it is restored."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from sar_compiler.checks.verify.events import Alphabet
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.kernel.numbering import StateStore
from sar_compiler.runtime.kernel.tick_steps import TickSteps
from sar_compiler.runtime.numbered_board import NumberedBoard

# How many states are searched for what grows, and how many names are reported.
_SAMPLE = 5000
_MOST_GROWING = 3


@dataclass(frozen=True)
class Prepared:
    """A tree with stub leaves, prepared for the search.

    Attributes:
        simulated: The tree.
        alphabet: Its events.
        entries: What its keys and facts hold.
    """

    simulated: SimulatedTree
    alphabet: Alphabet
    entries: EntryCells = field(default_factory=EntryCells)

    @classmethod
    def of(cls, simulated: SimulatedTree) -> "Prepared":
        """Prepare a tree.

        Raises:
            FrozenValueError: If a key holds a value that can neither be copied nor hashed.
        """
        prepared = cls(simulated, Alphabet(simulated))
        for board in (simulated.facts.board, simulated.compiled.board):
            NumberedBoard.of(board, prepared.entries)
        return prepared


class StateValues:
    """Describes the states of a tree.

    Args:
        simulated: The tree.
        steps: Has gone through its states.
        own: Returns what the user's controls and decorators remember in the state that was restored last, by names.
    """

    def __init__(
        self, simulated: SimulatedTree, steps: TickSteps, own: Callable[[], Mapping[str, object]]
    ) -> None:
        self._simulated = simulated
        self._steps = steps
        self._own = own

    def values(self) -> dict[str, object]:
        """Return the keys of the tree and then the facts as they are now, each by their names."""
        keys, facts = self._simulated.compiled.board.values(), self._simulated.fact_values()
        return {**dict(sorted(keys.items())), **dict(sorted(facts.items()))}

    def values_in(self, state: bytes) -> dict[str, object]:
        """Return the keys of the tree and the facts in a state."""
        self._steps.restore(state)
        return self.values()

    def growing(self, states: StateStore) -> tuple[tuple[str, int], ...]:
        """Return the keys, facts and cells with the most values in the last of some states, and how many values."""
        values: dict[str, set[str]] = {}
        for state in states.between(max(len(states) - _SAMPLE, 0), len(states)):
            for name, value in {**self.values_in(state), **self._own()}.items():
                values.setdefault(name, set()).add(repr(value))
        counts = sorted(((name, len(found)) for name, found in values.items()), key=lambda each: -each[1])
        return tuple((name, count) for name, count in counts[:_MOST_GROWING] if count > 1)
