"""A mission's way over the map, planned before the flight: which of its places can be reached, and how far it is."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.planner import NavCode, Planner, PlanningError
from sar_compiler.sim.world import Floats

_WORDS = {
    NavCode.START_OUTSIDE_MAP: "the robot's start is outside the map",
    NavCode.START_OCCUPIED: "the robot does not fit on free ground at its start",
    NavCode.GOAL_OUTSIDE_MAP: "it is outside the map",
    NavCode.GOAL_OCCUPIED: "the robot does not fit on free ground there",
    NavCode.NO_VALID_PATH: "no way leads there",
}


class Leg(NamedTuple):
    """The way to one place.

    Attributes:
        name: The place.
        x: Its position in the frame `map`, metres.
        y: The same.
        distance: Metres along the path from the place before it that can be reached; None if it cannot.
        trouble: What is wrong with it; empty if nothing is.
    """

    name: str
    x: float
    y: float
    distance: float | None
    trouble: str = ""


def plan_route(
    occupancy: OccupancyMap,
    robot_radius: float,
    start: tuple[float, float],
    stops: Sequence[tuple[str, float, float]],
    allowed: Callable[[float, float], bool] = lambda _x, _y: True,
) -> list[Leg]:
    """Plan the way from place to place; one that cannot be reached is passed over.

    Args:
        occupancy: The map.
        robot_radius: The radius of the robot's body, metres.
        start: Where the robot begins: x and y in metres, frame `map`.
        stops: The names and positions of the places, in the order of their visit.
        allowed: Whether the robot may be at a position.
    """
    planner = Planner(occupancy, robot_radius)
    here, legs = Pose2D(*start), []
    for name, x, y in stops:
        there = Pose2D(x, y)
        try:
            path = planner.plan(here, there)
        except PlanningError as error:
            legs.append(Leg(name, x, y, None, _WORDS[error.code]))
            continue
        if not allowed(x, y):
            legs.append(Leg(name, x, y, None, "it is outside the geofence"))
            continue
        steps = np.hypot(*np.diff(np.vstack(([here.x, here.y], path.points)), axis=0).T)
        legs.append(Leg(name, x, y, float(steps.sum()), _outside(path.points, allowed)))
        here = there
    return legs


def _outside(points: Floats, allowed: Callable[[float, float], bool]) -> str:
    """Return that a path is not allowed somewhere; empty if it is everywhere."""
    inside = all(allowed(float(x), float(y)) for x, y in points)
    return "" if inside else "the way there leaves the geofence"
