"""Predicts the runs of a tree: the probabilities, the times and the most influential leaves.

The tree's states are searched as for a proof, with the known probabilities and times of leaves
(`state_search.probabilities`). The graph of states gives a system of linear equations (`weighed_graph`).
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from sar_compiler.analysis.merging import MergedValues
from sar_compiler.analysis.predict.weighed_graph import Flags, ProbabilityBounds, ProbabilityGraph
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.graph import Graph
from sar_compiler.analysis.state_search.probabilities import ChoiceTable, CountedTimes
from sar_compiler.analysis.state_search.searching import Judgement
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.analysis.verify.properties import (
    InapplicableProperty,
    MonitorSet,
    Properties,
    PropertyAutomata,
    PropertyFile,
    properties_of,
)
from sar_compiler.analysis.verify.slicing import merge_values
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.analysis.verify.unknown_values import explore_decidable, search_decidable
from sar_compiler.analysis.verify.verdicts import AN_END
from sar_compiler.budget import Budget, Progress
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.values import MILLISECONDS, SECONDS
from sar_compiler.runtime.kernel.cells import SUCCESS, WORDS

_USUAL = WORDS[SUCCESS]
_ROUNDING = 1e-9
_ANYTHING = ProbabilityBounds(0.0, 1.0)
_SECONDS = {SECONDS.name: 1.0, MILLISECONDS.name: 1e-3}
_MOST_TICKS = 2_000_000


@dataclass(frozen=True)
class Influence:
    """The influence of a leaf on the success probability of a tree.

    Attributes:
        leaf: The path of the leaf.
        derivative: The increase of the success probability per increase of the probability of the leaf's first
            outcome with SUCCESS, if the other outcomes keep their proportions. 0.3 means 0.3 percentage points per
            percentage point.
        if_never_failed: The success probability if the leaf always had this outcome.
    """

    leaf: tuple[str, ...]
    derivative: float
    if_never_failed: float


@dataclass(frozen=True)
class Prediction:
    """The predicted results of a tree's runs. Uncertain numbers are given as a lower and an upper bound.

    Attributes:
        success: The probability that a run ends with the root SUCCESS.
        ends: The probability that a run ends.
        properties: The probability that each property holds, by property name.
        time_sec: The expected duration of the runs that end, in seconds; None if the duration is unknown,
            or if no run ends. If probabilities are unknown, the bounds are the durations for which success is least and most probable.
        success_sec: The expected duration of the runs that succeed, like `time_sec`.
        distribution: The times at which runs end, in seconds. Each has the probabilities that a run has succeeded and
            that it has ended by this time. Empty if the computation would be too large. In the distribution and in
            `influences`, unknown probabilities are set to the middle of their bounds.
        influences: The influential leaves, most influential first.
        unknown: The paths of the leaves without any known probability.
        states: The number of states that were found.
        steps: The number of steps between the states.
        complete: Whether all states were explored; the behaviour after unexplored states is unknown.
        stopped: Whether the search or the computation was stopped; numbers that were not computed have the bounds 0
            and 1.
        left_out: The properties that do not apply to the tree.
        undecided: The reasons why runs or conditions are undecided. Each of these needs an unknown value.
            The bounds of probabilities hold for all unknown values. Times, distribution and influences are missing.
        merged: The keys and facts whose values were merged, because no run can distinguish them.
    """

    success: ProbabilityBounds
    ends: ProbabilityBounds
    properties: Mapping[str, ProbabilityBounds]
    time_sec: ProbabilityBounds | None
    success_sec: ProbabilityBounds | None
    distribution: tuple[tuple[float, float, float], ...]
    influences: tuple[Influence, ...]
    unknown: tuple[tuple[str, ...], ...]
    states: int
    steps: int
    complete: bool
    stopped: bool = False
    left_out: tuple[InapplicableProperty, ...] = ()
    undecided: tuple[str, ...] = ()
    merged: tuple[MergedValues, ...] = ()

    def quantile(self, share: float) -> float | None:
        """Return the time in seconds by which a share of the ending runs has ended; None if it is unknown."""
        whole = self.distribution[-1][2] if self.distribution else 0.0
        return next((sec for sec, _, ended in self.distribution if ended >= share * whole - _ROUNDING), None)


def predict(
    simulated: SimulatedTree,
    file: PropertyFile | None,
    tags: Collection[str],
    period_sec: float,
    max_states: int,
    budget: Budget | None = None,
    *,
    merges: bool = True,
) -> Prediction:
    """Predict the results of a tree's runs.

    Args:
        simulated: The tree with stub leaves; not usable afterwards.
        file: The properties file; None for no properties.
        tags: The tags of all leaves that a tree may contain.
        period_sec: The time between two ticks, in seconds.
        max_states: The maximum number of states to find; the behaviour after unexplored states is unknown.
        budget: Receives the progress and intermediate results, and can end the search.
        merges: Whether to merge values that no run can distinguish (`verify.slicing`).

    Raises:
        TreeError: If the properties file contradicts the tree; contains the findings.
        UndecidableError: If the tree's runs cannot be searched, or a tick raises an error for another reason than an
            unknown value.
    """
    _require_few_ticks(simulated, period_sec)
    prepared = PreparedTree.prepare(simulated)
    properties = properties_of(file, prepared, tags)
    if merges:
        merge_values(prepared, properties)
    search = partial(
        _predict_searched,
        prepared=prepared,
        period_sec=period_sec,
        max_states=max_states,
        budget=budget or Budget(),
    )
    found, reasons = search_decidable(properties, search)
    if AN_END in reasons:
        found = replace(found, success=_ANYTHING, ends=_ANYTHING)
    bounds = {name: found.properties.get(name, _ANYTHING) for name in properties.names}
    undecided = tuple(dict.fromkeys((*found.undecided, *reasons.values())))
    return replace(found, properties=bounds, undecided=undecided)


def _predict_searched(
    properties: Properties, *, prepared: PreparedTree, period_sec: float, max_states: int, budget: Budget
) -> Prediction:
    """Predict the results of a tree's runs. Raise a `ConditionError` if a condition cannot be evaluated."""
    simulated, probabilities = prepared.simulated, ChoiceTable(CountedTimes(period_sec))
    stepper = TreeStepper(prepared, _breach_automata(properties.rules), probabilities=probabilities)
    nothing = _unknown_prediction(properties)

    def report(progress: Progress) -> bool:
        budget.publish(partial(replace, nothing, states=progress.states, steps=progress.steps))
        return budget.report(progress)

    budget.publish(lambda: nothing)
    graph, unknown = explore_decidable(stepper, max_states, report)
    _require_no_error(graph, simulated)
    nothing = replace(
        nothing,
        states=len(graph.states),
        steps=graph.step_count,
        complete=graph.complete,
        stopped=graph.stopped,
        undecided=() if unknown is None or unknown.error is None else (simulated.explain(unknown.error),),
        merged=tuple(each for each in prepared.merged if each.is_used),
    )
    budget.publish(partial(replace, nothing, stopped=True))
    return _PredictionSolver(stepper, graph, probabilities, properties, period_sec).prediction(
        nothing, budget
    )


