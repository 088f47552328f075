"""Several robots in one world: their start poses, and their effect on each other."""

import itertools
from collections import Counter
from collections.abc import Sequence

import numpy as np

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import read_map
from sar_compiler.sim.placement import Placement, PlacementError
from sar_compiler.sim.robot import Robot
from sar_compiler.sim.world import World


def check_placements(world: World, placements: Sequence[Placement]) -> None:
    """Check that robots can start as they are placed.

    Raises:
        PlacementError: If two have the same name, or if one would start in contact with an obstacle or another
            robot, or outside the world's map.
        SarError: If the world's map cannot be read.
    """
    for name, count in Counter(placement.name for placement in placements).items():
        if count > 1:
            problem = f"{count} robots have this name; each needs one of its own, as its namespace"
            raise PlacementError(name, problem)
    radius = world.robot_radius
    starts = [(placement.name, placement.start or world.start) for placement in placements]
    for name, start in starts:
        if not world.solid.clearance(start.x, start.y) > radius:
            problem = (
                f"would start in an obstacle, or touching one, at {_shown(start)}; "
                f"its centre needs more than {radius:g} m around it"
            )
            raise PlacementError(name, problem)
        _require_on_map(world, name, start)
    for (one, here), (other, there) in itertools.combinations(starts, 2):
        if not here.distance_to(there) > 2 * radius:
            problem = (
                f"would start at {_shown(there)}, touching robot '{one}' at {_shown(here)}; their centres "
                f"need more than {2 * radius:g} m between them (give a start: {other}:X,Y)"
            )
            raise PlacementError(other, problem)


def _require_on_map(world: World, name: str, start: Pose2D) -> None:
    """Refuse a start pose that the localisation would refuse."""
    if world.map_path is not None and read_map(world.map_path).cell_at(start.x, start.y) is None:
        problem = f"would start at {_shown(start)}, which is outside the world's map (metres, frame map)"
        raise PlacementError(name, problem)


def make_robots(world: World, placements: Sequence[Placement], *, seed: int = 0) -> list[Robot]:
    """Return robots that are solid to each other, in the order of their steps.

    Raises:
        PlacementError: If they cannot start as placed.
    """
    check_placements(world, placements)
    robots = [
        Robot(world, start=placement.start, odometry=placement.odometry, seed=seed_of(seed, number))
        for number, placement in enumerate(placements)
    ]
    for robot in robots:
        robot.meet(other for other in robots if other is not robot)
    return robots


def seed_of(seed: int, number: int) -> int:
    """Return the seed of one robot's noise; that of the first (number 0) is that of a single robot."""
    if number == 0:
        return seed
    return int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def _shown(start: Pose2D) -> str:
    return f"({start.x:.2f}, {start.y:.2f})"
