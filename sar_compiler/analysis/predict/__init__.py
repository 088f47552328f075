"""How likely a tree is to succeed, and to keep its properties, how long it takes, and which leaf matters most: computed, not played.

The tree's states are searched as for a proof, with leaves whose chances and times are known (`kernel.probabilities`); what comes of them is a
system of linear equations (`weighed_graph`).
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from sar_compiler.analysis.merging import MergedValues
from sar_compiler.analysis.predict.weighed_graph import Between, Flags, WeighedGraph
from sar_compiler.analysis.simulated_tree import SimulatedTree
from sar_compiler.analysis.state_search.graph import Graph
from sar_compiler.analysis.state_search.probabilities import ChoiceTable, CountedTimes
from sar_compiler.analysis.state_search.searching import Judgement
from sar_compiler.analysis.state_search.tick_steps import TickSteps
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.analysis.verify.properties import (
    LeftOut,
    Monitors,
    Properties,
    PropertyAutomata,
    PropertyFile,
    properties_of,
)
from sar_compiler.analysis.verify.slicing import merge_values
from sar_compiler.analysis.verify.state import Prepared
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.analysis.verify.unknown_values import explored, search_decidable
from sar_compiler.analysis.verify.verdicts import AN_END
from sar_compiler.budget import Budget, Progress
from sar_compiler.errors import UndecidableError
from sar_compiler.nodes.values import MILLISECONDS, SECONDS
from sar_compiler.runtime.kernel.cells import SUCCESS, WORDS

_USUAL = WORDS[SUCCESS]
_ROUNDING = 1e-9
_ANYTHING = Between(0.0, 1.0)
_SECONDS = {SECONDS.name: 1.0, MILLISECONDS.name: 1e-3}
_MOST_TICKS = 2_000_000


@dataclass(frozen=True)
class Influence:
    """How much a leaf matters.

    Attributes:
        leaf: Its path.
        derivative: By how much the chance of success grows with that of the leaf's first answer that is SUCCESS, where its others keep their
            proportions: 0.3 are 0.3 points for each point.
        if_never_failed: The chance of success if the leaf always gave that answer.
    """

    leaf: tuple[str, ...]
    derivative: float
    if_never_failed: float


@dataclass(frozen=True)
class Prediction:
    """What is to be expected of a tree's runs. A number that is not known exactly is between its bounds.

    Attributes:
        success: The chance that a run ends with the root SUCCESS.
        ends: The chance that a run ends.
        properties: The chance that each property is kept, by its name.
        time_sec: The expected time of the runs that end, seconds; None if that is not known, or none does. Where chances are not
            known, from the one to the other of the times with which success is least and most likely.
        success_sec: The same of those that succeed.
        distribution: The times at which runs end, seconds, with the chance that one has ended well by then, and that it has ended; empty
            where there would be too much to go through. Here, and for the influences, chances that are not known are in the middle.
        influences: The leaves that matter, most first.
        unknown: The paths of the leaves of which no chance is known.
        states: How many states were found.
        steps: How many steps there are between them.
        complete: Whether all states were gone through; what is behind the others may be anything.
        stopped: Whether it was stopped before that, or before all numbers were worked out: those that are missing have the bounds 0 and 1.
        left_out: The properties that say nothing about this tree.
        undecided: The reasons for which some runs were not followed, or some conditions not evaluated, because they need unknown values.
            Chances have bounds that are right whatever these values are; times, the distribution and the influences are not computed.
        merged: The keys and facts of which not all values were distinguished, since no run can tell them apart.
    """

    success: Between
    ends: Between
    properties: Mapping[str, Between]
    time_sec: Between | None
    success_sec: Between | None
    distribution: tuple[tuple[float, float, float], ...]
    influences: tuple[Influence, ...]
    unknown: tuple[tuple[str, ...], ...]
    states: int
    steps: int
    complete: bool
    stopped: bool = False
    left_out: tuple[LeftOut, ...] = ()
    undecided: tuple[str, ...] = ()
    merged: tuple[MergedValues, ...] = ()

    def quantile(self, share: float) -> float | None:
        """Return the time by which this share of the runs that end has ended, seconds; None if that is not known."""
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
    """Return what is to be expected of a tree's runs.

    Args:
        simulated: The tree with stub leaves; it is used up.
        file: The properties, and the chances of answers; None for none.
        tags: The tags of leaves that a tree can have.
        period_sec: The time between two ticks, seconds.
        max_states: How many states to find at most; what is behind the others may be anything.
        budget: Is told now and then how far it is; ends the search. What is known by then is published in it.
        merges: Whether values are one that no run can tell apart (`verify.slicing`).

    Raises:
        TreeError: If the file says something that makes no sense for the tree; carries the findings.
        UndecidableError: If the tree's runs cannot be gone through, or a tick of one raises an error for another reason than an unknown value.
    """
    _require_few_ticks(simulated, period_sec)
    prepared = Prepared.of(simulated)
    properties = properties_of(file, prepared, tags)
    if merges:
        merge_values(prepared, properties)
    search = partial(
        _predicted, prepared=prepared, period_sec=period_sec, max_states=max_states, budget=budget or Budget()
    )
    found, reasons = search_decidable(properties, search)
    if AN_END in reasons:
        found = replace(found, success=_ANYTHING, ends=_ANYTHING)
    kept = {name: found.properties.get(name, _ANYTHING) for name in properties.names}
    undecided = tuple(dict.fromkeys((*found.undecided, *reasons.values())))
    return replace(found, properties=kept, undecided=undecided)


def _predicted(
    properties: Properties, *, prepared: Prepared, period_sec: float, max_states: int, budget: Budget
) -> Prediction:
    """Return what is to be expected of a tree's runs; raises `ConditionError` as well."""
    simulated, probabilities = prepared.simulated, ChoiceTable(CountedTimes(period_sec))
    stepper = TreeStepper(prepared, _remembering(properties.rules), probabilities=probabilities)
    nothing = _nothing_known(properties)

    def report(progress: Progress) -> bool:
        budget.publish(partial(replace, nothing, states=progress.states, steps=progress.steps))
        return budget.report(progress)

    budget.publish(lambda: nothing)
    graph, unknown = explored(stepper, max_states, report)
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
    return _Reckoning(stepper, graph, probabilities, properties, period_sec).prediction(nothing, budget)


