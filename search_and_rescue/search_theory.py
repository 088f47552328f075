"""Where somebody who is missing may be, and how well it was looked: the words and formulas of search theory.

POA is how likely somebody is in an area, POD how likely a look there finds who is there, POS how likely a search succeeds.
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
"""How much above 1 a sum of probabilities may be."""
SWEEP_FACTORS = {"high": 1.8, "medium": 1.6, "low": 1.1}
"""How many times the detection range the sweep width is, by visibility (Koester et al., Wilderness & Environmental Medicine 25, 2014)."""
COVERAGE = 0.9
"""Of a sweep for which nothing else is said: how often each place is covered by the sweep width."""

Corners = tuple[tuple[float, float], ...]


class Ground(NamedTuple):
    """The ground of a zone, where a sweep goes.

    Attributes:
        polygon: Its outline: corners in the frame `map`, metres.
        sweep_width: How wide a swath is in which as many are missed as are found outside it (W), metres.
        detection_range: How far a survivor can be seen, metres.
    """

    polygon: Corners
    sweep_width: float
    detection_range: float

    @property
    def area_m2(self) -> float:
        """How large it is, square metres."""
        sides = itertools.pairwise((*self.polygon, *self.polygon[:1]))
        return abs(math.fsum(ax * by - bx * ay for (ax, ay), (bx, by) in sides)) / 2.0

    def sweep_sec(self, speed_mps: float) -> float:
        """Return how long the legs of a sweep take at the usual coverage, without turns and what is done at stops: seconds."""
        return self.area_m2 * COVERAGE / (self.sweep_width * speed_mps)


def sweep_width_of(detection_range: float, visibility: str = "medium") -> float:
    """Return the sweep width W of a detection range, both in metres."""
    return SWEEP_FACTORS[visibility] * detection_range


def pod_at_random(coverage: float) -> float:
    """Return the POD of a search without any order, a lower bound: 1 - exp(-C) (Koopman 1946)."""
    return -math.expm1(-coverage)


def pod_of_parallel_sweep(coverage: float) -> float:
    """Return the POD where parallel legs are kept, by the inverse-cube law of detection: erf(√π / 2 · C) (Koopman 1946)."""
    return math.erf(math.sqrt(math.pi) / 2.0 * coverage)


class Area(NamedTuple):
    """What is expected of a look in an area.

    Attributes:
        poa: How likely somebody who is missing is there, before the first look, 0 to 1.
        pod: How likely a look there finds who is there, 0 to 1.
        look_sec: How long a look takes, seconds.
    """

    poa: float
    pod: float
    look_sec: float = 0.0


@dataclass(frozen=True)
class PoaMap:
    """Where somebody who is missing may be, after looks that did not find this one.

    What the areas leave of 1 is the rest of the world, where nobody looks.

    Args:
        poa: How likely each area was before the first look, 0 to 1; 1 at most in sum.
        pod: How likely a look in each area finds who is there, 0 to 1.
        looks: How often it was looked in an area; areas that are not named, never.
        swept: How likely the sweeps of an area have found who is there, 0 to 1; areas that are not named were not swept.

    Raises:
        ValueError: If something is no probability, the areas sum above 1, or an area has no `pod`.
    """

    poa: Mapping[str, float]
    pod: Mapping[str, float]
    looks: Mapping[str, int]
    swept: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for area, value in (*self.poa.items(), *self.pod.items()):
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"{area} has the probability {value:g}; write one from 0 to 1")
        if lacking := sorted(set(self.poa) - set(self.pod)):
            raise ValueError(f"{lacking[0]} has no POD; write how likely a look there finds who is there")
        total = math.fsum(self.poa.values())
        if total > 1.0 + ROUNDING:
            raise ValueError(f"the areas' POA sum to {total:g}; they can be 1 at most")

    @classmethod
    def of(
        cls,
        areas: Mapping[str, Area],
        looks: Mapping[str, int],
        swept: Mapping[str, float] | None = None,
        hints: Mapping[str, float] | None = None,
    ) -> "PoaMap":
        """Return the map of some areas after some looks, sweeps and hints.

        Args:
            areas: What was expected of them.
            looks: How often it was looked in each.
            swept: How likely the sweeps of each have found who is there.
            hints: How many times likelier all hints on an area are if somebody is there than if nobody is; 1 for others, and for elsewhere.
        """
        weights = {name: area.poa * (hints or {}).get(name, 1.0) for name, area in areas.items()}
        total = max(0.0, 1.0 - math.fsum(area.poa for area in areas.values())) + math.fsum(weights.values())
        poa = {name: weight / total if hints and total else weight for name, weight in weights.items()}
        return cls(poa, {name: area.pod for name, area in areas.items()}, looks, swept or {})

    def missed(self, area: str) -> float:
        """Return how likely all that was done in an area has missed who is there: (1 - POD) for each look, and for its sweeps."""
        return (1.0 - self.pod[area]) ** self.looks.get(area, 0) * (1.0 - self.swept.get(area, 0.0))

    def now(self) -> dict[str, float]:
        """Return how likely each area is now, by Bayes; 0 everywhere if nobody can be anywhere any more."""
        left = {area: poa * self.missed(area) for area, poa in self.poa.items()}
        elsewhere = max(0.0, 1.0 - math.fsum(self.poa.values()))
        total = elsewhere + math.fsum(left.values())
        return {area: value / total if total else 0.0 for area, value in left.items()}

    def pos(self) -> float:
        """Return how likely the looks so far find somebody: Σ POA · (1 - Π(1 - POD)), told before them."""
        return math.fsum(poa * (1.0 - self.missed(area)) for area, poa in self.poa.items())


@dataclass(frozen=True, eq=False)
class Tour:
    """What there is to choose an order by.

    Args:
        from_start: How long the way from where the robot is to each area takes, seconds.
        between: How long the way from each area (row) to each other (column) takes, seconds.
        looks: How long a look in each area takes, seconds.
        finds: How likely the look in each area finds somebody: POA · POD.
    """

    from_start: Sequence[float]
    between: "Sequence[Sequence[float]] | npt.NDArray[np.float64]"
    looks: Sequence[float]
    finds: Sequence[float]

    def ends(self, order: Sequence[int]) -> list[float]:
        """Return when each look of an order ends, seconds from now."""
        steps = [self.from_start[order[0]]] if order else []
        steps += [float(self.between[before][after]) for before, after in itertools.pairwise(order)]
        return list(
            itertools.accumulate(step + self.looks[area] for step, area in zip(steps, order, strict=True))
        )

    def expected_find(self, order: Sequence[int]) -> float:
        """Return the expected time to the first find of an order, if there is one, seconds; 0 where nothing can be found."""
        pos = sum(self.finds[area] for area in order)
        cost = sum(end * self.finds[area] for end, area in zip(self.ends(order), order, strict=True))
        return cost / pos if pos else 0.0
