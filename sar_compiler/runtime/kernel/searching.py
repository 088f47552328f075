"""Searching the states of a tree breadth first."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

from librt.vecs import append
from mypy_extensions import i32, mypyc_attr

from sar_compiler.runtime.kernel.graph import Breach, Graph
from sar_compiler.runtime.kernel.numbering import Numbering

# Who waits for a report, or wants to stop, does not wait long for so many ticks.
_REPORT_EVERY: Final = 256
_BITS_OF_WAIT: Final = 28
_WAIT: Final = (1 << _BITS_OF_WAIT) - 1
"""An edge is the number of its target, counted from 1, and what it waits for in so many bits."""


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


@mypyc_attr(allow_interpreted_subclasses=True)
class Stepper:
    """The states that can be searched, and the steps between them.

    Attributes:
        state: The state after the last step; None if it raised.
        waits: The leaves and timers that it goes on waiting for, as bits.
        broken: The rules that it breaks, as bits.
        error: What it raised.
    """

    def __init__(self) -> None:
        self.state: bytes | None = None
        self.waits = self.broken = 0
        self.error: Exception | None = None

    def start(self) -> bytes:
        """Return the state before the first step."""
        raise NotImplementedError

    def enter(self, state: bytes) -> None:
        """Go to a state."""
        raise NotImplementedError

    def step(self) -> bool:
        """Do the next one of the steps that are possible in the state; return False if there is none."""
        raise NotImplementedError

    def judge(self, state: bytes, idle: bool | None) -> Judgement:
        """Judge a state.

        Args:
            state: The state.
            idle: Whether every step leaves it as it is; None if that is not known yet.
        """
        raise NotImplementedError

    def path(self) -> tuple[int, ...]:
        """Return the choices of the last step."""
        raise NotImplementedError


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


Step = tuple[bytes, int, int]
"""One step from a state: the state that it leads to, what it goes on waiting for, and the rules that it breaks."""


class Helpers(Protocol):
    """Whoever finds out what the steps of some states are, while their steps are put together here.

    Attributes:
        many: How many states at the same distance are worth their help.
    """

    many: int

    def steps_of(self, states: list[bytes]) -> Iterator[list[Step] | None]:
        """Yield for each state all of its steps; None for one that is left undone."""
        ...


def explore(
    stepper: Stepper,
    max_states: int,
    report: Report = keep_quiet,
    names: Sequence[str] = (),
    helpers: Helpers | None = None,
) -> Graph:
    """Search all states that can be reached, breadth first.

    Args:
        stepper: Knows the states.
        max_states: How many to find at most; where there are more, the graph is not complete.
        report: Is called with the progress now and then, and when a property is broken.
        names: What the properties are called, by the number of the rule.
        helpers: Who does a part of the work, where there are many states at the same distance. The graph is the same.
    """
    return _Exploration(stepper, max_states, report, names, helpers).run()


class _Exploration:
    def __init__(
        self, stepper: Stepper, max_states: int, report: Report, names: Sequence[str], helpers: Helpers | None
    ) -> None:
        self._stepper = stepper
        self._max_states = max_states
        self._report = report
        self._names = names
        self._helpers = helpers
        self._numbering = Numbering()
        self._graph = Graph(self._numbering.states)
        self._waiting: dict[int, int] = {}
        self._open: set[int] = set()
        self._played = 0
        # The step in hand.
        self._source = 0
        self._state: bytes | None = None
        self._waits = self._broken = 0
        self._is_here = True

    def run(self) -> Graph:
        graph = self._graph
        self._add(self._stepper.start())
        level_end, index = 1, 0
        while index < len(graph.states) and graph.complete:
            if index == level_end:
                graph.levels.append(index)
                level_end = len(graph.states)
                helpers = self._helpers
                if helpers is not None and level_end - index >= helpers.many:
                    index = self._expand_level(helpers, index, level_end)
                    continue
            self._expand(index)
            index += 1
        return graph

    def _expand_level(self, helpers: Helpers, index: int, end: int) -> int:
        """Find the successors of all states at a distance with the help of others; return the first state behind them."""
        for steps in helpers.steps_of(self._graph.states.between(index, end)):
            if steps is None:
                self._expand(index)
            else:
                self._put_together(index, steps)
            index += 1
            if not self._graph.complete:
                break
        return index

    def _expand(self, index: int) -> None:
        """Find the successors of a state; one whose successors do not all fit does not count as expanded."""
        stepper = self._stepper
        edges: dict[int, None] = {}
        self._source, self._is_here = index, True
        stepper.enter(self._graph.states[index])
        while stepper.step():
            self._state, self._waits, self._broken = stepper.state, stepper.waits, stepper.broken
            if not self._take(edges):
                return
        self._finish(edges)

    def _put_together(self, index: int, steps: list[Step]) -> None:
        """Take the steps that somebody else has found."""
        edges: dict[int, None] = {}
        self._source, self._is_here = index, False
        for self._state, self._waits, self._broken in steps:
            if not self._take(edges):
                return
        self._finish(edges)

    def _take(self, edges: dict[int, None]) -> bool:
        """Take the step in hand; return False if the search is over."""
        graph, waiting = self._graph, self._waiting
        self._count()
        if graph.stopped:
            return False
        target = -1
        if self._state is None:
            self._note_error()
        else:
            target = self._numbering.find(self._state)
            if target < 0:
                if len(graph.states) >= self._max_states:
                    graph.complete = False
                    return False
                target = self._add(self._state)
            if self._broken:
                self._note_breaches(self._broken)
        # One that raises leads nowhere: it is no edge, but the state is not idle.
        edges[(target + 1) << _BITS_OF_WAIT | waiting.setdefault(self._waits, len(waiting))] = None
        return True

    def _finish(self, edges: dict[int, None]) -> None:
        """Write down the steps of the state in hand."""
        index = self._source
        self._write(edges)
        if index in self._open:
            self._judge_again(index, idle=all(edge >> _BITS_OF_WAIT == index + 1 for edge in edges))

    def _count(self) -> None:
        """Count a tick, and report the progress now and then."""
        self._played += 1
        if self._played % _REPORT_EVERY == 0:
            self._tell()

    def _tell(self) -> None:
        """Report the progress; if nobody wants to know more, the graph is not complete."""
        graph = self._graph
        broken = tuple(self._names[rule] for rule in graph.breaches if rule < len(self._names))
        numbers = len(graph.states), graph.expanded, len(graph.targets), len(graph.levels) - 1
        if self._report(Progress(*numbers, broken)):
            graph.stopped, graph.complete = True, False

    def _write(self, edges: dict[int, None]) -> None:
        """Write down what the ticks of a state lead to, and what they wait for."""
        graph = self._graph
        if len(self._waiting) > len(graph.waiting):
            graph.waiting = list(self._waiting)
        for edge in edges:
            target = edge >> _BITS_OF_WAIT
            if target:
                graph.targets = append(graph.targets, i32(target - 1))
                graph.waits.append(edge & _WAIT)
        graph.offsets = append(graph.offsets, len(graph.targets))

    def _judge_again(self, index: int, *, idle: bool) -> None:
        """Judge a state again now that all of its ticks are known.

        Whether a state is idle depends on its ticks, and whether a run ends there may depend on that. When the
        state is found its ticks are not known, so it is judged twice. Nothing asks for its end in between: that
        is for `liveness`, after the search.
        """
        graph = self._graph
        self._open.remove(index)
        judgement = self._stepper.judge(graph.states[index], idle)
        graph.ends[index] = judgement.ends
        for rule in self._new(judgement.broken):
            graph.breaches[rule] = Breach(index)
            self._tell()

    def _add(self, state: bytes) -> int:
        graph = self._graph
        number = self._numbering.add(state)
        graph.origins = append(graph.origins, i32(self._source))
        judgement = self._stepper.judge(state, None)
        graph.ends.append(judgement.ends)
        graph.pending.append(judgement.pending)
        if judgement.is_open:
            self._open.add(number)
        if judgement.broken:
            self._note_breaches(judgement.broken)
        return number

    def _note_breaches(self, broken: int) -> None:
        """Note that the step in hand breaks rules."""
        for rule in self._new(broken):
            self._graph.breaches[rule] = Breach(self._source, self._path())
            self._tell()

    def _new(self, broken: int) -> list[int]:
        """Return the rules of some bits that were not broken before."""
        return [
            rule
            for rule in range(broken.bit_length())
            if broken >> rule & 1 and rule not in self._graph.breaches
        ]

    def _note_error(self) -> None:
        if self._graph.error is None:
            path = self._path()
            self._graph.error = Breach(self._source, path, self._stepper.error)

    def _path(self) -> tuple[int, ...]:
        """Return the choices of the step in hand; one that somebody else has found is looked up."""
        stepper = self._stepper
        if not self._is_here:
            stepper.enter(self._graph.states[self._source])
            wanted = self._state, self._waits, self._broken
            while stepper.step() and (stepper.state, stepper.waits, stepper.broken) != wanted:
                pass
        return stepper.path()