def _require_few_ticks(simulated: SimulatedTree, period_sec: float) -> None:
    """Require that every time takes few ticks: the search counts them, and keeps each number that it has come to.

    Raises:
        UndecidableError: If a time takes too many.
    """
    for name, seconds in _times(simulated):
        if seconds / period_sec > _MOST_TICKS:
            period = _rounded_up(seconds / _MOST_TICKS)
            raise UndecidableError(
                f"'{name}' takes {seconds:g} s, which is {seconds / period_sec:.3g} ticks; the most are {_MOST_TICKS:,}. "
                f"Let ticks be further apart: --period {period}"
            )


def _require_no_error(graph: Graph, simulated: SimulatedTree) -> None:
    """Require that no tick raises: nothing is known of what comes after it.

    Raises:
        UndecidableError: If one does.
    """
    if graph.error is not None and graph.error.error is not None:
        raise UndecidableError(
            f"a tick raises an error: {simulated.explain(graph.error.error)} (`sar-compile verify` shows the run)"
        )


def _rounded_up(seconds: float) -> str:
    """Return a number of seconds, rounded up to two digits, as an option takes it."""
    digits = 1 - math.floor(math.log10(seconds))
    return f"{math.ceil(seconds * 10.0**digits) / 10.0**digits:g}"


def _times(simulated: SimulatedTree) -> Iterator[tuple[str, float]]:
    """Yield the nodes that wait, each with how long it may, seconds; what is known only while the tree runs is left out."""
    for behaviour in simulated.root.iterate():
        if isinstance(behaviour, StubLeaf):
            yield from ((behaviour.name, answer.sec[1]) for answer in behaviour.answers)
            continue
        bound = simulated.compiled.origins[behaviour.id].bound
        for name, parameter in bound.spec.parameters.items():
            value = bound.value(name)
            if isinstance(value, int | float) and parameter.value_type.name in _SECONDS:
                yield bound.name, value * _SECONDS[parameter.value_type.name]


def _nothing_known(properties: Properties) -> Prediction:
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


class _BreachMonitors(Monitors):
    """Monitors that remember which of them were broken: a bit for each, above those of what the others remember.

    Args:
        monitors: The others.
    """

    def __init__(self, monitors: Monitors) -> None:
        super().__init__(())
        self._inner = monitors

    @property
    def count(self) -> int:
        return self._inner.count

    @property
    def heard(self) -> set[int]:
        return self._inner.heard

    def after(self, state: int, event: int) -> tuple[int, int]:
        before, broken = self.parts(state)
        after, now = self._inner.after(before, event)
        # What is broken has nothing more to remember.
        return (after & ~(broken | now)) | (broken | now) << self.count, 0

    def parts(self, state: int) -> tuple[int, int]:
        """Return what the monitors remember in a state, and which were broken."""
        return state & (1 << self.count) - 1, state >> self.count

    def owed(self, state: int) -> int:
        return self._inner.owed(self.parts(state)[0])