def _require_few_ticks(simulated: SimulatedTree, period_sec: float) -> None:
    """Raise an error if a duration takes too many ticks, because the search has a state for each remaining tick.

    Raises:
        UndecidableError: If a duration takes too many ticks.
    """
    for name, seconds in _times(simulated):
        if seconds / period_sec > _MOST_TICKS:
            period = _round_up(seconds / _MOST_TICKS)
            raise UndecidableError(
                f"'{name}' takes {seconds:g} s, which is {seconds / period_sec:.3g} ticks. At most {_MOST_TICKS:,} ticks are supported. "
                f"Use a longer tick period: --period {period}"
            )


def _require_no_error(graph: Graph, simulated: SimulatedTree) -> None:
    """Raise an error if a tick raises an error, because the behaviour after that tick is unknown.

    Raises:
        UndecidableError: If a tick raises an error.
    """
    if graph.error is not None and graph.error.error is not None:
        raise UndecidableError(
            f"a tick raises an error: {simulated.explain(graph.error.error)} (show the run with: sar-compile verify)"
        )


def _round_up(seconds: float) -> str:
    """Format a number of seconds, rounded up to two significant digits, for a command-line option."""
    digits = 1 - math.floor(math.log10(seconds))
    return f"{math.ceil(seconds * 10.0**digits) / 10.0**digits:g}"


