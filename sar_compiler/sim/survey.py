"""Mapping of a world: the robot drives through the world with its lidar, and the scans are combined into a map.

Each cell has log-odds of being occupied. A ray decreases the log-odds of the cells that it passes, and increases the log-odds of the cell
in which it ends.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sar_compiler.errors import SarError
from sar_compiler.sim.follower import Follower, FollowerSettings, Path2D
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from sar_compiler.sim.robot import Robot
from sar_compiler.sim.world import Floats, Lidar, World

# The change of a cell's log-odds by a ray that ends in the cell, or passes through it.
_HIT, _MISS = 0.85, -0.4
# The bounds of log-odds, which allow a cell to change its state later.
_MIN_ODDS, _MAX_ODDS = -4.0, 4.0
# The log-odds of 65 % and 25 %, the thresholds of map_saver for occupied and free.
_SURELY_OCCUPIED, _SURELY_FREE = math.log(0.65 / 0.35), math.log(0.25 / 0.75)
# The width of the margin of unknown cells around the seen area, in cells.
_MARGIN = 6
# The edge length of a cell, metres.
_RESOLUTION = 0.05
# Half the edge length of the square that can be mapped, metres; scan points outside the square are ignored.
_REACH = 25.0
_SIZE = 2 * round(_REACH / _RESOLUTION)


class Mapper:
    """Combines scans at known poses into a map.

    Args:
        lidar: The scanner that takes the scans.
        centre: The centre of the area that can be mapped, metres, frame `map`.
    """

    def __init__(self, lidar: Lidar, centre: Pose2D) -> None:
        self._lidar = lidar
        # The corner is a multiple of the resolution, so that the map's origin is a round number.
        self._corner = (
            _RESOLUTION * math.floor((centre.x - _REACH) / _RESOLUTION),
            _RESOLUTION * math.floor((centre.y - _REACH) / _RESOLUTION),
        )
        self._odds = np.zeros((_SIZE, _SIZE))
        self._seen = np.zeros((_SIZE, _SIZE), dtype=bool)

    def integrate(self, pose: Pose2D, ranges: Floats) -> None:
        """Add a scan to the map.

        Args:
            pose: The scanner's pose, frame `map`.
            ranges: The measured ranges, metres, shape (beams,), inf for rays without a hit.
        """
        angles = self._lidar.angles + pose.yaw
        along = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        hits = np.isfinite(ranges)
        ends = self._cells(pose, along[hits] * ranges[hits, None])
        passed = self._cells_passed(pose, along, np.where(hits, ranges, self._lidar.range_max))
        passed = np.setdiff1d(passed, ends, assume_unique=True)
        odds, seen = self._odds.reshape(-1), self._seen.reshape(-1)
        for cells, change in ((passed, _MISS), (ends, _HIT)):
            odds[cells] = np.clip(odds[cells] + change, _MIN_ODDS, _MAX_ODDS)
            seen[cells] = True

    def result(self) -> OccupancyMap:
        """Return the map of the area seen so far, with a margin of unknown cells."""
        rows, columns = np.nonzero(self._seen)
        if not rows.size:
            rows = columns = np.array([_SIZE // 2])
        top, left = (max(int(index.min()) - _MARGIN, 0) for index in (rows, columns))
        part = np.s_[top : int(rows.max()) + _MARGIN + 1, left : int(columns.max()) + _MARGIN + 1]
        odds = self._odds[part]
        cells = np.full(odds.shape, UNKNOWN, dtype=np.int8)
        cells[odds <= _SURELY_FREE] = FREE
        cells[odds >= _SURELY_OCCUPIED] = OCCUPIED
        x, y = self._corner[0] + left * _RESOLUTION, self._corner[1] + top * _RESOLUTION
        return OccupancyMap(cells, _RESOLUTION, round(x, 6), round(y, 6))

    def _cells_passed(self, pose: Pose2D, along: Floats, lengths: Floats) -> NDArray[np.int64]:
        """Return the cells that the rays cross before their ends, without duplicates."""
        spacing = _RESOLUTION / 2
        steps = np.arange(0.0, float(lengths.max(initial=0.0)), spacing)
        points = along[:, None, :] * steps[None, :, None]
        before_end = steps[None, :] < lengths[:, None] - spacing
        return self._cells(pose, points[before_end])

    def _cells(self, pose: Pose2D, offsets: Floats) -> NDArray[np.int64]:
        """Return the flat indices, without duplicates, of the cells at *offsets* from *pose* (metres, shape (n, 2))."""
        columns = np.floor((pose.x + offsets[:, 0] - self._corner[0]) / _RESOLUTION).astype(np.int64)
        rows = np.floor((pose.y + offsets[:, 1] - self._corner[1]) / _RESOLUTION).astype(np.int64)
        inside = (rows >= 0) & (rows < _SIZE) & (columns >= 0) & (columns < _SIZE)
        touched = np.zeros(_SIZE * _SIZE, dtype=bool)
        touched[rows[inside] * _SIZE + columns[inside]] = True
        return np.flatnonzero(touched)


STEP_SEC = 0.05
# The number of steps between two scans.
_SCAN_EVERY = 8
# The average speed below which the robot counts as stuck, m/s.
_SLOWEST = 0.1


class SurveyError(SarError):
    """A world cannot be mapped."""


def survey(
    world: World, *, seed: int = 0, on_progress: Callable[[float], object] = lambda _: None
) -> OccupancyMap:
    """Let the robot drive the world's survey route, and return the map that results from the scans.

    Args:
        world: The world.
        seed: The seed of the noise.
        on_progress: Called repeatedly with the driven fraction of the route, from 0 to 1.

    Raises:
        SurveyError: If the world has no survey route, or the robot gets stuck on it.
    """
    if not world.survey:
        raise SurveyError(
            f"world '{world.name}' has no survey route. Add `survey:` with points to the world file"
        )
    for number, (x, y) in enumerate(world.survey, 1):
        if max(abs(x - world.start.x), abs(y - world.start.y)) > _REACH:
            raise SurveyError(
                f"point {number} of the survey of world '{world.name}', ({x:g}, {y:g}), is outside the area that "
                f"can be mapped. Choose a point whose x and y differ from the robot's start by at most {_REACH:g} m"
            )
    lidar = Lidar()
    random = np.random.default_rng([seed, 2])
    robot, mapper = Robot(world, seed=seed), Mapper(lidar, world.start)
    corners = np.array([(world.start.x, world.start.y), *world.survey], dtype=np.float64)
    path = Path2D.through_corners(corners)
    follower = Follower(path, None, robot.limits, FollowerSettings(look_ahead=0.3))
    for step in range(round(float(path.remaining_lengths[0]) / _SLOWEST / STEP_SEC)):
        if step % _SCAN_EVERY == 0:
            pose = robot.state.pose
            mapper.integrate(pose, lidar.scan(world.obstacle_arrays, pose, random))
            on_progress(max(0.0, 1.0 - follower.distance_remaining(pose) / float(path.remaining_lengths[0])))
        robot.command(follower.command(robot.state))
        if follower.is_done:
            return mapper.result()
        robot.step(STEP_SEC)
    pose = robot.state.pose
    raise SurveyError(
        f"the robot got stuck at ({pose.x:.2f}, {pose.y:.2f}) in the survey of world '{world.name}'"
    )