def _remembering(rules: PropertyAutomata) -> PropertyAutomata:
    return PropertyAutomata(
        _BreachMonitors(rules.monitors), rules.guarded, rules.ends, rules.at_end, rules.entries
    )


class _Reckoning:
    """Reckons what is to be expected, from the states that were found."""

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
        self._weighed = WeighedGraph(graph, probabilities)
        count = len(graph.states)
        self._ends = np.frombuffer(bytes(graph.ends), np.uint8).astype(bool)
        self._open = ~self._ends & (np.arange(count) >= graph.expanded)
        self._succeeded = np.zeros(count, bool)
        self._broken = np.zeros((count, properties.rules.count), bool)
        for state in range(count) if properties.names else np.flatnonzero(self._ends):
            self._look_at(int(state))

    def _look_at(self, state: int) -> None:
        """Find out which properties are broken in a state, and whether a run has succeeded in it."""
        steps, code = self._stepper.steps, self._graph.states[state]
        outcome, watched = steps.restore(code)
        broken = watched >> self._properties.rules.monitors.count
        if self._ends[state]:
            self._succeeded[state] = outcome == SUCCESS
            broken |= _judged(steps, code).broken
        for rule in range(self._properties.rules.count):
            self._broken[state, rule] = broken >> rule & 1

    def prediction(self, found: Prediction, budget: Budget) -> Prediction:
        """Return what is to be expected.

        Args:
            found: What is known before: of each number, that it may be anything.
            budget: What has been worked out is published in it.
        """
        weighed, unknown = self._weighed, self._open
        parts: list[tuple[str, Callable[[], Any]]] = [
            ("unknown", self._unknown),
            ("success", lambda: weighed.bounds(self._succeeded, unknown)),
            ("ends", lambda: weighed.bounds(self._ends, unknown)),
            ("properties", self._properties_kept),
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

    def _properties_kept(self) -> Mapping[str, Between]:
        return {name: self._kept(rule) for rule, name in enumerate(self._properties.names)}

    def _distribution(self, budget: Budget) -> tuple[tuple[float, float, float], ...]:
        if not self._graph.complete:
            return ()
        moments = self._weighed.ends(self._ends, self._succeeded, budget.is_spent)
        return tuple((self._seconds(each.tick), each.succeeded, each.ended) for each in moments or ())

    def _kept(self, rule: int) -> Between:
        """Return the chance that a property is kept; one that owes something is only where a run ends and it has come."""
        broken, unknown = self._broken[:, rule], self._open
        if rule in self._properties.owing:
            return self._weighed.bounds(self._ends & ~broken, unknown)
        low, high = self._weighed.bounds(broken, unknown)
        return Between(1.0 - high, 1.0 - low)

    def _time_sec(self, which: Flags) -> Between | None:
        ticks = self._weighed.ticks(which, self._succeeded) if self._graph.complete else None
        return None if ticks is None else Between(*map(self._seconds, ticks))

    def _seconds(self, ticks: float) -> float:
        """Return when a tick is, seconds from the first one."""
        return (ticks - 1) * self._period_sec

    def _influences(self) -> tuple[Influence, ...]:
        leaves = {leaf.number: leaf for leaf in self._stepper.leaves}
        usual = [
            next((place for place, answer in enumerate(choice.answers) if answer.status == _USUAL), -1)
            for choice in self._probabilities.choices
        ]
        found = [
            Influence(leaves[number].path, derivative, never)
            for number, derivative, never in self._weighed.influences(self._succeeded, usual)
        ]
        return tuple(sorted(found, key=lambda each: -abs(each.derivative)))

    def _unknown(self) -> tuple[tuple[str, ...], ...]:
        """Return the paths of the leaves that have a choice of which nothing is known."""
        open_ = {
            choice.leaf
            for choice in self._probabilities.choices
            if len(choice.answers) > 1 and all(answer.p is None for answer in choice.answers)
        }
        return tuple(leaf.path for leaf in self._stepper.leaves if leaf.number in open_)


def _judged(steps: TickSteps, code: bytes) -> Judgement:
    """Return the judgement of a state in which a run ends, perhaps because it idles."""
    judgement = steps.judge(code, None)
    if not judgement.ends:
        return steps.judge(code, idle=True)
    return steps.judge(code, idle=False) if judgement.is_open else judgement
