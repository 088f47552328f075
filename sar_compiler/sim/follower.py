"""Paths in the plane, and a path follower: the robot turns towards the path, pursues a point on it, and turns to the final yaw."""

import itertools
import math
from dataclasses import dataclass
from enum import Enum, auto
from functools import cached_property

import numpy as np

from sar_compiler.sim.geometry import Pose2D, normalise_angle
from sar_compiler.sim.robot import STAND, Limits, RobotState, Twist2D
from sar_compiler.sim.world import Floats

# The maximum distance along the path that the robot can drive between two updates, metres.
_WINDOW = 1.0


@dataclass(frozen=True)
class Path2D:
    """A path of straight segments.

    Attributes:
        points: The ends of the segments, metres, frame `map`, shape (n, 2), n at least 1; the last point is the goal.
    """

    points: Floats

    @cached_property
    def remaining_lengths(self) -> Floats:
        """The lengths of the path from each point to the goal, metres, shape (n,)."""
        lengths = np.hypot(*np.diff(self.points, axis=0).T)
        return np.append(np.cumsum(lengths[::-1])[::-1], 0.0)

    def nearest(self, pose: Pose2D, since: int) -> int:
        """Return the index of the path point nearest to *pose* within `_WINDOW` metres after the point *since*."""
        ahead = int(
            np.searchsorted(-self.remaining_lengths, _WINDOW - self.remaining_lengths[since], side="right")
        )
        part = self.points[since : max(ahead, since + 1)]
        return since + int(np.argmin(np.hypot(part[:, 0] - pose.x, part[:, 1] - pose.y)))

    def carrot(self, index: int, ahead: float) -> tuple[float, float]:
        """Return the point that is *ahead* metres after point *index* on the path, or the goal if the path is shorter."""
        target = int(np.searchsorted(-self.remaining_lengths, ahead - self.remaining_lengths[index]))
        x, y = self.points[min(target, len(self.points) - 1)]
        return float(x), float(y)

    @staticmethod
    def through_corners(corners: Floats, spacing: float = 0.05) -> "Path2D":
        """Return the path of straight lines from corner to corner, with points at most *spacing* metres apart."""
        pieces = []
        for start, end in itertools.pairwise(corners):
            count = max(1, int(np.ceil(np.hypot(*(end - start)) / spacing)))
            pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
        return Path2D(np.concatenate([*pieces, corners[-1:]]))


@dataclass(frozen=True)
class FollowerSettings:
    """The parameters of path following.

    Attributes:
        look_ahead: Distance of the pursued point, metres.
        position_tolerance: The robot stops driving when it is closer to the goal than this distance, metres.
        yaw_tolerance: The robot stops turning when its yaw differs from the goal's yaw by less than this angle, radians.
        turn_first: The robot turns in place when the angle to the path is larger than this, radians.
        turned: Turning in place ends when the angle to the path is smaller than this, radians.
        braking: Fraction of the robot's maximum acceleration that the follower uses for braking.
    """

    look_ahead: float = 0.4
    position_tolerance: float = 0.06
    yaw_tolerance: float = 0.03
    turn_first: float = 0.9
    turned: float = 0.15
    braking: float = 0.5


class _Phase(Enum):
    TURN = auto()
    DRIVE = auto()
    ALIGN = auto()
    DONE = auto()


class Follower:
    """Drives one path to its end.

    Args:
        path: The path, frame `map`.
        yaw: The final yaw, radians; None for any.
        limits: The limits of the robot's drive.
        settings: The parameters of path following.
    """

    def __init__(
        self,
        path: Path2D,
        yaw: float | None,
        limits: Limits,
        settings: FollowerSettings | None = None,
    ) -> None:
        self._path, self._yaw, self._limits = path, yaw, limits
        self._settings = settings or FollowerSettings()
        self._index = 0
        self._phase = _Phase.TURN
        self._goal = Pose2D(float(path.points[-1, 0]), float(path.points[-1, 1]))

    @property
    def is_done(self) -> bool:
        """Whether the robot has reached the goal and the final yaw."""
        return self._phase is _Phase.DONE

    def distance_remaining(self, pose: Pose2D) -> float:
        """Return the remaining distance to the goal from *pose* in metres."""
        x, y = self._path.points[self._index]
        left = float(self._path.remaining_lengths[self._index]) + pose.distance_to(Pose2D(float(x), float(y)))
        return pose.distance_to(self._goal) if self._phase in {_Phase.ALIGN, _Phase.DONE} else left

    def command(self, state: RobotState) -> Twist2D:
        """Return the velocity command for the robot's current state."""
        self._index = self._path.nearest(state.pose, self._index)
        away = state.pose.distance_to(self._goal)
        # A path may pass close to the goal before its end.
        ending = self._path.remaining_lengths[self._index] < self._settings.look_ahead
        near = ending and away < self._settings.position_tolerance
        if near and self._phase in {_Phase.TURN, _Phase.DRIVE}:
            self._phase = _Phase.ALIGN
        if self._phase is _Phase.ALIGN:
            return self._align(state)
        if self._phase is _Phase.DONE:
            return STAND
        carrot = self._path.carrot(self._index, self._settings.look_ahead)
        reach = math.hypot(carrot[0] - state.pose.x, carrot[1] - state.pose.y)
        bearing = math.atan2(carrot[1] - state.pose.y, carrot[0] - state.pose.x)
        aside = normalise_angle(bearing - state.pose.yaw)
        if abs(aside) > self._settings.turn_first:
            self._phase = _Phase.TURN
        if self._phase is _Phase.TURN and abs(aside) > self._settings.turned:
            return Twist2D(0.0, self._braked_turn_rate(aside))
        self._phase = _Phase.DRIVE
        return self._pursue(aside, reach, max(away, self.distance_remaining(state.pose)))

    def _pursue(self, aside: float, reach: float, left: float) -> Twist2D:
        """Return the velocities of the arc to a point that is *reach* metres away and *aside* radians to the left."""
        curvature = 2.0 * math.sin(aside) / max(reach, self._settings.position_tolerance)
        speed = min(
            self._limits.speed,
            math.sqrt(2.0 * self._settings.braking * self._limits.acceleration * left),
            0.5 * self._limits.turn / max(abs(curvature), 1e-6),
        )
        return Twist2D(speed, speed * curvature)

    def _align(self, state: RobotState) -> Twist2D:
        error = 0.0 if self._yaw is None else normalise_angle(self._yaw - state.pose.yaw)
        if abs(error) > self._settings.yaw_tolerance:
            return Twist2D(0.0, self._braked_turn_rate(error))
        if state.velocity.is_still:
            self._phase = _Phase.DONE
        return STAND

    def _braked_turn_rate(self, error: float) -> float:
        """Return the highest turning speed that allows the robot to stop after *error* radians."""
        fastest = math.sqrt(2.0 * self._settings.braking * self._limits.turn_acceleration * abs(error))
        return math.copysign(min(self._limits.turn, fastest), error)
