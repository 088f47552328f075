"""Compute orders of searches that minimise the expected time to the first detection.

The cost of an order is the sum over all searches of (end of the search) · (probability that the search makes the first detection). This equals
the sum over all steps of (duration of the step) · (probability of a detection in this step or later). A step is the drive to an area and the
search of the area. The cost of a step depends only on the previous area and on the set of areas searched before. Dynamic programming over
subsets is therefore exact (the algorithm of Held and Karp, with another cost).

For n areas, time and memory of the dynamic programming grow as 2^n, of a beam search as n³, and of the greedy rule (probability per second)
as n². The number of areas determines the algorithm, so that ordering any valid number of areas takes at most 2 s and 200 MB.
"""

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from search_and_rescue.search_theory import TourInputs
from search_and_rescue.zone_manager import VisitingOrder

EXACT_UP_TO = 14
"""Up to this number of areas, the order is exact. More areas are ordered by a beam search."""
BEAM_UP_TO = 50
"""Up to this number of areas, a beam search finds the order. More areas are ordered by a greedy rule."""

_BEAM_WIDTH = 400
# Maximum number of passes over all areas; after about ten passes, hardly any move still improves the order.
_MAX_PASSES = 20
# Relative cost difference, and share of the total probability, that is regarded as 0.
_NEGLIGIBLE = 1e-9

_Durations = npt.NDArray[np.float64]


def order_areas(order: VisitingOrder, tour: TourInputs) -> list[int]:
    """Return the indices of the areas in the order of visits, according to the rule *order*."""
    count = len(tour.finds)
    if order == "listed" or count < 1:
        return list(range(count))
    if order == "nearest":
        return _nearest(tour)
    if count <= EXACT_UP_TO:
        return optimal_order(tour)
    return beam(tour) if count <= BEAM_UP_TO else greedy_index_order(tour)


def approximation(count: int) -> str:
    """Return the name of the approximation used for *count* areas, or an empty string for an exact order."""
    if count <= EXACT_UP_TO:
        return ""
    return "a beam search" if count <= BEAM_UP_TO else "probability per second"


def _nearest(tour: TourInputs) -> list[int]:
    left, order = set(range(len(tour.finds))), list[int]()
    while left:
        times = tour.between[order[-1]] if order else tour.from_start
        order.append(min(left, key=lambda area: (times[area], area)))
        left.remove(order[-1])
    return order


def optimal_order(tour: TourInputs) -> list[int]:
    """Compute the optimal order by dynamic programming. Each additional area doubles time and memory."""
    start, between, weights = _steps(tour)
    count = len(weights)
    sets = np.arange(1 << count)
    has = (sets[:, None] >> np.arange(count)) & 1
    left = weights.sum() - has @ weights
    sizes = has.sum(axis=1)
    costs = np.full((1 << count, count), np.inf)
    before = np.zeros((1 << count, count), dtype=np.int8)
    costs[1 << np.arange(count), np.arange(count)] = start * weights.sum()
    for size in range(1, count):
        layer = sets[sizes == size]
        for area in range(count):
            free = layer[has[layer, area] == 0]
            extended = costs[free] + between[:, area] * left[free, None]
            last = extended.argmin(axis=1)
            costs[free | 1 << area, area] = extended[np.arange(len(free)), last]
            before[free | 1 << area, area] = last
    done, order = (1 << count) - 1, [int(costs[-1].argmin())]
    for _ in range(count - 1):
        done, last = done & ~(1 << order[-1]), before[done, order[-1]]
        order.append(int(last))
    return order[::-1]


def beam(tour: TourInputs, width: int = _BEAM_WIDTH) -> list[int]:
    """Find a good order by a beam search over partial orders, and improve the order by local search.

    Args:
        tour: Travel times, search durations and probabilities.
        width: Maximum number of partial orders of each length that are extended.
    """
    start, between, weights = _steps(tour)
    count = len(weights)
    # Lower bound for the rest of an order: each area takes its minimum time, in descending order of probability per second.
    least = np.minimum(start, np.where(np.eye(count, dtype=bool), np.inf, between).min(axis=0))
    ranked = np.argsort(least / weights)
    orders = np.arange(count)[:, None]
    costs, left = start * weights.sum(), weights.sum() - weights
    has = np.eye(count, dtype=bool)
    for _ in range(count - 1):
        extended = costs[:, None] + between[orders[:, -1]] * left[:, None]
        rows, areas = np.nonzero(~has)
        costs, left = extended[rows, areas], left[rows] - weights[areas]
        orders, has = np.column_stack([orders[rows], areas]), has[rows]
        has[np.arange(len(areas)), areas] = True
        open_weights = np.where(has[:, ranked], 0.0, weights[ranked])
        open_times = np.where(has[:, ranked], 0.0, least[ranked]).cumsum(axis=1)
        bounds = costs + (open_weights * open_times).sum(axis=1)
        chosen = _best_of_each(np.argsort(bounds, kind="stable"), np.column_stack([has, areas]), costs, width)
        orders, costs, left, has = orders[chosen], costs[chosen], left[chosen], has[chosen]
    return _improve_locally(orders[int(costs.argmin())].tolist(), start, between, weights)


