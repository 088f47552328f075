"""The graph of a tree's runs with the probability of each step, and the quantities computed from the graph.

A *place* is a state, or an intermediate state of ticks (`state_search.forking`) in which a leaf has several outcomes.
If all probabilities are known, the places form a Markov chain. The probabilities of reaching a set of states from each
place are then the solution of x = A x + b, after the places without a path to these states were removed. Otherwise A
would have the eigenvalue 1, and the solution would not be unique.

If probabilities are only known within bounds, or unknown, the places form a Markov decision process, in which the
probabilities can be chosen at each place and each time. The bounds of a result are its extremes over all choices. They
are found by improving a choice of probabilities until there is no better choice (policy iteration). Two details make
this correct. For the maximum probability, the first choice gives every possible outcome a positive probability, so that
every place with a path to the goal reaches the goal. For the minimum probability, the places from which the goal can be
avoided forever are removed. Their minimum probability is 0, but the equations alone would not find it, since they hold
for every value on a loop that a run need not leave.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph
from scipy.sparse.linalg import splu

from sar_compiler.analysis.state_search.graph import Graph
from sar_compiler.analysis.state_search.probabilities import ChoiceTable
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.outcomes import middle

Flags: TypeAlias = npt.NDArray[Any]
Indices: TypeAlias = npt.NDArray[Any]
Reals: TypeAlias = npt.NDArray[Any]
"""NumPy arrays of bool, int64 and float64, each with one element for every place or for every step."""

_MOST_ROUNDS = 100
# The number of rounds of `_improve` that are faster than a pass in Python.
_FEW_ROUNDS = 5
_ROUNDING = 1e-9
# The distribution of end times is computed until the remaining probability is below this value, and the number of
# computed steps is limited to about two seconds.
_REST = 1e-6
_MOST_CARRIED = 20_000_000
_STEPS_OF_A_ROUND = 400


class ProbabilityBounds(NamedTuple):
    """The lower and the upper bound of a number.

    Attributes:
        low: The lower bound.
        high: The upper bound.
    """

    low: float
    high: float


class EndTick(NamedTuple):
    """A tick in which runs can end.

    Attributes:
        tick: The number of the tick, from 0.
        succeeded: The probability that a run has succeeded by this tick.
        ended: The probability that a run has ended by this tick.
    """

    tick: int
    succeeded: float
    ended: float


class ProbabilityGraph:
    """The graph of states that a search has found, with the probability of each step.

    The graph has no steps for ticks that need an unknown value. Steps with the missing probability are added for them.

    Args:
        graph: The states and steps; `going_on` of a step's waits contains the number of a weight.
        probabilities: The choices and weights.
    """

    def __init__(self, graph: Graph, probabilities: ChoiceTable) -> None:
        # The last place stands for all unknown places.
        self._states, self._count = len(graph.states), graph.places + 1
        self._choices = probabilities.choices
        steps = _steps_of(graph)
        labels = np.array([waits[0] for waits in graph.waits] or [0])[steps[2]]
        weights = np.array(probabilities.weights)[np.maximum(labels, 0)]
        outcomes, shares = weights[:, 1].astype(np.int64), weights[:, 2]
        # The last row is for places without a choice.
        self._low, self._high, self._middle = _probability_tables([choice.bounds for choice in self._choices])
        self._choice_at = np.full(self._count, -1)
        self._choice_at[steps[0]] = weights[:, 0]
        source, outcome, share = self._unknown_steps(graph, steps[0], outcomes, shares)
        order = np.argsort(np.concatenate([steps[0], source]), kind="stable")
        self._source = np.concatenate([steps[0], source])[order]
        self._target = np.concatenate([steps[1], np.full(len(source), self._count - 1)])[order]
        self._outcome, self._share = (
            np.concatenate([outcomes, outcome])[order],
            np.concatenate([shares, share])[order],
        )
        # A step without a weight only takes time; a step to an intermediate state does not end its tick.
        ticks = np.where(labels < 0, -labels, 1) * (steps[1] < self._states)
        self._ticks = np.concatenate([ticks, np.zeros(len(source), ticks.dtype)])[order]
        wide = self._low < self._high
        self._varying = np.flatnonzero(np.any(wide[self._choice_at], axis=1))

    def _unknown_steps(
        self, graph: Graph, source: Indices, outcomes: Indices, shares: Reals
    ) -> tuple[Indices, Indices, Reals]:
        """Return states and outcomes after which ticks may need an unknown value, and the share of such ticks."""
        width = self._low.shape[1]
        followed = np.bincount(source * width + outcomes, shares, self._count * width).reshape(-1, width)
        missing = (self._high[self._choice_at] > 0.0) * (1.0 - followed)
        ends = self._place_flags(np.frombuffer(bytes(graph.ends), np.uint8).astype(bool))
        ends[graph.expanded_count : self._states] = ends[-1] = True
        missing[ends] = 0.0
        places, found = np.nonzero(missing > _ROUNDING)
        return places, found, missing[places, found]

    def bounds(self, goal: Flags, unknown: Flags) -> ProbabilityBounds:
        """Return the bounds of the probability that a run reaches a set of states.

        Args:
            goal: For each state, whether it is in the set.
            unknown: For each state, whether the behaviour after it is unknown.
        """
        possible = self._place_flags(goal | unknown)
        possible[-1] = True
        least, most = self._optimum(self._place_flags(goal), -1)[0], self._optimum(possible, 1)[0]
        return ProbabilityBounds(float(least[0]), float(most[0]))

    def _place_flags(self, states: Flags) -> Flags:
        """Extend an array with a flag for each state to all places. The additional places get the flag False."""
        return np.concatenate([states, np.zeros(self._count - self._states, bool)])

    def _optimum(self, goal: Flags, sign: int) -> tuple[Reals, Reals]:
        """Return the optimal probability of reaching a goal from each place, and the outcome probabilities.

        The optimum is the maximum if *sign* is positive, and the minimum if it is negative.

        Raises:
            UndecidableError: If the iteration does not converge. Intermediate results are not always bounds.
        """
        probabilities = self._interior_probabilities()
        excluded = (
            self._avoiding_places(goal) if sign < 0 and len(self._varying) else np.zeros(self._count, bool)
        )
        values = self._reach(goal, probabilities, excluded)
        for turn in range(_MOST_ROUNDS):
            better = self._improve(values, probabilities, sign) if len(self._varying) else None
            if better is None:
                return values, probabilities
            probabilities = (
                better if turn != _FEW_ROUNDS else self._initial_policy(goal | excluded, values, sign)
            )
            values = self._reach(goal, probabilities, excluded)
        raise UndecidableError(f"the bounds of a probability did not converge in {_MOST_ROUNDS} rounds")

    def _interior_probabilities(self) -> Reals:
        """Return outcome probabilities for each place, in the middle of their bounds and positive if possible."""
        probabilities: Reals = self._middle[self._choice_at]
        return probabilities

    def _initial_policy(self, given: Flags, values: Reals, sign: int) -> Reals:
        """Compute probabilities in one backward pass. They are optimal if the graph has no loops.

        For a graph with loops, these probabilities are a good starting point. `_improve` alone would need as
        many rounds as the longest path.

        Args:
            given: For each place, whether its value is known.
            values: The values of the places, for probabilities within their bounds.
            sign: Positive to maximise the values, negative to minimise them.
        """
        count, width = len(values), self._low.shape[1]
        matrix = sparse.csr_matrix(
            (np.ones(len(self._source), np.int8), (self._source, self._target)), (count, count)
        )
        _, parts = csgraph.connected_components(matrix, connection="strong")
        probabilities = self._interior_probabilities()
        first = np.searchsorted(self._source, np.arange(count + 1)).tolist()
        target, outcome, share = (each.tolist() for each in (self._target, self._outcome, self._share))
        known, varies = values.tolist(), np.isin(np.arange(count), self._varying).tolist()
        # The components are numbered in reverse topological order.
        order = np.argsort(parts, kind="stable")
        for place in order[~given[order]].tolist():
            worth = [0.0] * width
            for step in range(first[place], first[place + 1]):
                worth[outcome[step]] += share[step] * known[target[step]]
            if varies[place]:
                choice = self._choice_at[place]
                bounds = [*zip(self._low[choice].tolist(), self._high[choice].tolist(), strict=True)]
                probabilities[place] = best_probabilities(bounds, [sign * each for each in worth])
            known[place] = float(probabilities[place] @ worth)
        return probabilities

    def _improve(self, values: Reals, probabilities: Reals, sign: int) -> Reals | None:
        """Return better outcome probabilities for the places where these vary, or None if there are none."""
        places = self._varying
        worth = self._outcome_values(values)[places]
        low, high = self._low[self._choice_at[places]], self._high[self._choice_at[places]]
        better, left = low.copy(), 1.0 - low.sum(axis=1)
        rows = np.arange(len(places))
        for outcomes in np.argsort(-sign * worth, axis=1, kind="stable").T:
            more = np.minimum(left, (high - low)[rows, outcomes])
            better[rows, outcomes] += more
            left -= more
        gain = sign * ((better - probabilities[places]) * worth).sum(axis=1)
        if not (gain > _ROUNDING).any():
            return None
        found = probabilities.copy()
        found[places[gain > _ROUNDING]] = better[gain > _ROUNDING]
        return found

    def _outcome_values(self, values: Reals) -> Reals:
        """Return the expected value after each outcome of each place."""
        width = self._low.shape[1]
        worth = np.bincount(
            self._source * width + self._outcome, self._share * values[self._target], self._count * width
        )
        return worth.reshape(-1, width)

    def _reach(self, goal: Flags, probabilities: Reals, excluded: Flags) -> Reals:
        """Return the probability of reaching a goal from each place."""
        return self._equations(goal, probabilities, excluded).reach(goal)

    def _equations(self, goal: Flags, probabilities: Reals, excluded: Flags) -> "_Equations":
        likely = self._share * probabilities[self._source, self._outcome]
        likely[goal[self._source] | excluded[self._source]] = 0.0
        reaching = self._predecessors(goal, likely > 0.0) & ~goal
        return _Equations(self._source, self._target, likely, reaching)

    def _predecessors(self, goal: Flags, used: Flags) -> Flags:
        """Return a flag for each place: whether a path leads from the place to a goal."""
        count = self._count
        first = np.flatnonzero(goal)
        rows = np.concatenate([self._target[used], np.full(len(first), count)])
        columns = np.concatenate([self._source[used], first])
        matrix = sparse.csr_matrix((np.ones(len(rows), np.int8), (rows, columns)), (count + 1, count + 1))
        found = np.zeros(count + 1, bool)
        found[csgraph.breadth_first_order(matrix, count, return_predecessors=False)] = True
        before: Flags = found[:count]
        return before

    def _avoiding_places(self, goal: Flags) -> Flags:
        """Return a flag for each place: whether a run from the place can avoid the goal forever."""
        width = self._low.shape[1]
        avoiding = ~goal
        order = np.argsort(self._target, kind="stable")
        ends = np.cumsum(np.bincount(self._target, minlength=self._count))
        sources, outcomes = self._source[order], self._outcome[order]
        # For each place, the outcomes whose steps all avoid the goal. A place avoids the goal if their total probability can be 1.
        safe = np.ones((self._count, width), bool)
        waiting = deque(np.flatnonzero(goal))
        while waiting:
            place = waiting.popleft()
            before = slice(ends[place - 1] if place else 0, ends[place])
            for source, outcome in zip(sources[before].tolist(), outcomes[before].tolist(), strict=True):
                safe[source, outcome] = False
                choice = self._choice_at[source]
                if avoiding[source] and (self._high[choice] * safe[source]).sum() < 1.0 - _ROUNDING:
                    avoiding[source] = False
                    waiting.append(source)
        return avoiding

    def ticks(self, goal: Flags, best_for: Flags) -> ProbabilityBounds | None:
        """Return the bounds of the expected number of ticks until a goal is reached, or None if none is reached.

        Args:
            goal: For each state, whether it is a goal.
            best_for: The states that the chosen unknown probabilities make least and most probable.
        """
        found = [
            self._expected_value(self._place_flags(goal), probabilities)
            for probabilities in self._extremes(best_for)
        ]
        known = [each for each in found if each is not None]
        return ProbabilityBounds(min(known), max(known)) if known else None

    def _extremes(self, goal: Flags) -> list[Reals]:
        """Return the outcome probabilities that minimise and maximise the probability of reaching a goal."""
        signs = (-1, 1) if len(self._varying) else (1,)
        return [self._optimum(self._place_flags(goal), sign)[1] for sign in signs]

    def _expected_value(self, goal: Flags, probabilities: Reals) -> float | None:
        equations = self._equations(goal, probabilities, np.zeros(self._count, bool))
        reached = equations.reach(goal)
        ticks = np.zeros(self._count)
        ticks[equations.places] = equations.solve(equations.mean(self._ticks * reached[self._target]))
        return float(ticks[0] / reached[0]) if reached[0] > 0.0 else None

    def influences(self, goal: Flags, usual: Sequence[int]) -> Iterator[tuple[int, float, float]]:
        """Yield each influential leaf, a derivative, and the goal's probability if the leaf never failed.

        The derivative is the derivative of the goal's probability with respect to the probability of the leaf's usual
        outcome, if the leaf's other outcomes keep their proportions. Unknown probabilities are set to the middle of
        their bounds.

        Args:
            goal: For each state, whether it is a goal.
            usual: The index of the usual outcome of each choice; -1 for none.
        """
        wide, probabilities = self._place_flags(goal), self._interior_probabilities()
        nothing = np.zeros(self._count, bool)
        equations = self._equations(wide, probabilities, nothing)
        reached = equations.reach(wide)
        if not reached[0]:
            return
        visits = equations.visits()
        worth = self._outcome_values(reached)
        leaves = np.array([choice.leaf for choice in self._choices] + [-1])[self._choice_at]
        usual_at = np.array([*usual, -1])[self._choice_at]
        for leaf in dict.fromkeys(choice.leaf for choice in self._choices):
            places = np.flatnonzero((leaves == leaf) & (usual_at >= 0) & (visits > 0.0))
            outcome = usual_at[places]
            others = 1.0 - probabilities[places, outcome]
            open_ = others > _ROUNDING
            if not open_.any():
                continue
            places, outcome, others = places[open_], outcome[open_], others[open_]
            best = worth[places, outcome]
            rest = (probabilities[places] * worth[places]).sum(axis=1) - probabilities[places, outcome] * best
            always = probabilities.copy()
            always[places] = 0.0
            always[places, outcome] = 1.0
            slope = float((visits[places] * (best - rest / others)).sum())
            yield leaf, slope, float(self._reach(wide, always, nothing)[0])

    def ends(
        self, ends: Flags, goal: Flags, is_spent: Callable[[], bool] = lambda: False
    ) -> list[EndTick] | None:
        """Return the distribution of the ticks in which runs end, or None if the computation is stopped.

        Args:
            ends: For each state, whether runs end in it.
            goal: For each state, whether runs have succeeded in it.
            is_spent: Returns whether the computation must stop.
        """
        likely = self._share * self._interior_probabilities()[self._source, self._outcome]
        # A run that can no longer end is not followed, because that would take forever.
        can_end = self._predecessors(self._place_flags(ends), likely > 0.0)
        likely[~can_end[self._target]] = 0.0
        first = np.concatenate([[0], np.cumsum(np.bincount(self._source, minlength=self._count))])
        found, total, good, carried = [], 0.0, 0.0, 0
        # The probability that a run has not ended yet but can still end.
        left = float(can_end[0])
        moments: dict[int, list[tuple[Indices, Reals]]] = {0: [(np.array([0]), np.array([1.0]))]}
        while moments and left > _REST:
            tick = min(moments)
            places, mass = _sum_by_place(moments.pop(tick))
            over = ends[places]
            if over.any():
                total += float(mass[over].sum())
                left -= float(mass[over].sum())
                good += float(mass[over & goal[places]].sum())
                found.append(EndTick(tick, good, total))
            places, mass = places[~over], mass[~over]
            while len(places):
                steps, counts = _ranges(first[places], first[places + 1])
                # The NumPy calls of a round take as long as computing this number of steps.
                carried += len(steps) + _STEPS_OF_A_ROUND
                if carried > _MOST_CARRIED or is_spent():
                    return None
                moved = np.repeat(mass, counts) * likely[steps]
                left -= float(mass.sum() - moved.sum())
                steps, moved = steps[moved > 0.0], moved[moved > 0.0]
                to, taken = self._target[steps], self._ticks[steps]
                ended = to < self._states
                for ticks in np.unique(taken[ended]):
                    now = ended & (taken == ticks)
                    moments.setdefault(tick + int(ticks), []).append((to[now], moved[now]))
                places, mass = _sum_by_place([(to[~ended], moved[~ended])])
        return found


class _Equations:
    """The system of linear equations for the places from which a path leads to a goal.

    Args:
        source: The source of each step.
        target: The target of each step.
        likely: The probability of each step.
        reaching: For each place, whether it has a path to the goal.
    """

    def __init__(self, source: Indices, target: Indices, likely: Reals, reaching: Flags) -> None:
        self._source, self._target, self._likely, self._count = source, target, likely, len(reaching)
        self.places = np.flatnonzero(reaching)
        number = np.cumsum(reaching) - 1
        inside = reaching[source] & reaching[target] & (likely > 0.0)
        size = len(self.places)
        matrix = sparse.csc_matrix(
            (likely[inside], (number[source[inside]], number[target[inside]])), (size, size)
        )
        self._solver = splu(sparse.identity(size, format="csc") - matrix) if size else None

    def mean(self, values: Reals) -> Reals:
        """Return for each place the mean value of the place's steps, weighted by the steps' probabilities."""
        return np.bincount(self._source, self._likely * values, self._count)[self.places]

    def solve(self, known: Reals) -> Reals:
        """Solve the equation x = A x + *known*. The solution x has one value for each place."""
        return self._solver.solve(known) if self._solver else known

    def reach(self, goal: Flags) -> Reals:
        """Return the probability of reaching the goal from each place."""
        values = goal.astype(float)
        values[self.places] = self.solve(self.mean(values[self._target]))
        return values

    def visits(self) -> Reals:
        """Return the expected number of visits of each place."""
        visits = np.zeros(self._count)
        begin = (self.places == 0).astype(float)
        visits[self.places] = self._solver.solve(begin, "T") if self._solver else begin
        return visits


def _steps_of(graph: Graph) -> tuple[Indices, Indices, Indices]:
    """Return three arrays: the source of each step, its target, and the index of its waits."""
    sources, targets, waits = [], [], []
    for steps, first in ((graph.steps, 0), (graph.middles, len(graph.states))):
        counts = [int(steps.step_count(place)) for place in range(len(steps))]
        sources.append(np.repeat(np.arange(first, first + len(steps)), counts))
        targets += list(steps.targets)
        waits += [steps.waits[step] for step in range(len(steps.targets))]
    target = np.array(targets, np.int64)
    return (
        np.concatenate(sources),
        np.where(target >= 0, target, len(graph.states) - 1 - target),
        np.array(waits, np.int64),
    )


def _probability_tables(bounds: Sequence[Sequence[tuple[float, float]]]) -> tuple[Reals, Reals, Reals]:
    """Return the minimum, maximum and middle probability of each outcome of each choice."""
    shape = len(bounds) + 1, max(map(len, bounds), default=1)
    low, high, between = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for number, outcomes in enumerate([*bounds, [(1.0, 1.0)]]):
        place = number, slice(len(outcomes))
        low[place], high[place] = zip(*outcomes, strict=True)
        between[place] = middle(outcomes)
    return low, high, between


def best_probabilities(bounds: Sequence[tuple[float, float]], gains: Sequence[float]) -> list[float]:
    """Return the probabilities that maximise the total gain. They are within bounds, and their sum is 1."""
    likely = [low for low, _ in bounds]
    left = 1.0 - sum(likely)
    for place in sorted(range(len(gains)), key=lambda each: -gains[each]):
        more = min(left, bounds[place][1] - bounds[place][0])
        likely[place] += more
        left -= more
    return likely


def _sum_by_place(parts: Sequence[tuple[Indices, Reals]]) -> tuple[Indices, Reals]:
    """Return the distinct places, and for each of these places the sum of the place's values."""
    places, inverse = np.unique(np.concatenate([each[0] for each in parts]), return_inverse=True)
    return places, np.bincount(inverse, np.concatenate([each[1] for each in parts]), len(places))


def _ranges(begins: Indices, ends: Indices) -> tuple[Indices, Indices]:
    """Return an array with the numbers of all ranges in order, and an array with the lengths."""
    counts = ends - begins
    before = np.concatenate([[0], np.cumsum(counts)[:-1]])
    return np.arange(counts.sum()) + np.repeat(begins - before, counts), counts
