"""The states of a tree and the ticks between them, stored in arrays so that a million states fit into memory."""

from dataclasses import dataclass, field
from typing import Final

from librt.vecs import append, vec
from mypy_extensions import i16, i32, i64

from sar_compiler.analysis.state_search.numbering import StateStore
from sar_compiler.analysis.state_search.trail import Waits

Edge = tuple[int, int]
"""The number of the state after a tick, and a bit set of the leaves and timers for which the run still waits."""


@dataclass(frozen=True)
class Breach:
    """The first tick that violates a rule.

    No other violation of this rule needs fewer ticks from the start.

    Attributes:
        source: The number of the state in which the tick starts.
        path: The choices of the tick; None if the state itself violates the rule.
        error: The error that the tick raised; None if it raised no error.
    """

    source: int
    path: tuple[int, ...] | None = None
    error: Exception | None = None


class Numbers:
    """An array of integers. Each takes two bytes, or four or eight bytes after a larger integer was added."""

    def __init__(self) -> None:
        self._short = vec[i16]()
        self._long = vec[i32]()
        self._longest = vec[i64]()

    def __getitem__(self, at: i64) -> i64:
        if len(self._short):
            return i64(self._short[at])
        return i64(self._long[at]) if len(self._long) else self._longest[at]

    def append(self, number: i64) -> None:
        """Append a number."""
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
    """Return an array with the integers of the array that is not empty, followed by *number*."""
    longest = vec[i64]()
    for held in short:
        longest = append(longest, i64(held))
    for each in long:
        longest = append(longest, i64(each))
    return append(longest, number)


_SHORT: Final = (1 << 15) - 1
_LONG: Final = (1 << 31) - 1


class Steps:
    """The steps from all states or from all intermediate states, ordered by the number of the state.

    Attributes:
        targets: The target of each step: the number of a state, or -1 minus the number of an intermediate state.
        waits: The effect of each step on the waits, as an index of `Graph.waits`.
    """

    def __init__(self) -> None:
        self._ends = Numbers()
        self._count = 0
        self.targets = vec[i32]()
        self.waits = Numbers()

    def __len__(self) -> int:
        """Return the number of places whose steps are known."""
        return self._count

    def step_range(self, place: i64) -> tuple[i64, i64]:
        """Return the index of the first step from a place, and the index that follows the last step from it."""
        return self._ends[place - 1] if place else 0, self._ends[place]

    def step_count(self, place: i64) -> i64:
        """Return the number of steps from a place."""
        first, behind_last = self.step_range(place)
        return behind_last - first

    def add(self, target: i32, waits: int) -> None:
        """Add a step that starts at the current place."""
        self.targets = append(self.targets, target)
        self.waits.append(i64(waits))

    def finish_place(self) -> None:
        """Mark the current place as complete. The steps added afterwards start at the next place."""
        self._ends.append(len(self.targets))
        self._count += 1


@dataclass
class Graph:
    """The states of a tree, numbered in the order in which they were found, and the steps between them.

    A step is a tick, or a part of a tick if several ticks reach the same place on their way (an *intermediate state*,
    see `forking`). From an intermediate state, steps lead to states and to intermediate states with lower numbers.

    Attributes:
        states: The encoded states by number; the first state is the start.
        origins: The state from which each state was found; 0 for the first state.
        steps: The steps from each explored state.
        middles: The steps from each intermediate state.
        waits: The different effects of steps on the waits.
        ends: 1 for each state in which the run is over.
        pending: The pending obligations of each state, as bits.
        levels: The first state at each distance. A state's distance is the minimum number of ticks that lead to it.
        breaches: The first violation of each rule, by rule number.
        error: The first tick that raised an error; None if no tick raised an error.
        complete: Whether every state was explored.
        stopped: Whether the search was stopped before every state was explored.
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
    def expanded_count(self) -> int:
        """The number of states from which all ticks were played. These states have the lowest numbers."""
        return len(self.steps)

    @property
    def step_count(self) -> int:
        """The number of steps."""
        return len(self.steps.targets) + len(self.middles.targets)

    @property
    def depth(self) -> int:
        """The number of ticks up to which all runs were explored."""
        return len(self.levels) - 1

    @property
    def places(self) -> int:
        """The number of places. The states are the first places, and the intermediate states follow."""
        return len(self.states) + len(self.middles)

    def leading_from(self, place: i64) -> tuple[Steps, i64, i64]:
        """Return the array with the steps from a place, their first index, and the index after the last one."""
        states: i64 = len(self.states)
        steps = self.steps if place < states else self.middles
        number = place if place < states else place - states
        if number >= len(steps):
            return steps, 0, 0
        first, behind_last = steps.step_range(number)
        return steps, first, behind_last

    def target_place(self, target: i64) -> i64:
        """Convert the target of a step to the number of the place to which the step leads."""
        return target if target >= 0 else len(self.states) - 1 - target

    def ticks(self, state: int) -> list[Edge]:
        """Return the different ticks of a state, in the order in which they were found."""
        found: dict[Edge, None] = {}
        states, seen = len(self.states), set()
        waiting = self._tick_targets(state, 0, 0)
        while waiting:
            place, going_on, changed = following = waiting.pop()
            if place < states:
                found[place, going_on] = None
            elif following not in seen:
                seen.add(following)
                waiting.extend(self._tick_targets(place, going_on, changed))
        return list(found)

    def _tick_targets(self, place: int, going_on: int, changed: int) -> list[tuple[int, int, int]]:
        """Return the target of each step from a place, last step first, with the tick's waits up to the target."""
        steps, first, end = self.leading_from(place)
        return [
            (
                int(self.target_place(i64(steps.targets[step]))),
                *append_waits(going_on, changed, self.waits[steps.waits[step]]),
            )
            for step in range(int(end) - 1, int(first) - 1, -1)
        ]

    def stem(self, state: int) -> list[int]:
        """Return the states on a shortest path from the first state to *state*, including both ends."""
        path = [state]
        while path[-1]:
            path.append(self.origins[path[-1]])
        return path[::-1]


def append_waits(going_on: int, changed: int, waits: Waits) -> tuple[int, int]:
    """Combine the waits of the first part of a tick with the waits of the following part."""
    goes_on, changes, settled = waits
    return going_on & ~settled | goes_on & (settled | ~changed), changed & ~settled | changes
