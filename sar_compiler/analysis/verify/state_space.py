"""Provides the states that a search has found, and the runs that lead to these states."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from sar_compiler.analysis.state_search.graph import Breach, Edge, Graph
from sar_compiler.analysis.state_search.liveness import Lasso
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.runtime.events import Event, TickRecord

IsWanted = Callable[[TickSteps], bool]
"""A function that returns whether the tick that was just played is the wanted tick."""


@dataclass(frozen=True)
class Trace:
    """A run of a tree.

    Attributes:
        ticks: The ticks of the run.
        loop: The number of last ticks that repeat forever; 0 for a run without a loop.
    """

    ticks: tuple[TickRecord, ...]
    loop: int = 0

    @property
    def events(self) -> Iterator[Event]:
        """The events of all ticks of the run, in order."""
        return (event for tick in self.ticks for event in tick.events)


class PlayedTick(NamedTuple):
    """A tick that was played in a search.

    Attributes:
        path: The choices of the tick.
        outcome: The number of the root's status.
        broken: The properties that the tick violates, as bits.
        raises: Whether the tick raises an error.
    """

    path: tuple[int, ...]
    outcome: int
    broken: int = 0
    raises: bool = False


def replay_ticks(stepper: TreeStepper, ticks: Iterable[PlayedTick]) -> list[TickRecord]:
    """Play a run from the start with the given choices, and return the ticks of the run.

    Args:
        stepper: Plays the run.
        ticks: The ticks of the run that a search has found.
    """
    state, played = stepper.steps.start(), list[TickRecord]()
    for found in ticks:
        step = next(stepper.ticks(state, found.path))
        if PlayedTick(found.path, step.outcome, step.broken, step.error is not None) != found:
            message = "the run without merged values differs from the run that the search found"
            raise AssertionError(message)
        played.append(stepper.tick_record(len(played) + 1))
        state = step.state or b""
    return played


@dataclass(frozen=True, eq=False)
class StateSpace:
    """The states that a search of a tree has found, and the ticks between them.

    For each tick, the search stores only the state after it, the intermediate states, and the leaves and timers for
    which it waits. The events and changes of a million ticks would not fit into memory. So a run is reconstructed: the
    ticks of each state are tried in the order of the search until a tick leads to the next state. On a path to a state
    any such tick is right, because later ticks only depend on the state. For a violation, the tick must have the
    recorded choices, because its events violate the property. In a loop, the tick must wait for the same leaves and
    timers, because otherwise the run might not be fair.

    Attributes:
        stepper: The stepper of the search.
        graph: The states and the ticks between them.
        rules: The names of the properties, by rule number.
        owing: The numbers of the rules that can have pending obligations.
        unknown: The first tick that needs an unknown value; None if there is no such tick.
        plain: Plays runs without merged values; None if no values are merged.
    """

    stepper: TreeStepper
    graph: Graph
    rules: tuple[str, ...] = ()
    owing: tuple[int, ...] = ()
    unknown: Breach | None = None
    plain: TreeStepper | None = None

    @property
    def tick_error(self) -> Exception | None:
        """The error of the last tick that `plain` has played, or None if there was no error."""
        return None if self.plain is None else self.plain.steps.error

    def trace_to(self, state: int) -> Trace:
        """Return a shortest run that leads to a state."""
        return self._trace(self._stem(self.graph.stem(state)))

    def breach(self, breach: Breach) -> Trace:
        """Return a shortest run that leads to a violation."""
        stem, path = self._stem(self.graph.stem(breach.source)), breach.path
        last = [] if path is None else [(breach.source, lambda step: step.path() == path)]
        return self._trace([*stem, *last])

    def lasso(self, lasso: Lasso) -> Trace:
        """Return a run that leads to a loop and passes through the loop once."""
        states = [lasso.stem[-1], *(target for target, _ in lasso.loop)]
        loop = zip(states, map(self._is_edge, lasso.loop), strict=False)
        return self._trace([*self._stem(lasso.stem), *loop], len(lasso.loop))

    def _stem(self, states: Iterable[int]) -> list[tuple[int, IsWanted]]:
        return [(source, self._leads_to(target)) for source, target in pairwise(states)]

    def _trace(self, steps: Iterable[tuple[int, IsWanted]], loop: int = 0) -> Trace:
        """Return the run that consists of the given ticks. Each is given as an initial state and a predicate."""
        if self.plain is None:
            played = [self._play(source, wanted, number) for number, (source, wanted) in enumerate(steps, 1)]
        else:
            played = replay_ticks(self.plain, [self._find_tick(source, wanted) for source, wanted in steps])
        return Trace(tuple(played), loop)

    def _find_tick(self, source: int, wanted: IsWanted) -> "PlayedTick":
        step = next(filter(wanted, self.stepper.ticks(self.graph.states[source])))
        return PlayedTick(step.path(), step.outcome, step.broken, step.error is not None)

    def _play(self, source: int, wanted: IsWanted, number: int = 0) -> TickRecord:
        return self.stepper.play(self.graph.states[source], wanted, number)

    def _leads_to(self, target: int) -> IsWanted:
        end = self.graph.states[target]
        return lambda step: step.state == end

    def _is_edge(self, tick: Edge) -> IsWanted:
        target, waits = tick
        end = self.graph.states[target]
        return lambda step: step.state == end and step.waits[0] == waits
