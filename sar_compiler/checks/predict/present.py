"""How likely a run that is under way is to succeed, by what its leaves have answered up to now.

The run is followed through the weighed tree, tick by tick: leaves answer there what they have answered, and timers count its seconds. So all that the
tree remembers is known, but for what the leaves that are running have chosen. Of each of these it is known since when it runs, and that its
time was not up until now: what it may have chosen then is left, in proportion. What can become of each of these states is computed as any prediction is.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from sar_compiler.checks.predict.weighed_graph import Between, WeighedGraph, best_chances
from sar_compiler.checks.verify.limits import limits_of, spending_conditions
from sar_compiler.checks.verify.properties import Monitors, PropertyFile, Rules, properties_of
from sar_compiler.checks.verify.state import Prepared
from sar_compiler.checks.verify.stepping import TreeStepper
from sar_compiler.compiler.simulated_tree import SimulatedTree
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.kernel.cells import SUCCESS
from sar_compiler.runtime.kernel.chances import (
    ChanceNode,
    Chances,
    CountedTimes,
    FollowedTick,
    HiddenLeaf,
    Spending,
    WeighedSteps,
)
from sar_compiler.runtime.kernel.numbering import Middles
from sar_compiler.runtime.kernel.searching import Report, explore, keep_quiet
from sar_compiler.runtime.kernel.stub_nodes import Reply

# In so many states a run may be at most; what leaves beside each other may have chosen multiplies.
_MOST_PRESENT = 10_000
_NOTHING = 1e-12
_MOST_ROUNDS = 100


class UnknownChanceError(UndecidableError):
    """The chance of success from some moment on cannot be told."""


class _HiddenChoice(NamedTuple):
    """An answer that a leaf may have chosen: how likely that was, and what may be with it, each with how likely its time was."""

    bounds: tuple[float, float]
    times: "tuple[tuple[float, _Present], ...]"


_Present: TypeAlias = int | tuple[_HiddenChoice, ...]
"""What may be: the number of a state, or what the next leaf may have chosen."""


class PresentChance:
    """The chance of success of one run, from the moment on to which it was followed.

    Args:
        simulated: The tree with stub leaves, whose facts begin as the run does; it is used up.
        file: The properties, with the end of runs and the chances of answers; None for none.
        tags: The tags of leaves that a tree can have.
        period_sec: The time between two ticks, seconds.
        known: The facts of which the run has said how much there is; others that are only lowered are limits. What a condition finds in one tick after
            the other (a mission that is held) takes from these once.

    Raises:
        TreeError: If the file says something that makes no sense for the tree; carries the findings.
        UndecidableError: If the tree's runs cannot be gone through.

    Attributes:
        now: Up to when the run was followed, seconds since it began.
        is_astray: Whether it has done what the tree cannot do by what is assumed of its leaves.
    """

    def __init__(
        self,
        simulated: SimulatedTree,
        file: PropertyFile | None,
        tags: Collection[str],
        period_sec: float,
        known: Collection[str] = (),
    ) -> None:
        prepared = Prepared.of(simulated)
        properties = properties_of(file, prepared, tags)
        # What properties remember decides nothing about success.
        rules = Rules(Monitors(()), {}, properties.rules.ends, (), properties.rules.entries)
        self._chances = Chances(CountedTimes(period_sec))
        stepper = TreeStepper(prepared, rules, chances=self._chances)
        assert isinstance(stepper.steps, WeighedSteps)  # noqa: S101 - it was given chances
        self._steps = stepper.steps
        self._choices = stepper.ticker.choices
        limits = limits_of(simulated, known)
        self._spending = Spending(
            spending_conditions(simulated, limits), [*map(simulated.facts.resolve, sorted(limits))]
        )
        self._names = {leaf.number: leaf.name for leaf in stepper.leaves}
        self._state = self._steps.start()
        self.now = 0.0
        self.is_astray = False

    def take(self, now: float, answers: Sequence[tuple[int, str, str]], root: str) -> None:
        """Take a tick of the run.

        Args:
            now: When it was, seconds since the run began.
            answers: What leaves have answered, in order: the number of each, its status, and the label of the answer, empty where it is not known.
            root: What the root came to; empty if the tick was not finished.

        Raises:
            UndecidableError: If the tree's ticks cannot be known.
        """
        self.now = now
        if self.is_astray:
            return
        after = self._steps.follow(
            self._state, FollowedTick(now, [*answers], root, self._choices, self._spending)
        )
        if after is None:
            self.is_astray = True
        else:
            self._state = after

    def chance(self, max_states: int, report: Report = keep_quiet) -> Between:
        """Return the chance that the run ends with the root SUCCESS.

        Args:
            max_states: How many states to find at most.
            report: Is told now and then how far it is; returns True to have it given up.

        Raises:
            UnknownChanceError: If that cannot be told, with the reason.
            UndecidableError: If the tree's runs cannot be gone through.
        """
        if self.is_astray:
            raise UnknownChanceError("the run has done what by its leaves' declared answers it cannot do")
        states: dict[bytes, int] = {}
        present = self._present(self._steps.hidden(self._state, self.now), (), states)
        least, most = self._values([*states], max_states, report)
        return Between(_valued(present, least, -1), _valued(present, most, 1))

    def _present(
        self,
        hidden: Sequence[HiddenLeaf],
        chosen: tuple[tuple[ChanceNode, Reply, int], ...],
        states: dict[bytes, int],
    ) -> _Present:
        """Return what may be, given what the first leaves have chosen; new states get numbers."""
        if not hidden:
            number = states.setdefault(self._steps.choosing([*chosen]), len(states))
            if number >= _MOST_PRESENT:
                raise UnknownChanceError("too much may be under way")
            return number
        (node, answers), *others = hidden
        if not answers:
            name = self._names[node.index]
            raise UnknownChanceError(f"'{name}' runs longer, or otherwise, than its chances and times say")
        return tuple(
            _HiddenChoice(
                bounds,
                tuple(
                    (share, self._present(others, (*chosen, (node, reply, ticks)), states))
                    for ticks, share in lefts
                ),
            )
            for reply, bounds, lefts in answers
        )

    def _values(
        self, states: Sequence[bytes], max_states: int, report: Report
    ) -> tuple[Sequence[float], Sequence[float]]:
        """Return the least and the greatest chance of success from each of some states."""
        steps = self._steps
        steps.middles = Middles()
        graph = explore(steps, max_states, report, starts=states)
        if not graph.complete:
            raise UnknownChanceError("that would take too long")
        ends = np.frombuffer(bytes(graph.ends), np.uint8).astype(bool)
        succeeded = np.zeros(len(ends), bool)
        for state in np.flatnonzero(ends):
            succeeded[state] = steps.restore(graph.states[int(state)])[0] == SUCCESS
        least, most = WeighedGraph(graph, self._chances).values(succeeded, np.zeros(len(ends), bool))
        return least[: len(states)].tolist(), most[: len(states)].tolist()


def _valued(present: _Present, values: Sequence[float], sign: int) -> float:
    """Return the greatest chance of success of what may be, with a *sign* below 0 the least one.

    Args:
        present: What may be.
        values: The chance of success from each state.
        sign: Which of both.
    """
    if isinstance(present, int):
        return values[present]
    bounds = [possible.bounds for possible in present]
    weights = [sum(share for share, _ in possible.times) for possible in present]
    wholes = [
        sum(share * _valued(inner, values, sign) for share, inner in possible.times) for possible in present
    ]
    means = [whole / weight for whole, weight in zip(wholes, weights, strict=True) if weight > _NOTHING]
    value = min(means) if sign > 0 else max(means)
    # Of a quotient of two sums: the chances are best for the value that they lead to themselves (Dinkelbach).
    for _ in range(_MOST_ROUNDS):
        gains = [sign * (whole - value * weight) for whole, weight in zip(wholes, weights, strict=True)]
        likely = best_chances(bounds, gains)
        weight = sum(p * each for p, each in zip(likely, weights, strict=True))
        better = sum(p * each for p, each in zip(likely, wholes, strict=True)) / weight if weight else value
        if abs(better - value) <= _NOTHING:
            break
        value = better
    return value
