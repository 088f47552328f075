"""How exactly, how fast and with how many recoveries the stand-in for Nav2 drives."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

from sar_compiler import resources
from sar_compiler.ros.parameter_file import read_parameter_file
from sar_compiler.sim.follower import FollowerSettings
from sar_compiler.sim.placement import NAV2_NAME
from sar_compiler.sim.robot import STAND, Limits, Twist2D


@dataclass(frozen=True)
class Recovery:
    """What is done before a goal is tried again.

    Attributes:
        name: What the robot does.
        command: The velocity meanwhile.
        duration_sec: How long it takes, simulated seconds.
    """

    name: str
    command: Twist2D
    duration_sec: float


@dataclass(frozen=True)
class Manner:
    """How the stand-in drives.

    Attributes:
        speed: The highest speed of a drive, m/s.
        turn: The same of a turn, rad/s.
        follower: The parameters of path following.
        tolerance: How far from its goal a path may end where the goal itself is occupied, metres.
        recoveries: What is done one after the other, with a try after each, before a goal is given up.
        knows_distance_at_once: Whether the first feedback has the distance; else it has 0.
        server_timeout_sec: How long whoever drives may take to take a goal, where it is a process of its own; seconds.
    """

    speed: float = math.inf
    turn: float = math.inf
    follower: FollowerSettings = field(default_factory=FollowerSettings)
    tolerance: float = 0.0
    recoveries: tuple[Recovery, ...] = ()
    knows_distance_at_once: bool = True
    server_timeout_sec: float = 1.0

    def limits(self, limits: Limits) -> Limits:
        """Return a drive's limits where the robot has these."""
        return replace(limits, speed=min(limits.speed, self.speed), turn=min(limits.turn, self.turn))


QUICK = Manner()
"""To the point, and giving up at once: what rehearsals and tests want."""

_CLEAR = Recovery("clears its costmaps", STAND, 1.0)
_SPIN = Recovery("spins", Twist2D(0.0, 1.0), math.pi / 2)
_WAIT = Recovery("waits", STAND, 5.0)
_BACK_UP = Recovery("backs up", Twist2D(-0.15, 0.0), 2.0)

# What navigate_to_pose_w_replanning_and_recovery.xml of 1.3.13 does; seen in flight.
_RECOVERIES = (_CLEAR, _SPIN, _WAIT, _BACK_UP, _CLEAR, _SPIN)


@cache
def manner(name: str) -> Manner:
    """Return the manner of a name, one of `placement.MANNER_NAMES`."""
    return like_nav2(resources.shipped("config", "nav2_params.yaml")) if name == NAV2_NAME else QUICK


def like_nav2(parameters: Path) -> Manner:
    """Return how Nav2 drives with a parameter file; what it does not say is as Nav2 has it by default.

    Raises:
        ParameterFileError: If the file has mistakes.
    """
    controller, planner, navigator = (
        read_parameter_file(parameters, f"/{node}")
        for node in ("controller_server", "planner_server", "bt_navigator")
    )
    path, goal = (
        _plugin(controller, "controller_plugins", "FollowPath"),
        _plugin(controller, "goal_checker_plugins", "goal_checker"),
    )
    grid = _plugin(planner, "planner_plugins", "GridBased")
    return Manner(
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
    )


def _plugin(parameters: dict[str, object], name: str, default: str) -> str:
    """Return the first of a server's plugins."""
    plugins = parameters.get(name)
    return str(plugins[0]) if isinstance(plugins, Sequence) and plugins else default


def _number(parameters: dict[str, object], name: str, default: float) -> float:
    value = parameters.get(name, default)
    return float(value) if isinstance(value, (int, float)) else default