def greedy_index_order(tour: TourInputs) -> list[int]:
    """Find a good order of many areas by a greedy rule, and improve the order by moving single areas.

    The greedy rule continues with the area that has the highest probability per second of drive and search. The rule takes O(n²) time. A pass
    over the moves of all areas also takes O(n²), because prefix sums of weights and times give the cost of each move in constant time.

    Args:
        tour: Travel times, search durations and probabilities.
    """
    start, between, weights = _steps(tour)
    left, order, steps = np.ones(len(weights), dtype=bool), list[int](), start
    for _ in weights:
        with np.errstate(divide="ignore"):
            rates = np.where(left, weights / steps, -1.0)
        order.append(int(rates.argmax()))
        left[order[-1]] = False
        steps = between[order[-1]]
    return _improve_order(order, start, between, weights)


def _improve_order(
    order: list[int], start: _Durations, between: _Durations, weights: _Durations
) -> list[int]:
    """Move each area to its best position, until no move improves the order or the pass limit is reached."""
    for _ in range(_MAX_PASSES):
        before = order
        for area in before:
            at = order.index(area)
            others = np.array(order[:at] + order[at + 1 :], dtype=np.intp)
            # Position k is before others[k], and the last position is after all others.
            into = np.concatenate([start[[area]], between[others, area]])
            on = np.append(between[area, others], 0.0)
            steps = np.concatenate([start[others[:1]], between[others[:-1], others[1:]]])
            ends = np.concatenate([[0.0], steps.cumsum()])
            after = np.append(weights[others][::-1].cumsum()[::-1], 0.0)
            costs = (ends + into) * weights[area] + (into + on - np.append(steps, 0.0)) * after
            best = int(costs.argmin())
            if costs[best] < costs[at] - _NEGLIGIBLE * abs(costs[at]):
                order = [*others[:best].tolist(), area, *others[best:].tolist()]
        if order == before:
            break
    return order


def _best_of_each(
    ranked: npt.NDArray[np.intp], states: npt.NDArray[np.intp], costs: _Durations, width: int
) -> list[int]:
    """Return the indices of the `width` cheapest partial orders.

    Of several orders with the same areas and the same last area, only the cheapest is used.
    """
    best: dict[bytes, int] = {}
    for index in ranked:
        state = states[index].tobytes()
        if state not in best:
            if len(best) == width:
                break
            best[state] = int(index)
        elif costs[index] < costs[best[state]]:
            best[state] = int(index)
    return list(best.values())


def _improve_locally(
    order: list[int], start: _Durations, between: _Durations, weights: _Durations
) -> list[int]:
    """Improve an order until no reversal of a part and no move of an area lowers the cost."""

    def cost(order: Sequence[int]) -> float:
        steps = np.concatenate([start[list(order[:1])], between[list(order[:-1]), list(order[1:])]])
        return float(steps.cumsum() @ weights[list(order)])

    least, count = cost(order), len(order)
    while True:
        changed = [
            change
            for first, last in itertools.combinations(range(count), 2)
            for part in [order[first : last + 1]]
            for other in (part[::-1], [*part[1:], part[0]], [part[-1], *part[:-1]])
            for change in [[*order[:first], *other, *order[last + 1 :]]]
        ]
        best = min(changed, key=cost, default=order)
        if cost(best) >= least * (1.0 - _NEGLIGIBLE):
            return order
        order, least = best, cost(best)


def _steps(tour: TourInputs) -> tuple[_Durations, _Durations, _Durations]:
    """Return the step durations (drive and search) from the start and between areas, and the weight of each area.

    The weight is the probability of detection plus a small constant, so that shorter paths are preferred if detection is impossible.
    """
    looks = np.array(tour.looks, dtype=float)
    weights = np.array(tour.finds, dtype=float)
    weights = weights + _NEGLIGIBLE * (weights.sum() or 1.0)
    return np.array(tour.from_start) + looks, np.array(tour.between) + looks, weights
