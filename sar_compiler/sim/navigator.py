"""Execute a goal like Nav2, but without ROS: planning, driving, progress checks and braking."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from sar_compiler import resources
from sar_compiler.missions.parameter_file import read_parameter_file
from sar_compiler.sim.follower import Follower, FollowerSettings, Path2D
from sar_compiler.sim.geometry import Pose2D, normalise_angle
from sar_compiler.sim.placement import NAV2_NAME
from sar_compiler.sim.planner import NavCode, Planner
from sar_compiler.sim.robot import STAND, Limits, RobotState, Twist2D


@dataclass(frozen=True)
class Recovery:
    """An action that the robot performs before it tries again to reach a goal.

    Attributes:
        name: The robot's action as a verb, such as `spins`.
        command: The velocity command during the recovery.
        duration_sec: The duration of the recovery, simulated seconds.
    """

    name: str
    command: Twist2D
    duration_sec: float


@dataclass(frozen=True)
class DrivingManner:
    """The way in which the Nav2 substitute drives.

    Attributes:
        speed: The highest speed of a drive, m/s.
        turn: The highest speed of a turn, rad/s.
        follower: The parameters of path following.
        tolerance: The maximum distance between an occupied goal and the end of the path, metres.
        recoveries: The recoveries in order. After each recovery the robot tries again; after the last attempt the goal is aborted.
        knows_distance_at_once: Whether the first feedback contains the remaining distance. Otherwise it contains 0.
        server_timeout_sec: The time within which the controller, a separate process in Nav2, must accept a goal, seconds.
        looks_back_sec: The interval of checks for passed poses of `navigate_through_poses`, simulated seconds.
    """

    speed: float = math.inf
    turn: float = math.inf
    follower: FollowerSettings = field(default_factory=FollowerSettings)
    tolerance: float = 0.0
    recoveries: tuple[Recovery, ...] = ()
    knows_distance_at_once: bool = True
    server_timeout_sec: float = 1.0
    looks_back_sec: float = 0.0

    def limits(self, limits: Limits) -> Limits:
        """Return the limits of a drive, given the limits of the robot."""
        return replace(limits, speed=min(limits.speed, self.speed), turn=min(limits.turn, self.turn))


QUICK = DrivingManner()
"""The manner of driving for rehearsals and tests. It is accurate and has no recoveries."""

_CLEAR = Recovery("clears its costmaps", STAND, 1.0)
_SPIN = Recovery("spins", Twist2D(0.0, 1.0), math.pi / 2)
_WAIT = Recovery("waits", STAND, 5.0)
_BACK_UP = Recovery("backs up", Twist2D(-0.15, 0.0), 2.0)

# The recoveries of navigate_to_pose_w_replanning_and_recovery.xml in Nav2 1.3.13, as observed in a run.
_RECOVERIES = (_CLEAR, _SPIN, _WAIT, _BACK_UP, _CLEAR, _SPIN)
# The interval at which navigate_through_poses_w_replanning_and_recovery.xml removes passed poses and plans again, seconds.
_REPLANS_SEC = 3.0


@cache
def manner(name: str) -> DrivingManner:
    """Return the manner of driving that has the given name; `placement.MANNER_NAMES` lists the names."""
    return like_nav2(resources.shared_file_path("config", "nav2_params.yaml")) if name == NAV2_NAME else QUICK


def like_nav2(parameters: Path) -> DrivingManner:
    """Return Nav2's manner of driving, with the values from a parameter file or else Nav2's default values.

    Raises:
        ParameterFileError: If the file has errors.
    """
    nodes = ("controller_server", "planner_server", "bt_navigator")
    controller, planner, navigator = (read_parameter_file(parameters, f"/{node}") for node in nodes)
    path = _plugin(controller, "controller_plugins", "FollowPath")
    goal = _plugin(controller, "goal_checker_plugins", "goal_checker")
    grid = _plugin(planner, "planner_plugins", "GridBased")
    return DrivingManner(
        speed=_number(controller, f"{path}.desired_linear_vel", 0.5),
        turn=_number(controller, f"{path}.rotate_to_heading_angular_vel", 1.8),
        follower=FollowerSettings(
            look_ahead=_number(controller, f"{path}.lookahead_dist", 0.6),
            position_tolerance=_number(controller, f"{goal}.xy_goal_tolerance", 0.25),
            yaw_tolerance=_number(controller, f"{goal}.yaw_goal_tolerance", 0.25),
        ),
        tolerance=_number(planner, f"{grid}.tolerance", 0.5),
        recoveries=_RECOVERIES,
        knows_distance_at_once=False,
        server_timeout_sec=_number(navigator, "default_server_timeout", 20) / 1000.0,
        looks_back_sec=_REPLANS_SEC,
    )


def _plugin(parameters: dict[str, object], name: str, default: str) -> str:
    """Return the name of a server's first plugin."""
    plugins = parameters.get(name)
    return str(plugins[0]) if isinstance(plugins, Sequence) and plugins else default


