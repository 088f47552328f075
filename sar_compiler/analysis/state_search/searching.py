"""Searches the reachable states of a tree, breadth first.

Why breadth first: the first violation that is found takes the minimum number of ticks, so the run that is shown is a
shortest run. States are numbered in the order in which they are found. So the states at the same distance have
consecutive numbers, and the states that are not expanded yet have the highest numbers. The search needs no other queue.

Why a state is expanded completely or not at all: `liveness` assumes that a state without known steps can end, and
relies on the steps of every other state. If steps of a state were missing, a run that ends by a missing step would be
unknown. A loop could then be reported although a run can leave it. So if the limit of states is reached while a state
is expanded, the state's steps are dropped.

Why a violation does not end the search: each property is decided separately, and other properties may hold. Only the
first violation of each property is recorded.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from librt.vecs import append, vec
from mypy_extensions import i32, i64, mypyc_attr

from sar_compiler.analysis.state_search.graph import Breach, Graph, Steps
from sar_compiler.analysis.state_search.numbering import Middles, Numbering
from sar_compiler.analysis.state_search.trail import Waits
from sar_compiler.budget import Progress

# The number of ticks between two progress reports. Each report can stop the search.
_REPORT_EVERY: Final = 256
_WAITS_BITS: Final = 28
_WAITS: Final = (1 << _WAITS_BITS) - 1
"""The bits of a packed step that contain the step's effect on the waits."""
_NO_TARGET: Final = (1 << 31) - 1
"""The target of a step whose tick raises an error."""
_MANY_TARGETS: Final = -1
"""The target of a place from which several states can be reached."""
_LINEAR_LIMIT: Final = 32
"""The number of steps up to which a linear search of a list is faster than a set."""
_PACKED_BITS: Final = 20
"""The maximum number of bits of each number when three numbers are packed into one machine word."""

NOTHING: Final = 0
"""The kind of a step: there are no more steps."""
A_STATE: Final = 1
"""The kind of a step: the step ends a tick."""
A_MIDDLE: Final = 2
"""The kind of a step: the step leads to a known intermediate state."""
A_NEW_MIDDLE: Final = 3
"""The kind of a step: it leads to a new intermediate state. The next steps start there, until `LEFT`."""
LEFT: Final = 4
"""The kind of a step: all steps from some intermediate states were played. Number these states now."""


class Judgement(NamedTuple):
    """The judgement of a state: whether the run is over there, and which rules are violated or pending.

    Attributes:
        ends: Whether the run is over in the state.
        broken: The rules that the state violates, as bits.
        pending: The pending obligations, as bits.
        is_open: Whether the judgement may change when it is known whether the state is idle.
    """

    ends: bool = False
    broken: int = 0
    pending: int = 0
    is_open: bool = False


@mypyc_attr(allow_interpreted_subclasses=True)
class Stepper:
    """Provides the states to search, and the steps between them.

    Attributes:
        state: The state after the last step that ended a tick; None if the tick raised an error.
        waits: The effect of the last step on the waits.
        broken: The rules that the last ended tick violated, as bits.
        error: The error that the last ended tick raised; None if it raised no error.
        middle: The intermediate state to which the last step led.
        left: The number of intermediate states that were left last.
        middles: The intermediate states that were left recently.
    """

    def __init__(self) -> None:
        self.state: bytes | None = None
        self.waits: Waits = (0, 0, 0)
        self.broken = self.left = 0
        self.error: Exception | None = None
        self.middle = b""
        self.middles = Middles()

    def start(self) -> bytes:
        """Return the initial state."""
        raise NotImplementedError

    def enter(self, state: bytes, *, alone: bool = False) -> None:
        """Restore a state to play the steps from it.

        With *alone*, ignore intermediate states found from other states.
        """
        raise NotImplementedError

    def step(self) -> int:
        """Play the next possible step from the restored state, and return the kind of step."""
        raise NotImplementedError

    def judge(self, state: bytes, idle: bool | None) -> Judgement:
        """Determine whether a run is over in a state, and which rules the state violates.

        Args:
            state: The state.
            idle: Whether every step leaves the state unchanged; None if that is not known yet.
        """
        raise NotImplementedError

    def path(self) -> tuple[int, ...]:
        """Return the choices of the last step."""
        raise NotImplementedError