def _times(simulated: SimulatedTree) -> Iterator[tuple[str, float]]:
    """Yield the constant durations and time limits of nodes, each as a node name and a time in seconds."""
    for behaviour in simulated.root.iterate():
        if isinstance(behaviour, StubLeaf):
            yield from ((behaviour.name, outcome.sec[1]) for outcome in behaviour.outcomes)
            continue
        bound = simulated.compiled.origins[behaviour.id].bound
        for name, parameter in bound.spec.parameters.items():
            value = bound.value(name)
            if isinstance(value, int | float) and parameter.value_type.name in _SECONDS:
                yield bound.name, value * _SECONDS[parameter.value_type.name]


def _unknown_prediction(properties: Properties) -> Prediction:
    return Prediction(
        success=_ANYTHING,
        ends=_ANYTHING,
        properties=dict.fromkeys(properties.names, _ANYTHING),
        time_sec=None,
        success_sec=None,
        distribution=(),
        influences=(),
        unknown=(),
        states=0,
        steps=0,
        complete=False,
        stopped=True,
        left_out=properties.left_out,
    )


class _ViolationMonitors(MonitorSet):
    """Property monitors whose state also contains one bit for each violated property.

    Args:
        monitors: The wrapped monitors.
    """

    def __init__(self, monitors: MonitorSet) -> None:
        super().__init__(())
        self._inner = monitors

    @property
    def count(self) -> int:
        return self._inner.count

    @property
    def relevant_events(self) -> set[int]:
        return self._inner.relevant_events

    def next_state(self, state: int, event: int) -> tuple[int, int]:
        before, broken = self.parts(state)
        after, now = self._inner.next_state(before, event)
        # A violated property has no further state.
        return (after & ~(broken | now)) | (broken | now) << self.count, 0

    def parts(self, state: int) -> tuple[int, int]:
        """Split a state into the state of the wrapped monitors and the bit set of violated properties."""
        return state & (1 << self.count) - 1, state >> self.count

    def pending_monitors(self, state: int) -> int:
        return self._inner.pending_monitors(self.parts(state)[0])


def _breach_automata(rules: PropertyAutomata) -> PropertyAutomata:
    return PropertyAutomata(
        _ViolationMonitors(rules.monitors), rules.guarded, rules.ends, rules.at_end, rules.entries
    )


