"""Mapping a world: the robot drives through it with its lidar, and the scans become the map."""

from collections.abc import Callable

import numpy as np

from sar_compiler.errors import SarError
from sar_compiler.sim.follower import Follower, FollowerSettings
from sar_compiler.sim.lidar import Lidar
from sar_compiler.sim.mapper import Mapper
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.path import Path2D
from sar_compiler.sim.robot import Robot
from sar_compiler.sim.world import World

STEP_SEC = 0.05
# One scan in this many steps goes into the map.
_SCAN_EVERY = 8
# A survey slower than this on average has got stuck, m/s.
_SLOWEST = 0.1


class SurveyError(SarError):
    """A world cannot be mapped."""


def survey(
    world: World, *, seed: int = 0, report: Callable[[float], object] = lambda _: None
) -> OccupancyMap:
    """Drive the world's survey route and return the map made of the scans.

    Args:
        world: The world.
        seed: The seed of the noise.
        report: Is told now and then which part of the route is driven, from 0 to 1.

    Raises:
        SurveyError: If the world has no survey route, or the robot gets stuck on it.
    """
    if not world.survey:
        message = f"world '{world.name}' has no 'survey' way to drive for a map"
        raise SurveyError(message)
    lidar = Lidar()
    random = np.random.default_rng([seed, 2])
    robot, mapper = Robot(world, seed=seed), Mapper(lidar, world.start)
    corners = np.array([(world.start.x, world.start.y), *world.survey], dtype=np.float64)
    path = Path2D.through(corners)
    follower = Follower(path, None, robot.limits, FollowerSettings(look_ahead=0.3))
    for step in range(round(float(path.to_go[0]) / _SLOWEST / STEP_SEC)):
        if step % _SCAN_EVERY == 0:
            pose = robot.state.pose
            mapper.integrate(pose, lidar.scan(world.solid, pose, random))
            report(max(0.0, 1.0 - follower.distance_remaining(pose) / float(path.to_go[0])))
        robot.command(follower.command(robot.state))
        if follower.done:
            return mapper.result()
        robot.step(STEP_SEC)
    pose = robot.state.pose
    message = f"the survey of world '{world.name}' got stuck at ({pose.x:.2f}, {pose.y:.2f})"
    raise SurveyError(message)
