"""Searching the states of a tree breadth first."""

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from librt.vecs import append, vec
from mypy_extensions import i32, i64, mypyc_attr

from sar_compiler.analysis.state_search.graph import Breach, Graph, Steps
from sar_compiler.analysis.state_search.numbering import Middles, Numbering
from sar_compiler.analysis.state_search.trail import Waits
from sar_compiler.budget import Progress

# Who waits for a report, or wants to stop, does not wait long for so many ticks.
_REPORT_EVERY: Final = 256
_BITS_OF_WAITS: Final = 28
_WAITS: Final = (1 << _BITS_OF_WAITS) - 1
"""A step is where it leads, as in `Steps.targets`, and what it does to what is waited for in so many bits."""
_NOWHERE: Final = (1 << 31) - 1
"""In place of a target: the tick raises."""
_SEVERAL: Final = -1
"""In place of the only state that a place leads to."""
_FEW: Final = 32
"""Among so many steps one is found by looking at all of them."""
_NARROW: Final = 20
"""Three numbers with so many bits make one number of the machine."""

NOTHING: Final = 0
"""There is no step any more."""
A_STATE: Final = 1
"""A step ends a tick."""
A_MIDDLE: Final = 2
"""A step leads to a middle that is known."""
A_NEW_MIDDLE: Final = 3
"""A step leads to a middle that is not known, and the next ones go on from there until it is left."""
LEFT: Final = 4
"""Middles are left, because nothing else goes on from there. The next step may come to one of them: it must have its number by then."""


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
        state: The state after the last step that has ended a tick; None if it raised.
        waits: What the last step does to what is waited for.
        broken: The rules that the tick breaks that it has ended, as bits.
        error: What it raised.
        middle: The middle that the last step has led to.
        left: How many middles were left last.
        middles: Those that were left, lately.
    """

    def __init__(self) -> None:
        self.state: bytes | None = None
        self.waits: Waits = (0, 0, 0)
        self.broken = self.left = 0
        self.error: Exception | None = None
        self.middle = b""
        self.middles = Middles()

    def start(self) -> bytes:
        """Return the state before the first step."""
        raise NotImplementedError

    def enter(self, state: bytes, *, alone: bool = False) -> None:
        """Go to a state; with *alone* as if there were no middles."""
        raise NotImplementedError

    def step(self) -> int:
        """Do the next one of the steps that are possible from the state, and return what it has led to."""
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


Report = Callable[[Progress], bool | None]
"""Is told the progress; returns True to have the search stopped."""


def keep_quiet(progress: Progress) -> None:
    """Report nothing."""


def explore(
    stepper: Stepper,
    max_states: int,
    report: Report = keep_quiet,
    names: Sequence[str] = (),
    starts: Sequence[bytes] = (),
) -> Graph:
    """Search all states that can be reached, breadth first.

    Args:
        stepper: Knows the states.
        max_states: How many to find at most; where there are more, the graph is not complete.
        report: Is called with the progress now and then, and when a property is broken.
        names: What the properties are called, by the number of the rule.
        starts: The states to begin with, each once; by default the stepper's.
    """
    return _Exploration(stepper, max_states, report, names).run(starts or [stepper.start()])


class _Exploration:
    def __init__(self, stepper: Stepper, max_states: int, report: Report, names: Sequence[str]) -> None:
        self._stepper = stepper
        self._max_states = max_states
        self._report = report
        self._names = names
        self._numbering = Numbering()
        self._graph = Graph(self._numbering.states)
        self._known_waits: dict[Any, int] = {}
        self._last_waits: Waits = (-1, -1, -1)
        self._last_number = 0
        # The only state that each middle leads to.
        self._only = vec[i32]()
        # 1 for each state of which there is more to say once it is known whether it is idle.
        self._open = bytearray()
        self._played = 0
        # The place in hand, and those around it in the tick: the steps of each, its middle, and the part of the tick up to it.
        self._places: list[_OpenPlace] = []
        self._source = 0

    def run(self, starts: Sequence[bytes]) -> Graph:
        graph = self._graph
        for state in starts:
            self._add(state)
        level_end, index = len(starts), 0
        while index < len(graph.states) and graph.complete:
            if index == level_end:
                graph.levels.append(index)
                level_end = len(graph.states)
            self._expand(index)
            index += 1
        return graph

    def _expand(self, index: int) -> None:
        """Find the successors of a state; one whose successors do not all fit does not count as expanded."""
        stepper = self._stepper
        self._source = index
        self._places = [_OpenPlace(b"", (0, 0, 0))]
        state = self._graph.states[index]
        stepper.enter(state)
        while True:
            led = stepper.step()
            if led == NOTHING:
                break
            if led == LEFT:
                self._leave(stepper.left)
                continue
            if not self._take(led):
                return
        self._finish(state)

    def _take(self, led: int) -> bool:
        """Take the step in hand; return False if the search is over."""
        graph, stepper = self._graph, self._stepper
        state, waits, broken = stepper.state, stepper.waits, stepper.broken
        self._count()
        if graph.stopped:
            return False
        if led == A_NEW_MIDDLE:
            self._places.append(_OpenPlace(stepper.middle, waits))
            return True
        if led == A_MIDDLE:
            self._lead(-1 - stepper.middles.find(stepper.middle), waits)
            return True
        target = _NOWHERE
        if state is None:
            self._note_error()
        else:
            target = self._numbering.find(state)
            if target < 0:
                if len(graph.states) >= self._max_states:
                    graph.complete = False
                    return False
                target = self._add(state)
            if broken:
                self._note_breaches(broken)
        self._lead(target, waits)
        return True

    def _lead(self, target: int, waits: Waits) -> None:
        """Note a step from the place in hand; one that raises leads nowhere, and so does one to where all others raise."""
        goes_on, changed, settled = waits
        if target >= 0:
            # What has begun in the tick is not waited for.
            changed = 0
        elif not self._graph.middles.count(-1 - target):
            target = _NOWHERE
        if len(self._places) == 1:
            # There was nothing before.
            settled = changed
        number = self._number_of(goes_on, changed, settled)
        self._places[-1].add(i64(target) << _BITS_OF_WAITS | i64(number))

    def _number_of(self, goes_on: int, changed: int, settled: int) -> int:
        """Return the number of what a step does to what is waited for."""
        if (goes_on, changed, settled) == self._last_waits:
            return self._last_number
        key: Any = goes_on << 2 * _NARROW | changed << _NARROW | settled
        if (goes_on | changed | settled) >> _NARROW:
            key = goes_on, changed, settled
        number = self._known_waits.get(key, -1)
        if number < 0:
            waits = self._graph.waits
            number = self._known_waits[key] = len(waits)
            waits.append((goes_on, changed, settled))
        self._last_waits, self._last_number = (goes_on, changed, settled), number
        return number

    def _leave(self, count: int) -> None:
        """Write down the steps of the middles in hand, of that number."""
        for _ in range(count):
            place = self._places.pop()
            number = self._stepper.middles.add(place.middle)
            self._only = append(self._only, i32(self._write(self._graph.middles, place)))
            self._lead(-1 - number, place.waits)

    def _finish(self, state: bytes) -> None:
        """Write down the steps of the state in hand."""
        self._leave(len(self._places) - 1)
        index = self._source
        only = self._write(self._graph.steps, self._places[0])
        if self._open[index]:
            self._judge_again(index, state, idle=only == index)

    def _count(self) -> None:
        """Count a tick, and report the progress now and then."""
        self._played += 1
        if self._played % _REPORT_EVERY == 0:
            self._tell()

    def _tell(self) -> None:
        """Report the progress; if nobody wants to know more, the graph is not complete."""
        graph = self._graph
        broken = tuple(self._names[rule] for rule in graph.breaches if rule < len(self._names))
        numbers = len(graph.states), graph.expanded, graph.step_count, len(graph.levels) - 1
        if self._report(Progress(*numbers, broken)):
            graph.stopped, graph.complete = True, False

    def _write(self, steps: Steps, place: "_OpenPlace") -> int:
        """Write down the steps of a place; return the only state that they lead to, _SEVERAL if it is not the only one."""
        only: i64 = _NOWHERE
        for step in place.steps:
            target = end = step >> _BITS_OF_WAITS
            if target == _NOWHERE:
                end = _SEVERAL
            else:
                steps.add(i32(target), int(step & _WAITS))
                if target < 0:
                    end = i64(self._only[-1 - target])
            if only not in (_NOWHERE, end):
                end = _SEVERAL
            only = end
        steps.end()
        return int(only)

    def _judge_again(self, index: int, state: bytes, *, idle: bool) -> None:
        """Judge a state again now that all of its ticks are known.

        Whether a state is idle depends on its ticks, and whether a run ends there may depend on that. When the
        state is found its ticks are not known, so it is judged twice. Nothing asks for its end in between: that
        is for `liveness`, after the search.
        """
        graph = self._graph
        judgement = self._stepper.judge(state, idle)
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
        self._open.append(judgement.is_open)
        if judgement.broken:
            self._note_breaches(judgement.broken)
        return number

    def _note_breaches(self, broken: int) -> None:
        """Note that the step in hand breaks rules."""
        for rule in self._new(broken):
            self._graph.breaches[rule] = Breach(self._source, self._stepper.path())
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
            self._graph.error = Breach(self._source, self._stepper.path(), self._stepper.error)


class _OpenPlace:
    """A state or middle whose steps are being found.

    Args:
        middle: The middle.
        waits: What the step to it does to what is waited for.

    Attributes:
        steps: The steps: where each leads, and the number of what it does to what is waited for.
    """

    def __init__(self, middle: bytes, waits: Waits) -> None:
        self.middle = middle
        self.waits = waits
        self.steps = vec[i64]()
        self._many: set[int] | None = None

    def add(self, step: i64) -> None:
        """Add a step, unless it is known."""
        steps = self.steps
        if len(steps) < _FEW:
            for known in steps:
                if known == step:
                    return
        else:
            if self._many is None:
                self._many = {int(known) for known in steps}
            if int(step) in self._many:
                return
            self._many.add(int(step))
        self.steps = append(steps, step)
