"""Terms and formulas of search theory.

- POA (probability of area): the probability that the missing person is in an area.
- POD (probability of detection): the probability that a search of the person's area detects the person.
- POS (probability of success): the probability that the searches detect the person.
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
"""A sum of probabilities may exceed 1 by this tolerance."""
SWEEP_FACTORS = {"high": 1.8, "medium": 1.6, "low": 1.1}
"""The ratio of sweep width to detection range, by visibility of the person (Koester et al., Wilderness & Environmental Medicine 25, 2014)."""
COVERAGE = 0.9
"""The default coverage of a sweep. Coverage is sweep width times track length, divided by the area of the ground."""

Corners = tuple[tuple[float, float], ...]


class Ground(NamedTuple):
    """The polygon of a zone that can be swept, and the ranges of the sensor in this zone.

    Attributes:
        polygon: The corners of the polygon in the frame `map`, metres.
        sweep_width: The sweep width W, metres: as many survivors are missed within a swath of this width as are detected outside the swath.
        detection_range: Maximum distance at which a survivor can be detected, metres.
    """

    polygon: Corners
    sweep_width: float
    detection_range: float

    @property
    def area_m2(self) -> float:
        """The area of the polygon, square metres."""
        sides = itertools.pairwise((*self.polygon, *self.polygon[:1]))
        return abs(math.fsum(ax * by - bx * ay for (ax, ay), (bx, by) in sides)) / 2.0

    def sweep_sec(self, speed_mps: float) -> float:
        """Return the duration in seconds of a sweep at the default coverage, without turns and stops."""
        return self.area_m2 * COVERAGE / (self.sweep_width * speed_mps)


def sweep_width_of(detection_range: float, visibility: str = "medium") -> float:
    """Return the sweep width W in metres for a detection range in metres."""
    return SWEEP_FACTORS[visibility] * detection_range


def random_search_pod(coverage: float) -> float:
    """Return the POD of a random search with coverage C: 1 - exp(-C). It is a lower bound (Koopman 1946)."""
    return -math.expm1(-coverage)


def parallel_sweep_pod(coverage: float) -> float:
    """Return the POD of exact parallel legs with coverage C by the inverse-cube law: erf(√π / 2 · C) (Koopman 1946)."""
    return math.erf(math.sqrt(math.pi) / 2.0 * coverage)


class SearchExpectation(NamedTuple):
    """The expected result of a search of an area: probabilities and duration.

    Attributes:
        poa: Probability that the missing person is in the area, before the first search, 0 to 1.
        pod: Probability that a search of the area detects a person in the area, 0 to 1.
        look_sec: Duration of a search, seconds.
    """

    poa: float
    pod: float
    look_sec: float = 0.0


@dataclass(frozen=True)
class PoaMap:
    """The probability that a missing person is in each area, given that the searches so far did not detect the person.

    If the probabilities of the areas sum to less than 1, the rest is the probability of all other locations, which are never searched.

    Args:
        poa: Probability that the person is in each area before the first search, 0 to 1. The sum is at most 1.
        pod: Probability that a search of each area detects a person in the area, 0 to 1.
        looks: Number of searches of each area; 0 for areas that are not listed.
        swept: Probability that the sweeps of each area have detected a person in the area, 0 to 1; 0 for areas that are not listed.

    Raises:
        ValueError: If a value is not a probability, the POA of the areas sum to more than 1, or an area has no `pod`.
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
            raise ValueError(f"the POA values of all areas add up to {total:g}: the sum must be at most 1")

    @classmethod
    def from_areas(
        cls,
        areas: Mapping[str, SearchExpectation],
        looks: Mapping[str, int],
        swept: Mapping[str, float] | None = None,
        hints: Mapping[str, float] | None = None,
    ) -> "PoaMap":
        """Create the map of probabilities from the initial probabilities, searches, sweeps and hints.

        Args:
            areas: The probabilities of each area before the first search and hint.
            looks: Number of searches of each area; 0 for areas that are not listed.
            swept: Probability that the sweeps of each area have detected a person in the area; 0 for areas that are not listed.
            hints: Likelihood ratio (presence to absence) of all hints on each area; 1 for areas that are not listed.
        """
        weights = {name: area.poa * (hints or {}).get(name, 1.0) for name, area in areas.items()}
        total = max(0.0, 1.0 - math.fsum(area.poa for area in areas.values())) + math.fsum(weights.values())
        poa = {name: weight / total if hints and total else weight for name, weight in weights.items()}
        return cls(poa, {name: area.pod for name, area in areas.items()}, looks, swept or {})

    def missed_probability(self, area: str) -> float:
        """Return the probability that all searches and sweeps of an area have missed a person in the area."""
        return (1.0 - self.pod[area]) ** self.looks.get(area, 0) * (1.0 - self.swept.get(area, 0.0))

    def current_probabilities(self) -> dict[str, float]:
        """Return the current probability of each area by Bayes' rule. If no location is possible, all are 0."""
        left = {area: poa * self.missed_probability(area) for area, poa in self.poa.items()}
        elsewhere = max(0.0, 1.0 - math.fsum(self.poa.values()))
        total = elsewhere + math.fsum(left.values())
        return {area: value / total if total else 0.0 for area, value in left.items()}

    def pos(self) -> float:
        """Return the POS of all searches so far: Σ POA · (1 - Π(1 - POD)), with the initial POA of each area."""
        return math.fsum(poa * (1.0 - self.missed_probability(area)) for area, poa in self.poa.items())


@dataclass(frozen=True, eq=False)
class TourInputs:
    """The inputs for choosing the order in which areas are searched.

    Args:
        from_start: Travel time from the start of the tour to each area, seconds.
        between: Travel time from each area (row) to each area (column), seconds.
        looks: Duration of a search of each area, seconds.
        finds: Probability that the search of each area detects the person: POA · POD.
    """

    from_start: Sequence[float]
    between: "Sequence[Sequence[float]] | npt.NDArray[np.float64]"
    looks: Sequence[float]
    finds: Sequence[float]

    def ends(self, order: Sequence[int]) -> list[float]:
        """Return when each search ends if the areas are searched in an order, in seconds from the start."""
        steps = [self.from_start[order[0]]] if order else []
        steps += [float(self.between[before][after]) for before, after in itertools.pairwise(order)]
        return list(
            itertools.accumulate(step + self.looks[area] for step, area in zip(steps, order, strict=True))
        )

    def expected_find(self, order: Sequence[int]) -> float:
        """Return the expected time in seconds to the first detection; 0 if no detection is possible."""
        pos = sum(self.finds[area] for area in order)
        cost = sum(end * self.finds[area] for end, area in zip(self.ends(order), order, strict=True))
        return cost / pos if pos else 0.0