def _number(parameters: dict[str, object], name: str, default: float) -> float:
    value = parameters.get(name, default)
    return float(value) if isinstance(value, (int, float)) else default


# The robot counts as stuck if it moves and turns less than this (metres, radians) in this simulated time (seconds).
_MOVE, _TURN, _PATIENCE_SEC = 0.2, 0.4, 10.0
# The speed that time estimates assume for a standing robot, m/s.
_CRUISE = 0.4


class DriveEnd(Enum):
    """The way in which a goal ended."""

    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    ABORTED = "aborted"


@dataclass(frozen=True)
class DriveOutcome:
    """The outcome of a goal.

    Attributes:
        ending: The way in which the goal ended.
        code: Nav2's error code, a `NavCode` unless a fault sets another code.
        text: The reason in words; empty if there is none.
    """

    ending: DriveEnd
    code: int = NavCode.NONE
    text: str = ""


@dataclass(frozen=True)
class DriveProgress:
    """The state of a drive after a step.

    Attributes:
        command: The next velocity command.
        distance_remaining: The remaining distance, metres.
        time_remaining_sec: The estimated remaining time, simulated seconds.
        outcome: The outcome of the goal; None until the goal ends.
    """

    command: Twist2D
    distance_remaining: float
    time_remaining_sec: float
    outcome: DriveOutcome | None = None


class Drive:
    """One drive to a goal.

    Args:
        planner: Plans the path.
        limits: The limits of the robot's drive.
        goal: The goal pose, frame `map`.
        start: The robot's pose, frame `map`.
        now: The simulated time, seconds.
        manner: The manner of driving.
        via: The positions through which the path leads, frame `map`.

    Raises:
        PlanningError: If there is no path.
    """

    def __init__(
        self,
        planner: Planner,
        limits: Limits,
        goal: Pose2D,
        start: Pose2D,
        now: float,
        manner: DrivingManner = QUICK,
        via: Sequence[Pose2D] = (),
    ) -> None:
        paths = [planner.plan(*each, manner.tolerance) for each in pairwise([start, *via, goal])]
        self.path = Path2D(np.concatenate([path.points for path in paths]))
        self._follower = Follower(self.path, goal.yaw, manner.limits(limits), manner.follower)
        self._mark, self._mark_time = start, now
        self._braking = False

    def brake(self) -> None:
        """Let the robot brake; when it stands still, the goal ends as canceled."""
        self._braking = True

    def step(self, state: RobotState, now: float) -> DriveProgress:
        """Return the progress and the next command for the robot's state.

        Args:
            state: The robot's current state.
            now: Simulated time, seconds.
        """
        command = STAND if self._braking else self._follower.command(state)
        left = self._follower.distance_remaining(state.pose)
        speed = max(abs(state.velocity.v), _CRUISE)
        return DriveProgress(command, left, left / speed, self._outcome(state, now))

    def _outcome(self, state: RobotState, now: float) -> DriveOutcome | None:
        if self._braking:
            return DriveOutcome(DriveEnd.CANCELED) if state.velocity.is_still else None
        if self._follower.is_done:
            return DriveOutcome(DriveEnd.SUCCEEDED)
        turned = abs(normalise_angle(state.pose.yaw - self._mark.yaw))
        if state.pose.distance_to(self._mark) > _MOVE or turned > _TURN:
            self._mark, self._mark_time = state.pose, now
        if now - self._mark_time > _PATIENCE_SEC:
            reason = ", because an obstacle that is not on the map blocks the path" if state.touching else ""
            text = f"the robot has not moved for {_PATIENCE_SEC:g} s{reason}"
            return DriveOutcome(DriveEnd.ABORTED, NavCode.FAILED_TO_MAKE_PROGRESS, text)
        return None
