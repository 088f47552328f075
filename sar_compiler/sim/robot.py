"""A robot with a differential drive: limits of speed and acceleration, contact with obstacles, and odometry."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sar_compiler.sim.geometry import ORIGIN, Cylinder, Pose2D, normalise_angle
from sar_compiler.sim.world import Solid, World

# The standard deviation of each step's odometry, as a fraction of the distance or angle.
_ODOMETRY_NOISE = 0.01
# The speed below which the robot counts as standing still, m/s and rad/s.
_STILL = 0.02


@dataclass(frozen=True)
class Limits:
    """The limits of the drive; the defaults are those of a ROSbot.

    Attributes:
        speed: Maximum speed forward and backward, m/s.
        turn: Maximum angular speed, rad/s.
        acceleration: Maximum acceleration, m/s².
        turn_acceleration: Maximum angular acceleration, rad/s².
    """

    speed: float = 0.6
    turn: float = 2.0
    acceleration: float = 1.0
    turn_acceleration: float = 4.0


@dataclass(frozen=True)
class Twist2D:
    """A planar velocity.

    Attributes:
        v: Forward, m/s.
        w: Counter-clockwise, rad/s.
    """

    v: float = 0.0
    w: float = 0.0

    @property
    def is_still(self) -> bool:
        """Whether the speed is negligible."""
        return abs(self.v) < _STILL and abs(self.w) < _STILL


STAND = Twist2D()


@dataclass(frozen=True)
class RobotState:
    """The state of a robot.

    Attributes:
        pose: True pose of `base_link`, frame `map`.
        velocity: True velocity, frame `base_link`.
        odometry: Pose of `base_link` according to the wheel odometry, frame `odom` (whose origin is the pose at the start).
        touching: Whether the last step ended in contact with an obstacle or another robot.
    """

    pose: Pose2D
    velocity: Twist2D = STAND
    odometry: Pose2D = ORIGIN
    touching: bool = False


class Robot:
    """A disc that follows commands within limits, and never enters an obstacle or another robot.

    Args:
        world: The world that contains the robot.
        start: The robot's pose at time zero, frame `map`; the world's start if None.
        odometry: The pose at time zero according to the robot's odometry.
        seed: The seed of the odometry's noise.
        limits: The limits of the robot's drive.
        command_timeout: The robot stops when the last command is older than this, seconds of simulated time.
    """

    def __init__(
        self,
        world: World,
        *,
        start: Pose2D | None = None,
        odometry: Pose2D = ORIGIN,
        seed: int = 0,
        limits: Limits | None = None,
        command_timeout: float = 0.5,
    ) -> None:
        self.limits = limits or Limits()
        self.state = RobotState(start or world.start, odometry=odometry)
        self._world = world
        self._others: tuple[Robot, ...] = ()
        self._random = np.random.default_rng([seed, 1])
        self._timeout = command_timeout
        self._command = STAND
        self._command_age = math.inf

    def add_robots(self, others: Iterable["Robot"]) -> None:
        """Add other robots as obstacles. The lidar detects these obstacles, too."""
        self._others = tuple(others)

    def surroundings(self) -> Solid:
        """Return all objects that this robot can touch and that its lidar can detect."""
        if not self._others:
            return self._world.obstacle_arrays
        poses = (other.state.pose for other in self._others)
        return self._world.obstacle_arrays.with_cylinders(
            Cylinder(pose.x, pose.y, self._world.robot_radius) for pose in poses
        )

    def command(self, twist: Twist2D) -> None:
        """Set the commanded velocity; limit the values, and replace values that are not finite by zero."""
        self._command = Twist2D(_clip(twist.v, self.limits.speed), _clip(twist.w, self.limits.turn))
        self._command_age = 0.0

    def step(self, duration: float) -> RobotState:
        """Advance by *duration* seconds and return the new state.

        Other robots do not move during the step, because the robots of a world take their steps one after the other.
        """
        wanted = self._command if self._command_age < self._timeout else STAND
        self._command_age += duration
        before = self.state
        v = _limit_change(before.velocity.v, wanted.v, self.limits.acceleration * duration)
        w = _limit_change(before.velocity.w, wanted.w, self.limits.turn_acceleration * duration)
        heading = before.pose.yaw + w * duration / 2
        # Within a step the robot moves along the chord of its arc, which makes the contact test exact.
        length = v * duration * _sinc(w * duration / 2)
        position = (before.pose.x, before.pose.y)
        direction = heading if length >= 0.0 else heading + math.pi
        gone = self.surroundings().free_travel(position, direction, abs(length), self._world.robot_radius)
        touching = gone < abs(length)
        moved = math.copysign(gone, length)
        self.state = RobotState(
            pose=_move_along_arc(before.pose, moved, w * duration),
            velocity=Twist2D(0.0 if touching else v, w),
            odometry=self._measure(before.odometry, moved, w * duration),
            touching=touching,
        )
        return self.state

    def _measure(self, odometry: Pose2D, moved: float, turned: float) -> Pose2D:
        """Return the odometry after a step of *moved* metres and *turned* radians."""
        slip, skid = self._random.standard_normal(2)
        moved *= 1.0 + _ODOMETRY_NOISE * float(slip)
        turned *= 1.0 + _ODOMETRY_NOISE * float(skid)
        return _move_along_arc(odometry, moved, turned)


def _move_along_arc(pose: Pose2D, length: float, turned: float) -> Pose2D:
    """Return the pose after a step of *length* metres along the chord of an arc of *turned* radians."""
    heading = pose.yaw + turned / 2
    x, y = pose.x + length * math.cos(heading), pose.y + length * math.sin(heading)
    return Pose2D(x, y, normalise_angle(pose.yaw + turned))


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value)) if math.isfinite(value) else 0.0


def _limit_change(value: float, target: float, most: float) -> float:
    return value + max(-most, min(most, target - value))


def _sinc(half_turn: float) -> float:
    """Return the ratio of chord to arc length for an arc of twice *half_turn* radians."""
    return math.sin(half_turn) / half_turn if abs(half_turn) > 1e-9 else 1.0  # noqa: PLR2004
