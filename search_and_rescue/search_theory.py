"""Terms and formulas of search theory: the probability of a person's location, and of detection by searches.

POA is the probability that a person is in an area, POD the probability that a search there detects them, POS the probability of success.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

ROUNDING = 1e-9
"""Tolerance above 1 for a sum of probabilities."""
SWEEP_FACTORS = {"high": 1.8, "medium": 1.6, "low": 1.1}
"""Ratio of sweep width to detection range, by visibility (Koester et al., Wilderness & Environmental Medicine 25, 2014)."""
COVERAGE = 0.9
"""The default coverage of a sweep: the number of times each position is covered by the sweep width."""

Corners = tuple[tuple[float, float], ...]


class Ground(NamedTuple):
    """The ground of a zone that is swept.

    Attributes:
        polygon: Its corners in the frame `map`, metres.
        sweep_width: Width of the swath within which as many survivors are missed as are detected outside it (W), metres.
        detection_range: Distance up to which a survivor can be seen, metres.
    """

    polygon: Corners
    sweep_width: float
    detection_range: float

    @property
    def area_m2(self) -> float:
        """The area, square metres."""
        sides = itertools.pairwise((*self.polygon, *self.polygon[:1]))
        return abs(math.fsum(ax * by - bx * ay for (ax, ay), (bx, by) in sides)) / 2.0

    def sweep_sec(self, speed_mps: float) -> float:
        """Return the duration of a sweep's legs at the default coverage, seconds, without turns and stops."""
        return self.area_m2 * COVERAGE / (self.sweep_width * speed_mps)


def sweep_width_of(detection_range: float, visibility: str = "medium") -> float:
    """Return the sweep width W of a detection range, both in metres."""
    return SWEEP_FACTORS[visibility] * detection_range


def random_search_pod(coverage: float) -> float:
    """Return the POD of a random search, a lower bound: 1 - exp(-C) (Koopman 1946)."""
    return -math.expm1(-coverage)


def parallel_sweep_pod(coverage: float) -> float:
    """Return the POD of accurately kept parallel legs, by the inverse-cube law of detection: erf(√π / 2 · C) (Koopman 1946)."""
    return math.erf(math.sqrt(math.pi) / 2.0 * coverage)


class SearchExpectation(NamedTuple):
    """Expectations of a search in an area.

    Attributes:
        poa: Probability that the missing person is there, before the first search, 0 to 1.
        pod: Probability that a search detects a person who is there, 0 to 1.
        look_sec: Duration of a search, seconds.
    """

    poa: float
    pod: float
    look_sec: float = 0.0


@dataclass(frozen=True)
class PoaMap:
    """Probabilities of a missing person's location, given searches without a detection.

    The areas' remainder to 1 is the probability of all other locations, which are never searched.

    Args:
        poa: Probability of each area before the first search, 0 to 1; at most 1 in sum.
        pod: Probability that a search of each area detects a person who is there, 0 to 1.
        looks: Number of searches of an area; 0 for areas that are not named.
        swept: Probability that the sweeps of an area detected a person who is there, 0 to 1; 0 for areas that are not named.

    Raises:
        ValueError: If a value is no probability, the areas sum above 1, or an area has no `pod`.
    """

    poa: Mapping[str, float]
    pod: Mapping[str, float]
    looks: Mapping[str, int]
    swept: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for area, value in (*self.poa.items(), *self.pod.items()):
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"{area} has the probability {value:g}: write a number from 0 to 1")
        if lacking := sorted(set(self.poa) - set(self.pod)):
            raise ValueError(f"{lacking[0]} has no POD: write the probability of detection by a search")
        total = math.fsum(self.poa.values())
        if total > 1.0 + ROUNDING:
            raise ValueError(f"the areas' POA sum to {total:g}: the sum must be at most 1")

    @classmethod
    def from_areas(
        cls,
        areas: Mapping[str, SearchExpectation],
        looks: Mapping[str, int],
        swept: Mapping[str, float] | None = None,
        hints: Mapping[str, float] | None = None,
    ) -> "PoaMap":
        """Return the map of areas after searches, sweeps and hints.

        Args:
            areas: The initial expectations.
            looks: Number of searches of each area.
            swept: Probability that the sweeps of each area detected a person who is there.
            hints: Likelihood ratio of all hints on an area: presence over absence; 1 for other areas and for other locations.
        """
        weights = {name: area.poa * (hints or {}).get(name, 1.0) for name, area in areas.items()}
        total = max(0.0, 1.0 - math.fsum(area.poa for area in areas.values())) + math.fsum(weights.values())
        poa = {name: weight / total if hints and total else weight for name, weight in weights.items()}
        return cls(poa, {name: area.pod for name, area in areas.items()}, looks, swept or {})

    def missed_probability(self, area: str) -> float:
        """Return the probability that all searches and sweeps of an area missed a person there: (1 - POD) for each search, and for its sweeps."""
        return (1.0 - self.pod[area]) ** self.looks.get(area, 0) * (1.0 - self.swept.get(area, 0.0))

    def current_probabilities(self) -> dict[str, float]:
        """Return the current probability of each area by Bayes' rule; 0 everywhere if every location is ruled out."""
        left = {area: poa * self.missed_probability(area) for area, poa in self.poa.items()}
        elsewhere = max(0.0, 1.0 - math.fsum(self.poa.values()))
        total = elsewhere + math.fsum(left.values())
        return {area: value / total if total else 0.0 for area, value in left.items()}

    def pos(self) -> float:
        """Return the prior probability that the searches so far detect a person: Σ POA · (1 - Π(1 - POD))."""
        return math.fsum(poa * (1.0 - self.missed_probability(area)) for area, poa in self.poa.items())


@dataclass(frozen=True, eq=False)
class TourInputs:
    """Inputs for choosing an order of areas.

    Args:
        from_start: Travel time from the robot to each area, seconds.
        between: Travel time from each area (row) to each other (column), seconds.
        looks: Duration of a search of each area, seconds.
        finds: Probability of a detection by the search of each area: POA · POD.
    """

    from_start: Sequence[float]
    between: "Sequence[Sequence[float]] | npt.NDArray[np.float64]"
    looks: Sequence[float]
    finds: Sequence[float]

    def ends(self, order: Sequence[int]) -> list[float]:
        """Return the end of each search in an order, seconds from now."""
        steps = [self.from_start[order[0]]] if order else []
        steps += [float(self.between[before][after]) for before, after in itertools.pairwise(order)]
        return list(
            itertools.accumulate(step + self.looks[area] for step, area in zip(steps, order, strict=True))
        )

    def expected_find(self, order: Sequence[int]) -> float:
        """Return the expected time to the first detection in an order, given that there is one, seconds; 0 if detection is impossible."""
        pos = sum(self.finds[area] for area in order)
        cost = sum(end * self.finds[area] for end, area in zip(self.ends(order), order, strict=True))
        return cost / pos if pos else 0.0
