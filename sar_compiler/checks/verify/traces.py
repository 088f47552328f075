"""Runs as they are reported: played again tick by tick."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.runtime.kernel.graph import Breach, Graph
from sar_compiler.runtime.kernel.liveness import Lasso
from sar_compiler.runtime.kernel.tick_steps import TickSteps
from sar_compiler.runtime.stub_leaf import Event

ValueChange = tuple[object, object]
"""A value before and after; None where there is none."""


@dataclass(frozen=True)
class TraceTick:
    """The events and results of one tick.

    Attributes:
        events: What the leaves did, in order.
        root: The root's status; empty if the tick was not finished.
        changes: The facts and keys that have changed.
        error: What was raised.
    """

    events: tuple[Event, ...]
    root: str
    changes: Mapping[str, ValueChange]
    error: str = ""


@dataclass(frozen=True)
class Trace:
    """A run.

    Attributes:
        ticks: Its ticks.
        loop: How many of its last ticks come again and again for ever; 0 for a run that is told to its end.
    """

    ticks: tuple[TraceTick, ...]
    loop: int = 0


class Retracing:
    """Replays runs of a graph, to report what happened in them.

    The search keeps of each tick only the state that it leads to and what it waits for; events and changes of a million
    ticks would not fit. A run is restored from that: each of its ticks is tried in the order of the search until one
    leads to the next state. Several may. For a way to a state any will do, because the state is all that later
    ticks depend on. For a breach it must be the one with the choices that were noted, since the events break the
    property; and in a round the one that waits for the same, or the run that is shown might not be fair.

    Args:
        stepper: What the graph was made with.
        graph: The graph.
    """

    def __init__(self, stepper: TreeStepper, graph: Graph) -> None:
        self._stepper = stepper
        self._graph = graph

    def to(self, state: int) -> Trace:
        """Return a shortest run to a state."""
        return Trace(tuple(self._stem(self._graph.stem(state))))

    def breach(self, breach: Breach) -> Trace:
        """Return a shortest run to a breach."""
        stem = self._stem(self._graph.stem(breach.source))
        if breach.path is not None:
            stem.append(self._tick(breach.source, lambda step: step.path == breach.path))
        return Trace(tuple(stem))

    def lasso(self, lasso: Lasso) -> Trace:
        """Return a run into a loop, and once around it."""
        ticks = self._stem(lasso.stem)
        state = lasso.stem[-1]
        for edge in lasso.loop:
            ticks.append(self._edge(state, edge))
            state = self._graph.targets[edge]
        return Trace(tuple(ticks), len(lasso.loop))

    def _stem(self, states: Sequence[int]) -> list[TraceTick]:
        return [self._way(source, target) for source, target in pairwise(states)]

    def _way(self, source: int, target: int) -> TraceTick:
        """Return a tick from one state to another."""
        end = self._graph.states[target]
        return self._tick(source, lambda step: step.state == end)

    def _edge(self, source: int, edge: int) -> TraceTick:
        """Return a tick of the graph."""
        graph = self._graph
        end, waits = graph.states[graph.targets[edge]], graph.waiting[graph.waits[edge]]
        return self._tick(source, lambda step: step.state == end and step.waits == waits)

    def _tick(self, source: int, wanted: Callable[[TickSteps], bool]) -> TraceTick:
        """Play the first tick of a state that is wanted."""
        key = self._graph.states[source]
        before = self._stepper.states.values_in(key)
        step = self._stepper.steps
        step.enter(key)
        while step.step() and not wanted(step):
            pass
        played = self._stepper.played()
        after = played.values
        changes = {
            name: (before.get(name), after.get(name))
            for name in {**before, **after}
            if before.get(name) != after.get(name)
        }
        error = "" if step.error is None else f"{type(step.error).__name__}: {step.error}"
        return TraceTick(played.events, played.root, changes, error)
