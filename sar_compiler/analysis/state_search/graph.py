"""The states of a tree and the ticks between them, in arrays: a million of them has to fit."""

from dataclasses import dataclass, field
from typing import Final

from librt.vecs import append, vec
from mypy_extensions import i16, i32, i64

from sar_compiler.analysis.state_search.numbering import StateStore
from sar_compiler.analysis.state_search.trail import Waits

Edge = tuple[int, int]
"""A tick: the number of the state that it leads to, and the leaves and timers that it goes on waiting for, as bits."""


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


class Numbers:
    """Numbers, of which each takes two bytes as long as none is larger, then four, and then eight."""

    def __init__(self) -> None:
        self._short = vec[i16]()
        self._long = vec[i32]()
        self._longest = vec[i64]()

    def __getitem__(self, at: i64) -> i64:
        if len(self._short):
            return i64(self._short[at])
        return i64(self._long[at]) if len(self._long) else self._longest[at]

    def append(self, number: i64) -> None:
        """Add a number."""
        if len(self._longest):
            self._longest = append(self._longest, number)
        elif number > _LONG:
            self._longest = _longer(self._short, self._long, number)
            self._short, self._long = vec[i16](), vec[i32]()
        elif len(self._long):
            self._long = append(self._long, i32(number))
        elif number > _SHORT:
            for held in self._short:
                self._long = append(self._long, i32(held))
            self._short = vec[i16]()
            self._long = append(self._long, i32(number))
        else:
            self._short = append(self._short, i16(number))


def _longer(short: vec[i16], long: vec[i32], number: i64) -> vec[i64]:
    """Return numbers of which only one of these has any, and one more."""
    longest = vec[i64]()
    for held in short:
        longest = append(longest, i64(held))
    for each in long:
        longest = append(longest, i64(each))
    return append(longest, number)


_SHORT: Final = (1 << 15) - 1
_LONG: Final = (1 << 31) - 1


class Steps:
    """The steps that lead from places of one kind, one place behind the other.

    Attributes:
        targets: Where each step leads: the number of a state; of a middle its number, below 0 and counted from -1.
        waits: What each does to what is waited for, as a number of `Graph.waits`.
    """

    def __init__(self) -> None:
        self._ends = Numbers()
        self._count = 0
        self.targets = vec[i32]()
        self.waits = Numbers()

    def __len__(self) -> int:
        """Return how many places there are of which the steps are known."""
        return self._count

    def of(self, place: i64) -> tuple[i64, i64]:
        """Return the number of the first step from a place, and the first one behind its last."""
        return self._ends[place - 1] if place else 0, self._ends[place]

    def count(self, place: i64) -> i64:
        """Return how many steps lead from a place."""
        first, behind_last = self.of(place)
        return behind_last - first

    def add(self, target: i32, waits: int) -> None:
        """Add a step from the place in hand."""
        self.targets = append(self.targets, target)
        self.waits.append(i64(waits))

    def end(self) -> None:
        """End with the place in hand."""
        self._ends.append(len(self.targets))
        self._count += 1


@dataclass
class Graph:
    """The states of a tree and the steps between them; states are numbered in the order in which they were found.

    A step is a tick, or a part of one, where many ticks come to the same place on their way (a *middle*, see `forking`). From a
    middle, steps lead to states and to middles with lower numbers.

    Attributes:
        states: The states themselves; the first one is the beginning.
        origins: The state from which each was found; 0 for the first.
        steps: The steps from each state that was gone through.
        middles: The steps from each middle.
        waits: The different things that steps do to what is waited for.
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
    steps: Steps = field(default_factory=Steps)
    middles: Steps = field(default_factory=Steps)
    waits: list[Waits] = field(default_factory=list)
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
        return len(self.steps)

    @property
    def step_count(self) -> int:
        """How many steps there are."""
        return len(self.steps.targets) + len(self.middles.targets)

    @property
    def depth(self) -> int:
        """The least number of ticks for which every run was followed."""
        return len(self.levels) - 1

    @property
    def places(self) -> int:
        """How many places there are: the states, by their numbers, and behind them the middles."""
        return len(self.states) + len(self.middles)

    def leading_from(self, place: i64) -> tuple[Steps, i64, i64]:
        """Return the steps from a place: the number of the first one, and the first one behind them. A state that was not gone through has none."""
        states: i64 = len(self.states)
        steps = self.steps if place < states else self.middles
        number = place if place < states else place - states
        if number >= len(steps):
            return steps, 0, 0
        first, behind_last = steps.of(number)
        return steps, first, behind_last

    def place(self, target: i64) -> i64:
        """Return the place that a target of a step is."""
        return target if target >= 0 else len(self.states) - 1 - target

    def ticks(self, state: int) -> list[Edge]:
        """Return the different ticks of a state, in order."""
        found: dict[Edge, None] = {}
        states, seen = len(self.states), set()
        waiting = self._following(state, 0, 0)
        while waiting:
            place, going_on, changed = following = waiting.pop()
            if place < states:
                found[place, going_on] = None
            elif following not in seen:
                seen.add(following)
                waiting.extend(self._following(place, going_on, changed))
        return list(found)

    def _following(self, place: int, going_on: int, changed: int) -> list[tuple[int, int, int]]:
        """Return where the steps from a place lead, and what the tick has noted of what is waited for then; the last step first."""
        steps, first, end = self.leading_from(place)
        return [
            (
                int(self.place(i64(steps.targets[step]))),
                *behind(going_on, changed, self.waits[steps.waits[step]]),
            )
            for step in range(int(end) - 1, int(first) - 1, -1)
        ]

    def stem(self, state: int) -> list[int]:
        """Return the states on a shortest way from the first one to another, both included."""
        way = [state]
        while way[-1]:
            way.append(self.origins[way[-1]])
        return way[::-1]


def behind(going_on: int, changed: int, waits: Waits) -> tuple[int, int]:
    """Return what a tick has noted of what is waited for after a part more of it."""
    goes_on, changes, settled = waits
    return going_on & ~settled | goes_on & (settled | ~changed), changed & ~settled | changes
