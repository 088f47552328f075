"""Searching the states of a tree breadth first."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from sar_compiler.checks.verify.graph import Breach, Graph

# Who waits for a report, or wants to stop, does not wait long for so many ticks.
_REPORT_EVERY = 256


class Transition(NamedTuple):
    """One possible result of a tick.

    Attributes:
        state: The state after it; None if it raised.
        waits: The leaves and timers that it goes on waiting for, as bits.
        broken: The rules that it breaks, as bits.
        error: What it raised.
    """

    state: Hashable | None
    waits: int = 0
    broken: int = 0
    error: Exception | None = None


class Judgement(NamedTuple):
    """The judgement of a state.

    Attributes:
        ends: Whether the run is over in it.
        broken: The rules that it breaks, as bits.
        pending: What it owes, as bits.
        is_open: Whether there is more to say once it is known whether the state is idle.
    """

    ends: bool = False
    broken: int = 0
    pending: int = 0
    is_open: bool = False


class Stepper(Protocol):
    """The states that can be searched."""

    def start(self) -> Hashable:
        """Return the state before the first tick."""
        ...

    def steps(self, state: Hashable) -> Iterator[Transition]:
        """Yield every possible result of the next tick."""
        ...

    def judge(self, state: Hashable, *, idle: bool | None) -> Judgement:
        """Judge a state.

        Args:
            state: The state.
            idle: Whether every tick leaves it as it is; None if that is not known yet.
        """
        ...

    @property
    def path(self) -> tuple[int, ...]:
        """The choices of the step that was yielded last."""
        ...


@dataclass(frozen=True)
class Progress:
    """The progress of the search.

    Attributes:
        states: How many states were found.
        expanded: How many of them were gone through.
        ticks: How many different ticks there were.
        depth: How many ticks lead to the state in hand.
        broken: The properties that are broken so far, by their names.
    """

    states: int
    expanded: int
    ticks: int
    depth: int
    broken: tuple[str, ...] = ()


Report = Callable[[Progress], bool | None]
"""Is told the progress; returns True to have the search stopped."""


def keep_quiet(progress: Progress) -> None:
    """Report nothing."""


def explore(
    stepper: Stepper, max_states: int, report: Report = keep_quiet, names: Sequence[str] = ()
) -> Graph:
    """Search all states that can be reached, breadth first.

    Args:
        stepper: Knows the states.
        max_states: How many to find at most; where there are more, the graph is not complete.
        report: Is called with the progress now and then, and when a property is broken.
        names: What the properties are called, by the number of the rule.
    """
    return _Exploration(stepper, max_states, report, names).run()


class _Exploration:
    def __init__(self, stepper: Stepper, max_states: int, report: Report, names: Sequence[str]) -> None:
        self._stepper = stepper
        self._max_states = max_states
        self._report = report
        self._names = names
        self._graph = Graph()
        self._numbers: dict[Hashable, int] = {}
        self._waiting: dict[int, int] = {}
        self._open: set[int] = set()
        self._played = 0

    def run(self) -> Graph:
        graph = self._graph
        self._add(self._stepper.start(), 0)
        level_end, index = 1, 0
        while index < len(graph.keys) and graph.complete:
            if index == level_end:
                graph.levels.append(index)
                level_end = len(graph.keys)
            self._expand(index)
            index += 1
        return graph

    def _expand(self, index: int) -> None:
        """Find the successors of a state; one whose successors do not all fit does not count as expanded."""
        graph, numbers, waiting = self._graph, self._numbers, self._waiting
        edges: dict[tuple[int, int], None] = {}
        idle = True
        for step in self._stepper.steps(graph.keys[index]):
            self._count()
            if graph.stopped:
                return
            if step.state is None:
                self._note_error(index, step)
                idle = False
                continue
            target = numbers.get(step.state)
            if target is None:
                if len(graph.keys) >= self._max_states:
                    graph.complete = False
                    return
                target = self._add(step.state, index)
            if step.broken:
                self._note_breaches(Breach(index, self._stepper.path), step.broken)
            edges[target, waiting.setdefault(step.waits, len(waiting))] = None
            idle = idle and target == index
        self._write(edges)
        if index in self._open:
            self._judge_again(index, idle=idle)

    def _count(self) -> None:
        """Count a tick, and report the progress now and then."""
        self._played += 1
        if self._played % _REPORT_EVERY == 0:
            self._tell()

    def _tell(self) -> None:
        """Report the progress; if nobody wants to know more, the graph is not complete."""
        graph = self._graph
        broken = tuple(self._names[rule] for rule in graph.breaches if rule < len(self._names))
        numbers = len(graph.keys), graph.expanded, len(graph.targets), len(graph.levels) - 1
        if self._report(Progress(*numbers, broken)):
            graph.stopped, graph.complete = True, False

    def _write(self, edges: Iterable[tuple[int, int]]) -> None:
        """Write down what the ticks of a state lead to, and what they wait for."""
        graph = self._graph
        for target, wait in edges:
            graph.targets.append(target)
            graph.waits.append(wait)
        graph.offsets.append(len(graph.targets))
        if len(self._waiting) > len(graph.waiting):
            graph.waiting = list(self._waiting)

    def _judge_again(self, index: int, *, idle: bool) -> None:
        """Judge a state again now that all of its ticks are known.

        Whether a state is idle depends on its ticks, and whether a run ends there may depend on that. When the
        state is found its ticks are not known, so it is judged twice. Nothing asks for its end in between: that
        is for `liveness`, after the search.
        """
        self._open.remove(index)
        judgement = self._stepper.judge(self._graph.keys[index], idle=idle)
        self._graph.ends[index] = judgement.ends
        self._note_breaches(Breach(index), judgement.broken)

    def _add(self, state: Hashable, source: int) -> int:
        graph = self._graph
        number = self._numbers[state] = len(graph.keys)
        graph.keys.append(state)
        graph.origins.append(source)
        judgement = self._stepper.judge(state, idle=None)
        graph.ends.append(judgement.ends)
        graph.pending.append(judgement.pending)
        if judgement.is_open:
            self._open.add(number)
        if judgement.broken:
            self._note_breaches(Breach(source, self._stepper.path), judgement.broken)
        return number

    def _note_breaches(self, breach: Breach, broken: int) -> None:
        rule = 0
        while broken:
            if broken & 1 and rule not in self._graph.breaches:
                self._graph.breaches[rule] = breach
                self._tell()
            broken >>= 1
            rule += 1

    def _note_error(self, source: int, step: Transition) -> None:
        if self._graph.error is None:
            self._graph.error = Breach(source, self._stepper.path, step.error)
