"""The states of a tree and the ticks between them, in arrays: a million of them has to fit."""

import bisect
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from librt.vecs import append, vec
from mypy_extensions import i16, i32, i64

from sar_compiler.runtime.kernel.numbering import StateStore


@dataclass(frozen=True)
class Breach:
    """The first tick in which something went wrong, at the least distance from the start.

    Attributes:
        source: The state in which the tick begins.
        path: The choices of the tick; None if it is the state itself that is wrong.
        error: What it raised, where it did.
    """

    source: int
    path: tuple[int, ...] | None = None
    error: Exception | None = None


class Waits:
    """What each tick waits for, as a number: two bytes each, as long as there are not more."""

    def __init__(self) -> None:
        self._short = vec[i16]()
        self._long = vec[i32]()

    def __getitem__(self, edge: int) -> int:
        return self._long[edge] if len(self._long) else int(self._short[edge])

    def append(self, wait: int) -> None:
        """Add what the next tick waits for."""
        if wait > _SHORT and not len(self._long):
            self._long = vec[i32]([int(each) for each in self._short])
            self._short = vec[i16]()
        if len(self._long):
            self._long = append(self._long, i32(wait))
        else:
            self._short = append(self._short, i16(wait))


_SHORT: Final = (1 << 15) - 1


@dataclass
class Graph:
    """The states of a tree and the ticks between them; states are numbered in the order in which they were found.

    Attributes:
        states: The states themselves; the first one is the beginning.
        origins: The state from which each was found; 0 for the first.
        offsets: Where the ticks of each state that was gone through begin in the two lists below; one more at
            the end.
        targets: The state that each tick leads to.
        waits: What each tick waits for, as a number of `waiting`.
        waiting: The sets of leaves and timers that go on being waited for in a tick, as bits.
        ends: 1 for each state in which the run is over.
        pending: What each state owes, as bits.
        levels: Where the states of each distance begin: those that so many ticks lead to, and no fewer.
        breaches: The first breach of each rule, by the rule's number.
        error: The first tick that could not be finished; None if there is none.
        complete: Whether every state was gone through.
        stopped: Whether somebody wanted the search to end before that.
    """

    states: StateStore
    origins: vec[i32] = field(default_factory=lambda: vec[i32]([]))
    offsets: vec[i64] = field(default_factory=lambda: vec[i64]([0]))
    targets: vec[i32] = field(default_factory=lambda: vec[i32]([]))
    waits: Waits = field(default_factory=Waits)
    waiting: list[int] = field(default_factory=list)
    ends: bytearray = field(default_factory=bytearray)
    pending: list[int] = field(default_factory=list)
    levels: list[int] = field(default_factory=lambda: [0])
    breaches: dict[int, Breach] = field(default_factory=dict)
    error: Breach | None = None
    complete: bool = True
    stopped: bool = False

    @property
    def expanded(self) -> int:
        """How many states were expanded: those before this number."""
        return len(self.offsets) - 1

    @property
    def depth(self) -> int:
        """The least number of ticks for which every run was followed."""
        return len(self.levels) - 1

    def edges(self, state: int) -> range:
        """Return the numbers of the ticks of a state; none for one that was not gone through."""
        if state >= self.expanded:
            return range(0)
        return range(self.offsets[state], self.offsets[state + 1])

    def distance(self, state: int) -> int:
        """Return the least number of ticks that lead to a state."""
        return bisect.bisect_right(self.levels, state) - 1

    def stem(self, state: int) -> list[int]:
        """Return the states on a shortest way from the first one to another, both included."""
        way = [state]
        while way[-1]:
            way.append(self.origins[way[-1]])
        return way[::-1]

    def successors(self, state: int) -> Iterator[int]:
        """Yield the states that the ticks of a state lead to."""
        return (self.targets[edge] for edge in self.edges(state))
