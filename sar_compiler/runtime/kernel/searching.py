"""Searching the states of a tree breadth first."""

from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Protocol

from sar_compiler.runtime.kernel.graph import Breach, Graph
from sar_compiler.runtime.kernel.numbering import Numbering

# Who waits for a report, or wants to stop, does not wait long for so many ticks.
_REPORT_EVERY: Final = 256
_SHORT: Final = 1 << 16
"""So many numbers fit into two bytes."""


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
    """The states that can be searched, and the steps between them.

    Attributes:
        state: The state after the last step; None if it raised.
        waits: The leaves and timers that it goes on waiting for, as bits.
        broken: The rules that it breaks, as bits.
        error: What it raised.
    """

    state: Any
    waits: int
    broken: int
    error: Exception | None

    def start(self) -> Any:
        """Return the state before the first step."""
        ...

    def enter(self, state: Any) -> None:
        """Go to a state."""
        ...

    def step(self) -> bool:
        """Do the next one of the steps that are possible in the state; return False if there is none."""
        ...

    def judge(self, state: Any, idle: bool | None) -> Judgement:
        """Judge a state.

        Args:
            state: The state.
            idle: Whether every step leaves it as it is; None if that is not known yet.
        """
        ...

    @property
    def path(self) -> tuple[int, ...]:
        """The choices of the last step."""
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
        self._numbering = Numbering()
        self._graph = Graph(self._numbering.keys)
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
        graph, stepper, waiting = self._graph, self._stepper, self._waiting
        edges: dict[tuple[int, int], None] = {}
        idle = True
        stepper.enter(graph.keys[index])
        while stepper.step():
            self._count()
            if graph.stopped:
                return
            state = stepper.state
            if state is None:
                self._note_error(index)
                idle = False
                continue
            target = self._numbering.find(state)
            if target < 0:
                if len(graph.keys) >= self._max_states:
                    graph.complete = False
                    return
                target = self._add(state, index)
            if stepper.broken:
                self._note_breaches(Breach(index, stepper.path), stepper.broken)
            edges[target, waiting.setdefault(stepper.waits, len(waiting))] = None
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
        if len(self._waiting) > len(graph.waiting):
            graph.waiting = list(self._waiting)
            if len(graph.waiting) > _SHORT and graph.waits.typecode == "H":
                graph.waits = array("I", graph.waits)
        for target, wait in edges:
            graph.targets.append(target)
            graph.waits.append(wait)
        graph.offsets.append(len(graph.targets))

    def _judge_again(self, index: int, *, idle: bool) -> None:
        """Judge a state again now that all of its ticks are known.

        Whether a state is idle depends on its ticks, and whether a run ends there may depend on that. When the
        state is found its ticks are not known, so it is judged twice. Nothing asks for its end in between: that
        is for `liveness`, after the search.
        """
        self._open.remove(index)
        judgement = self._stepper.judge(self._graph.keys[index], idle)
        self._graph.ends[index] = judgement.ends
        self._note_breaches(Breach(index), judgement.broken)

    def _add(self, state: Any, source: int) -> int:
        graph = self._graph
        number = self._numbering.add(state)
        graph.origins.append(source)
        judgement = self._stepper.judge(state, None)
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

    def _note_error(self, source: int) -> None:
        if self._graph.error is None:
            self._graph.error = Breach(source, self._stepper.path, self._stepper.error)
