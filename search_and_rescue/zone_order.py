"""Choose the order of searches that minimises the expected time to the first detection.

The cost of an order is Σ over its searches of (time until the search ends) · (probability that it makes the first detection). This equals
Σ over its steps of (time of the step) · (probability of a detection in it or later). So the cost of a step depends only on the set of areas
before it and on the last of them. Dynamic programming over subsets is therefore exact (Held and Karp's, with another cost).

Its time and memory grow as 2^n, those of a beam search as n³, and those of the index rule (probability per second) as n². The
number of areas decides which of them is used. Any number of areas in a parameter file is ordered within 2 s and 200 MB.
"""

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from search_and_rescue.search_theory import TourInputs
from search_and_rescue.zone_manager import VisitingOrder

EXACT_UP_TO = 14
"""Largest number of areas that are ordered exactly; more are ordered by a beam search."""
BEAM_UP_TO = 50
"""Largest number of areas that are ordered by a beam search; more are ordered by the index rule."""

_BEAM_WIDTH = 400
# Each pass visits all areas; after some ten passes hardly any area still moves.
_MOST_PASSES = 20
_FEWEST_FINDS = 1e-9

_Durations = npt.NDArray[np.float64]


def order_areas(order: VisitingOrder, tour: TourInputs) -> list[int]:
    """Return the area indices sorted by a visiting strategy."""
    count = len(tour.finds)
    if order == "listed" or count < 1:
        return list(range(count))
    if order == "nearest":
        return _nearest(tour)
    if count <= EXACT_UP_TO:
        return optimal_order(tour)
    return beam(tour) if count <= BEAM_UP_TO else greedy_index_order(tour)


def approximation(count: int) -> str:
    """Return the name of the approximation for a number of areas; empty for an exact order."""
    if count <= EXACT_UP_TO:
        return ""
    return "a beam search" if count <= BEAM_UP_TO else "probability per second"


def _nearest(tour: TourInputs) -> list[int]:
    left, order = set(range(len(tour.finds))), list[int]()
    while left:
        ways = tour.between[order[-1]] if order else tour.from_start
        order.append(min(left, key=lambda area: (ways[area], area)))
        left.remove(order[-1])
    return order


def optimal_order(tour: TourInputs) -> list[int]:
    """Return the optimal order, by dynamic programming; each additional area doubles time and memory."""
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
            ways = costs[free] + between[:, area] * left[free, None]
            last = ways.argmin(axis=1)
            costs[free | 1 << area, area] = ways[np.arange(len(free)), last]
            before[free | 1 << area, area] = last
    done, order = (1 << count) - 1, [int(costs[-1].argmin())]
    for _ in range(count - 1):
        done, last = done & ~(1 << order[-1]), before[done, order[-1]]
        order.append(int(last))
    return order[::-1]


def beam(tour: TourInputs, width: int = _BEAM_WIDTH) -> list[int]:
    """Return a good order: the best result of a beam search over partial orders, then improved.

    Args:
        tour: The inputs.
        width: Number of partial orders kept of each length.
    """
    start, between, weights = _steps(tour)
    count = len(weights)
    # Lower bound for the rest of an order: the least time of each area, in descending order of probability per second.
    least = np.minimum(start, np.where(np.eye(count, dtype=bool), np.inf, between).min(axis=0))
    ranked = np.argsort(least / weights)
    orders = np.arange(count)[:, None]
    costs, left = start * weights.sum(), weights.sum() - weights
    has = np.eye(count, dtype=bool)
    for _ in range(count - 1):
        ways = costs[:, None] + between[orders[:, -1]] * left[:, None]
        rows, areas = np.nonzero(~has)
        costs, left = ways[rows, areas], left[rows] - weights[areas]
        orders, has = np.column_stack([orders[rows], areas]), has[rows]
        has[np.arange(len(areas)), areas] = True
        open_weights = np.where(has[:, ranked], 0.0, weights[ranked])
        open_times = np.where(has[:, ranked], 0.0, least[ranked]).cumsum(axis=1)
        bounds = costs + (open_weights * open_times).sum(axis=1)
        kept = _best_of_each(np.argsort(bounds, kind="stable"), np.column_stack([has, areas]), costs, width)
        orders, costs, left, has = orders[kept], costs[kept], left[kept], has[kept]
    return _improve_locally(orders[int(costs.argmin())].tolist(), start, between, weights)


def greedy_index_order(tour: TourInputs) -> list[int]:
    """Return a good order of many areas, found by a greedy rule and improved by moves.

    The rule always continues with the area of the highest probability per second of drive and search. It takes O(n²) time. A pass that moves
    areas takes O(n²), too, because prefix sums of weights and times give the cost of a move without another pass over the order.

    Args:
        tour: The inputs.
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
    """Move each area of an order to its best position."""
    for _ in range(_MOST_PASSES):
        before = order
        for area in before:
            at = order.index(area)
            others = np.array(order[:at] + order[at + 1 :], dtype=np.intp)
            # Position k is before others[k]; the last one is after all of them.
            into = np.concatenate([start[[area]], between[others, area]])
            on = np.append(between[area, others], 0.0)
            steps = np.concatenate([start[others[:1]], between[others[:-1], others[1:]]])
            ends = np.concatenate([[0.0], steps.cumsum()])
            after = np.append(weights[others][::-1].cumsum()[::-1], 0.0)
            costs = (ends + into) * weights[area] + (into + on - np.append(steps, 0.0)) * after
            best = int(costs.argmin())
            if costs[best] < costs[at] - _FEWEST_FINDS * abs(costs[at]):
                order = [*others[:best].tolist(), area, *others[best:].tolist()]
        if order == before:
            break
    return order


def _best_of_each(
    ranked: npt.NDArray[np.intp], states: npt.NDArray[np.intp], costs: _Durations, width: int
) -> list[int]:
    """Return the cheapest of equivalent partial orders, which contain the same areas and end at the same one."""
    kept: dict[bytes, int] = {}
    for index in ranked:
        state = states[index].tobytes()
        if state not in kept:
            if len(kept) == width:
                break
            kept[state] = int(index)
        elif costs[index] < costs[kept[state]]:
            kept[state] = int(index)
    return list(kept.values())


def _improve_locally(
    order: list[int], start: _Durations, between: _Durations, weights: _Durations
) -> list[int]:
    """Improve an order until no reversal of a part and no move of an area lowers its cost."""

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
        if cost(best) >= least * (1.0 - _FEWEST_FINDS):
            return order
        order, least = best, cost(best)


def _steps(tour: TourInputs) -> tuple[_Durations, _Durations, _Durations]:
    """Return travel times from the start and between areas (search time included), and detection weights.

    Areas where detection is almost impossible have a small weight, so that the shorter path to them is preferred.
    """
    looks = np.array(tour.looks, dtype=float)
    weights = np.array(tour.finds, dtype=float)
    weights = weights + _FEWEST_FINDS * (weights.sum() or 1.0)
    return np.array(tour.from_start) + looks, np.array(tour.between) + looks, weights
