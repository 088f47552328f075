"""What it costs to order zones with probabilities, with the ways between them as the mission has them before it asks a planner."""

from collections.abc import Iterator

import numpy as np

from benchmarks.figures import Effort, Result, alone, most_memory, plain, timed
from search_and_rescue.search_theory import Area
from search_and_rescue.zone_manager import ZoneManager

COUNTS = (50, 200, 1_000)
"""How many zones are ordered."""
_SIDE_M = 500.0


def subject(count: int) -> str:
    """Return the name of the figure for so many zones."""
    return f"order of {count:,} zones"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the CPU time of an order, and the most memory of a process that finds one, for each number of zones."""
    for count in COUNTS:
        seconds = sorted(order_sec(count, seed) for seed in range(effort.rounds))
        yield plain(subject(count), seconds[len(seconds) // 2], "s")
        yield plain(f"{subject(count)}: memory", float(alone(memory_of_an_order, count)), "bytes")


def order_sec(count: int, seed: int) -> float:
    """Return the CPU time in which zones at random places are ordered, seconds."""
    from search_and_rescue.zone_order import ordered

    chance = np.random.default_rng(seed)
    names = [f"zone_{at}" for at in range(count)]
    places = chance.uniform(0.0, _SIDE_M, (count, 2)).tolist()
    zones = [{"id": name, "x": x, "y": y, "yaw": 0.0} for name, (x, y) in zip(names, places, strict=True)]
    shares = 1.0 + chance.pareto(1.2, count)
    expected = zip(
        0.9 * shares / shares.sum(),
        chance.uniform(0.5, 0.95, count),
        chance.uniform(5, 60, count),
        strict=True,
    )
    areas = {name: Area(*map(float, each)) for name, each in zip(names, expected, strict=True)}
    plan = ZoneManager(zones, {"x": 0.0, "y": 0.0, "yaw": 0.0}, areas=areas, speed_mps=0.5)
    return timed(lambda: ordered("expected_find", plan.tour(plan.eligible_zones())))


def memory_of_an_order(count: int) -> int:
    """Return the most memory that this process has had, after an order: bytes."""
    order_sec(count, 0)
    return most_memory()
