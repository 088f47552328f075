"""The states of a tree and the ticks between them, of which runs are told: played again tick by tick."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from sar_compiler.analysis.state_search.graph import Breach, Edge, Graph
from sar_compiler.analysis.state_search.liveness import Lasso
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.runtime.events import Event, TickRecord

IsWanted = Callable[[TickSteps], bool]
"""Returns whether a tick that was just played is the one that is looked for."""


@dataclass(frozen=True)
class Trace:
    """A run.

    Attributes:
        ticks: Its ticks.
        loop: How many of its last ticks come again and again for ever; 0 for a run that is told to its end.
    """

    ticks: tuple[TickRecord, ...]
    loop: int = 0

    @property
    def events(self) -> Iterator[Event]:
        """What happens in it, one by one."""
        return (event for tick in self.ticks for event in tick.events)


@dataclass(frozen=True, eq=False)
class StateSpace:
    """The states that were found of a tree, and the ticks between them.

    The search keeps of each tick only the states and middles that it leads to and what it waits for; events and changes of a million
    ticks would not fit. A run is restored from that: each of its ticks is tried in the order of the search until one
    leads to the next state. Several may. For a way to a state any will do, because the state is all that later
    ticks depend on. For a breach it must be the one with the choices that were noted, since the events break the
    property; and in a round the one that waits for the same, or the run that is shown might not be fair.

    Attributes:
        stepper: What the graph was made with.
        graph: The states, as numbers in the order in which they were found, and the ticks.
        rules: What the properties are called, by their numbers in the graph.
        owing: The numbers of those that can owe something.
        unknown: The first tick that needs a value that is not known; None if there is none.
    """

    stepper: TreeStepper
    graph: Graph
    rules: tuple[str, ...] = ()
    owing: tuple[int, ...] = ()
    unknown: Breach | None = None

    def to(self, state: int) -> Trace:
        """Return a shortest run to a state."""
        return self._trace(self._stem(self.graph.stem(state)))

    def breach(self, breach: Breach) -> Trace:
        """Return a shortest run to a breach."""
        stem, path = self._stem(self.graph.stem(breach.source)), breach.path
        last = [] if path is None else [(breach.source, lambda step: step.path() == path)]
        return self._trace([*stem, *last])

    def lasso(self, lasso: Lasso) -> Trace:
        """Return a run into a loop, and once around it."""
        states = [lasso.stem[-1], *(target for target, _ in lasso.loop)]
        loop = zip(states, map(self._is, lasso.loop), strict=False)
        return self._trace([*self._stem(lasso.stem), *loop], len(lasso.loop))

    def _stem(self, states: Iterable[int]) -> list[tuple[int, IsWanted]]:
        return [(source, self._leads_to(target)) for source, target in pairwise(states)]

    def _trace(self, steps: Iterable[tuple[int, IsWanted]], loop: int = 0) -> Trace:
        """Return a run of ticks, each of which is given by the state before it and by what is wanted of it."""
        played = [self._play(source, wanted, number) for number, (source, wanted) in enumerate(steps, 1)]
        return Trace(tuple(played), loop)

    def _play(self, source: int, wanted: IsWanted, number: int = 0) -> TickRecord:
        return self.stepper.play(self.graph.states[source], wanted, number)

    def _leads_to(self, target: int) -> IsWanted:
        end = self.graph.states[target]
        return lambda step: step.state == end

    def _is(self, tick: Edge) -> IsWanted:
        target, waits = tick
        end = self.graph.states[target]
        return lambda step: step.state == end and step.waits[0] == waits
