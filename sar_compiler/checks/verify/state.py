"""The state of a tree between two ticks: what it consists of, how it is taken, and how it is restored.

There are few different contents of the facts, and scripts take longer than all the rest of a tick. So the contents of
a board are a number, and what a script makes of a number is remembered.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sar_compiler.checks.verify.events import Alphabet
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.blackboard import Board, Snapshot
from sar_compiler.runtime.expressions import Script, name_uses
from sar_compiler.runtime.kernel.cells import INVALID, RUNNING, WORDS
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import Ticker
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.stub_leaf import StubLeaf

NOT_TICKED = 0
NUMBERS: Mapping[str, int] = {word: number for number, word in enumerate(WORDS)}
_UNKNOWN = -1
_FORGOTTEN = bytes(RUNNING if number == RUNNING else INVALID for number in range(256))
"""What is left of a status if only whether a node runs matters."""
# How many states are searched for what grows, and how many names are reported.
_SAMPLE = 5000
_MOST_GROWING = 3


class Snapshots:
    """Numbers the contents of a board.

    Args:
        board: The board.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._numbers: dict[Snapshot, int] = {}
        self._snapshots: list[Snapshot] = []
        self._last: Snapshot | None = None
        self._number = 0

    def take(self) -> int:
        """Return the number of the entries as they are now."""
        taken = self._board.snapshot()
        # A board without changes gives the same snapshot again, which need not be looked for.
        if taken is not self._last:
            self._number = self._numbers.setdefault(taken, len(self._snapshots))
            if self._number == len(self._snapshots):
                self._snapshots.append(taken)
            self._last = taken
        return self._number

    def restore(self, number: int) -> None:
        """Restore the entries of a number."""
        self._board.restore(self._snapshots[number])
        self._last, self._number = self._snapshots[number], number


class RememberedFacts:
    """The facts of a tree as numbers, with what scripts make of each.

    The board of the facts is brought up to date only where it is read: `write_out` does that.

    Args:
        simulated: The tree.
    """

    def __init__(self, simulated: SimulatedTree) -> None:
        self._snapshots = Snapshots(simulated.facts.board)
        self._names = frozenset(simulated.fact_values())
        self._written = self.number = self._snapshots.take()
        """The number of the facts as they are now."""
        # The leaves whose scripts look at facts only, and change nothing else.
        self._known = {
            id(leaf)
            for leaf in simulated.leaves
            if all(
                self.alone(parse(text)) for each in leaf.answers for text in (each.when, each.then) if text
            )
        }
        self._changes: dict[tuple[int, int, int], int] = {}

    def alone(self, script: Script) -> bool:
        """Return whether a script uses nothing but facts."""
        return self._names.issuperset(use.name for use in name_uses(script))

    def write_out(self) -> None:
        """Bring the board up to date."""
        if self._written != self.number:
            self._snapshots.restore(self.number)
            self._written = self.number

    def decide_alone(self, leaf: StubLeaf) -> bool:
        """Return whether the answers of a leaf depend on facts only, and change nothing else."""
        return id(leaf) in self._known

    def options(self, leaf: StubLeaf) -> Sequence[Answer]:
        """Return the answers of a leaf that are possible now; raises as `StubLeaf.options`."""
        self.write_out()
        return leaf.options()

    def change(self, leaf: StubLeaf, answer: Answer) -> None:
        """Apply the effect of an answer of a leaf; raises as `StubLeaf.change`."""
        place = (id(leaf), id(answer), self.number)
        number = self._changes.get(place)
        if number is None:
            self.write_out()
            # Whatever becomes of the change, the board is no longer what it was.
            self._written = _UNKNOWN
            leaf.change(answer)
            number = self._written = self._snapshots.take()
            if id(leaf) in self._known:
                self._changes[place] = number
        self.number = number

    def remembering(self, script: Script, holds: Callable[[], bool]) -> Callable[[], bool]:
        """Return a function that evaluates a condition on the facts as they are now.

        Args:
            script: The condition.
            holds: Evaluates it on the board.
        """
        known: dict[int, bool] = {}
        alone = self.alone(script)

        def remembered() -> bool:
            answer = known.get(self.number)
            if answer is None:
                self.write_out()
                answer = holds()
                if alone:
                    known[self.number] = answer
            return answer

        return remembered