Report = Callable[[Progress], bool | None]
"""A function that receives the progress of a search, and returns True to stop the search."""


def report_nothing(progress: Progress) -> None:
    """Ignore the progress."""


def explore(
    stepper: Stepper,
    max_states: int,
    report: Report = report_nothing,
    names: Sequence[str] = (),
    starts: Sequence[bytes] = (),
) -> Graph:
    """Search all reachable states, breadth first.

    Args:
        stepper: Provides the states and steps.
        max_states: The maximum number of states to find; if there are more, the graph is not complete.
        report: Called with the progress at intervals, and at each violation.
        names: The names of the properties, by rule number.
        starts: The distinct initial states; by default the initial state of the stepper.
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
        # The only state to which each intermediate state leads.
        self._only = vec[i32]()
        # 1 for each state whose judgement may change when it is known whether the state is idle.
        self._open = bytearray()
        self._played = 0
        # The current state and the intermediate states of the tick that were not left yet.
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
        """Find all successors of a state. Stop without storing them if the limit on states is reached."""
        stepper = self._stepper
        self._source = index
        self._places = [_OpenPlace(b"", (0, 0, 0))]
        state = self._graph.states[index]
        stepper.enter(state)
        while True:
            kind = stepper.step()
            if kind == NOTHING:
                break
            if kind == LEFT:
                self._store_intermediate_steps(stepper.left)
                continue
            if not self._process_step(kind):
                return
        self._finish(state)

    def _process_step(self, kind: int) -> bool:
        """Process the current step. Return False if the search must stop."""
        graph, stepper = self._graph, self._stepper
        state, waits, broken = stepper.state, stepper.waits, stepper.broken
        self._count_tick()
        if graph.stopped:
            return False
        if kind == A_NEW_MIDDLE:
            self._places.append(_OpenPlace(stepper.middle, waits))
            return True
        if kind == A_MIDDLE:
            self._record_step(-1 - stepper.middles.find(stepper.middle), waits)
            return True
        target = _NO_TARGET
        if state is None:
            self._record_error()
        else:
            target = self._numbering.find(state)
            if target < 0:
                if len(graph.states) >= self._max_states:
                    graph.complete = False
                    return False
                target = self._add(state)
            if broken:
                self._record_violations(broken)
        self._record_step(target, waits)
        return True

    def _record_step(self, target: int, waits: Waits) -> None:
        """Record a step from the current place.

        Omit the target if this step, or every step after it, raises an error.
        """
        goes_on, changed, settled = waits
        if target >= 0:
            # At the end of a tick, no run waits for leaves and timers that have started in the tick.
            changed = 0
        elif not self._graph.middles.step_count(-1 - target):
            target = _NO_TARGET
        if len(self._places) == 1:
            # This is the first part of the tick, so there is no earlier record.
            settled = changed
        number = self._number_of(goes_on, changed, settled)
        self._places[-1].add(i64(target) << _WAITS_BITS | i64(number))

    def _number_of(self, goes_on: int, changed: int, settled: int) -> int:
        """Return the index in `Graph.waits` of a step's effect on the waits. Add the effect if it is new."""
        if (goes_on, changed, settled) == self._last_waits:
            return self._last_number
        key: Any = goes_on << 2 * _PACKED_BITS | changed << _PACKED_BITS | settled
        if (goes_on | changed | settled) >> _PACKED_BITS:
            key = goes_on, changed, settled
        number = self._known_waits.get(key, -1)
        if number < 0:
            waits = self._graph.waits
            number = self._known_waits[key] = len(waits)
            waits.append((goes_on, changed, settled))
        self._last_waits, self._last_number = (goes_on, changed, settled), number
        return number

    def _store_intermediate_steps(self, count: int) -> None:
        """Store the steps from the last *count* of the current intermediate states."""
        for _ in range(count):
            place = self._places.pop()
            number = self._stepper.middles.add(place.middle)
            self._only = append(self._only, i32(self._write(self._graph.middles, place)))
            self._record_step(-1 - number, place.waits)

    def _finish(self, state: bytes) -> None:
        """Store the steps of the current state."""
        self._store_intermediate_steps(len(self._places) - 1)
        index = self._source
        only = self._write(self._graph.steps, self._places[0])
        if self._open[index]:
            self._judge_again(index, state, idle=only == index)

    def _count_tick(self) -> None:
        """Count a tick, and report the progress at intervals."""
        self._played += 1
        if self._played % _REPORT_EVERY == 0:
            self._report_progress()

    def _report_progress(self) -> None:
        """Report the progress, and stop the search if the receiver requests this."""
        graph = self._graph
        broken = tuple(self._names[rule] for rule in graph.breaches if rule < len(self._names))
        numbers = len(graph.states), graph.expanded_count, graph.step_count, len(graph.levels) - 1
        if self._report(Progress(*numbers, broken)):
            graph.stopped, graph.complete = True, False

    def _write(self, steps: Steps, place: "_OpenPlace") -> int:
        """Store the steps from a place. Return the only state to which they lead, or _MANY_TARGETS."""
        only: i64 = _NO_TARGET
        for step in place.steps:
            target = end = step >> _WAITS_BITS
            if target == _NO_TARGET:
                end = _MANY_TARGETS
            else:
                steps.add(i32(target), int(step & _WAITS))
                if target < 0:
                    end = i64(self._only[-1 - target])
            if only not in (_NO_TARGET, end):
                end = _MANY_TARGETS
            only = end
        steps.finish_place()
        return int(only)

    def _judge_again(self, index: int, state: bytes, *, idle: bool) -> None:
        """Judge a state again when all ticks from this state are known.

        Whether a state is idle depends on its ticks, and whether a run ends in the state may depend on whether it is
        idle. The ticks are not known when the state is found, so the state is judged twice. The first judgement need
        not be final, since `liveness` runs after the search.
        """
        graph = self._graph
        judgement = self._stepper.judge(state, idle)
        graph.ends[index] = judgement.ends
        for rule in self._new_violations(judgement.broken):
            graph.breaches[rule] = Breach(index)
            self._report_progress()

    def _add(self, state: bytes) -> int:
        graph = self._graph
        number = self._numbering.add(state)
        graph.origins = append(graph.origins, i32(self._source))
        judgement = self._stepper.judge(state, None)
        graph.ends.append(judgement.ends)
        graph.pending.append(judgement.pending)
        self._open.append(judgement.is_open)
        if judgement.broken:
            self._record_violations(judgement.broken)
        return number

    def _record_violations(self, broken: int) -> None:
        """Record the rules that the current step is the first to violate."""
        for rule in self._new_violations(broken):
            self._graph.breaches[rule] = Breach(self._source, self._stepper.path())
            self._report_progress()

    def _new_violations(self, broken: int) -> list[int]:
        """Return the numbers of the rules in *broken* that were not violated before."""
        return [
            rule
            for rule in range(broken.bit_length())
            if broken >> rule & 1 and rule not in self._graph.breaches
        ]

    def _record_error(self) -> None:
        if self._graph.error is None:
            self._graph.error = Breach(self._source, self._stepper.path(), self._stepper.error)


class _OpenPlace:
    """A state or intermediate state whose steps are being found.

    Args:
        middle: The intermediate state; empty for a state.
        waits: The effect on the waits of the step that led to the intermediate state.

    Attributes:
        steps: The steps, each packed into one number with its target and its effect on the waits.
    """

    def __init__(self, middle: bytes, waits: Waits) -> None:
        self.middle = middle
        self.waits = waits
        self.steps = vec[i64]()
        self._known: set[int] | None = None

    def add(self, step: i64) -> None:
        """Add a step if it was not added before."""
        steps = self.steps
        if len(steps) < _LINEAR_LIMIT:
            for known in steps:
                if known == step:
                    return
        else:
            if self._known is None:
                self._known = {int(known) for known in steps}
            if int(step) in self._known:
                return
            self._known.add(int(step))
        self.steps = append(steps, step)