class _PredictionSolver:
    """Computes a prediction from the graph of states."""

    def __init__(
        self,
        stepper: TreeStepper,
        graph: Graph,
        probabilities: ChoiceTable,
        properties: Properties,
        period_sec: float,
    ) -> None:
        self._stepper, self._graph, self._probabilities = stepper, graph, probabilities
        self._properties, self._period_sec = properties, period_sec
        self._weighed = ProbabilityGraph(graph, probabilities)
        count = len(graph.states)
        self._ends = np.frombuffer(bytes(graph.ends), np.uint8).astype(bool)
        self._open = ~self._ends & (np.arange(count) >= graph.expanded_count)
        self._succeeded = np.zeros(count, bool)
        self._broken = np.zeros((count, properties.rules.count), bool)
        for state in range(count) if properties.names else np.flatnonzero(self._ends):
            self._classify_state(int(state))

    def _classify_state(self, state: int) -> None:
        """Determine which properties were violated on the way to a state, and whether the run succeeds there."""
        steps, code = self._stepper.steps, self._graph.states[state]
        outcome, watched = steps.restore(code)
        broken = watched >> self._properties.rules.monitors.count
        if self._ends[state]:
            self._succeeded[state] = outcome == SUCCESS
            broken |= _end_judgement(steps, code).broken
        for rule in range(self._properties.rules.count):
            self._broken[state, rule] = broken >> rule & 1

    def prediction(self, found: Prediction, budget: Budget) -> Prediction:
        """Compute all numbers of the prediction.

        Args:
            found: The initial prediction, in which all numbers are unknown.
            budget: Receives intermediate results.
        """
        weighed, unknown = self._weighed, self._open
        parts: list[tuple[str, Callable[[], Any]]] = [
            ("unknown", self._unknown_leaves),
            ("success", lambda: weighed.bounds(self._succeeded, unknown)),
            ("ends", lambda: weighed.bounds(self._ends, unknown)),
            ("properties", self._property_probabilities),
        ]
        if not found.undecided:
            parts += [
                ("time_sec", lambda: self._time_sec(self._ends)),
                ("success_sec", lambda: self._time_sec(self._succeeded)),
                ("influences", self._influences),
                ("distribution", partial(self._distribution, budget)),
            ]
        for name, work_out in parts:
            found = replace(found, **{name: work_out()})
            budget.publish(partial(replace, found, stopped=True))
        return found

    def _property_probabilities(self) -> Mapping[str, ProbabilityBounds]:
        return {name: self._property_bounds(rule) for rule, name in enumerate(self._properties.names)}

    def _distribution(self, budget: Budget) -> tuple[tuple[float, float, float], ...]:
        if not self._graph.complete:
            return ()
        moments = self._weighed.ends(self._ends, self._succeeded, budget.is_spent)
        return tuple((self._seconds(each.tick), each.succeeded, each.ended) for each in moments or ())

    def _property_bounds(self, rule: int) -> ProbabilityBounds:
        """Return the bounds of the probability that a property holds.

        An obligation must be met before a run ends.
        """
        broken, unknown = self._broken[:, rule], self._open
        if rule in self._properties.owing:
            return self._weighed.bounds(self._ends & ~broken, unknown)
        low, high = self._weighed.bounds(broken, unknown)
        return ProbabilityBounds(1.0 - high, 1.0 - low)

    def _time_sec(self, which: Flags) -> ProbabilityBounds | None:
        ticks = self._weighed.ticks(which, self._succeeded) if self._graph.complete else None
        return None if ticks is None else ProbabilityBounds(*map(self._seconds, ticks))

    def _seconds(self, ticks: float) -> float:
        """Convert the number of a tick to seconds since the first tick."""
        return (ticks - 1) * self._period_sec

    def _influences(self) -> tuple[Influence, ...]:
        leaves = {leaf.number: leaf for leaf in self._stepper.leaves}
        usual = [
            next((place for place, outcome in enumerate(choice.outcomes) if outcome.status == _USUAL), -1)
            for choice in self._probabilities.choices
        ]
        found = [
            Influence(leaves[number].path, derivative, never)
            for number, derivative, never in self._weighed.influences(self._succeeded, usual)
        ]
        return tuple(sorted(found, key=lambda each: -abs(each.derivative)))

    def _unknown_leaves(self) -> tuple[tuple[str, ...], ...]:
        """Return the paths of the leaves that have a choice without known probabilities."""
        open_ = {
            choice.leaf
            for choice in self._probabilities.choices
            if len(choice.outcomes) > 1 and all(outcome.p is None for outcome in choice.outcomes)
        }
        return tuple(leaf.path for leaf in self._stepper.leaves if leaf.number in open_)


def _end_judgement(steps: TickSteps, code: bytes) -> Judgement:
    """Return the judgement of a final state. If the run has not ended otherwise, the tree counts as idle."""
    judgement = steps.judge(code, None)
    if not judgement.ends:
        return steps.judge(code, idle=True)
    return steps.judge(code, idle=False) if judgement.is_open else judgement