@dataclass(frozen=True)
class Prepared:
    """A tree with stub leaves, prepared for the search.

    Attributes:
        simulated: The tree.
        alphabet: Its events.
        facts: Its facts.
    """

    simulated: SimulatedTree
    alphabet: Alphabet
    facts: RememberedFacts

    @classmethod
    def of(cls, simulated: SimulatedTree) -> "Prepared":
        """Prepare a tree."""
        return cls(simulated, Alphabet(simulated), RememberedFacts(simulated))


class State(NamedTuple):
    """Everything that the next ticks depend on.

    Attributes:
        cells: The cells of the flat tree, as bytes where they are small numbers.
        values: The cells with other values.
        keys: The entries of the tree's blackboard, as a number of their snapshot.
        facts: The facts, likewise.
        outcome: The outcome of the last tick.
        watched: What the properties remember.
    """

    cells: "bytes | tuple[int, ...]"
    values: tuple[Hashable, ...]
    keys: int
    facts: int
    outcome: int
    watched: int


class StateStore:
    """Takes states of a tree, and restores them.

    Args:
        prepared: The tree.
        flat: Its flat form.
        ticker: What ticks it.
        forgets: Whether states are the same that differ only in how nodes have ended, where that makes no difference.
    """

    def __init__(self, prepared: Prepared, flat: FlatTree, ticker: Ticker, *, forgets: bool = True) -> None:
        self._simulated = prepared.simulated
        self._facts = prepared.facts
        self._flat = flat
        self._keys = Snapshots(prepared.simulated.compiled.board)
        self._ticker = ticker
        self._nodes = len(flat.nodes) if forgets else 0
        self._heeded = sorted({node.at for node in flat.nodes if node.heeds_end})

    def take(self, outcome: int, watched: int) -> State:
        """Return the state as it is now.

        Args:
            outcome: The outcome of the last tick.
            watched: What the properties remember.
        """
        ticker = self._ticker
        self._flat.renumber(ticker)
        heeded = [(cell, ticker.cells[cell]) for cell in self._heeded]
        ticker.cells[: self._nodes] = bytes(ticker.cells[: self._nodes]).translate(_FORGOTTEN)
        for cell, status in heeded:
            ticker.cells[cell] = status
        cells: bytes | tuple[int, ...]
        try:
            cells = bytes(ticker.cells)
        except ValueError:
            cells = tuple(ticker.cells)
        return State(cells, tuple(ticker.values), self._keys.take(), self._facts.number, outcome, watched)

    def restore(self, state: State) -> None:
        """Make the tree what it was in a state."""
        self._ticker.cells[:] = state.cells
        self._ticker.values[:] = state.values
        self.restore_boards(state)

    def restore_boards(self, state: State) -> None:
        """Make the keys and facts what they were in a state; enough for whatever only reads them."""
        self._keys.restore(state.keys)
        self._facts.number = state.facts

    def values(self) -> dict[str, object]:
        """Return the keys of the tree and the facts as they are now."""
        self._facts.write_out()
        board = self._simulated.compiled.board
        prefix = f"{board.prefix}/"
        keys = {name.removeprefix(prefix): board.get(name) for name in board.names() if board.has(name)}
        return {**keys, **self._simulated.fact_values()}

    def values_in(self, state: Hashable) -> dict[str, object]:
        """Return the keys of the tree and the facts in a state."""
        assert isinstance(state, State)  # noqa: S101 - there are no others
        self.restore_boards(state)
        return self.values()

    def growing(self, states: Sequence[Hashable]) -> tuple[tuple[str, int], ...]:
        """Return the keys and facts with the most values in the last of some states, and how many values."""
        values: dict[str, set[str]] = {}
        for state in states[-_SAMPLE:]:
            for name, value in self.values_in(state).items():
                values.setdefault(name, set()).add(repr(value))
        counts = sorted(((name, len(found)) for name, found in values.items()), key=lambda each: -each[1])
        return tuple((name, count) for name, count in counts[:_MOST_GROWING] if count > 1)
