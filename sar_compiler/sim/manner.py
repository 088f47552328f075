"""How exactly, how fast and with how many recoveries the stand-in for Nav2 drives."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from sar_compiler.sim.follower import FollowerSettings
from sar_compiler.sim.placement import NAV2_NAME, QUICK_NAME
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
    """

    speed: float = math.inf
    turn: float = math.inf
    follower: FollowerSettings = field(default_factory=FollowerSettings)
    tolerance: float = 0.0
    recoveries: tuple[Recovery, ...] = ()
    knows_distance_at_once: bool = True

    def limits(self, limits: Limits) -> Limits:
        """Return a drive's limits where the robot has these."""
        return replace(limits, speed=min(limits.speed, self.speed), turn=min(limits.turn, self.turn))


QUICK = Manner()
"""To the point, and giving up at once: what rehearsals and tests want."""

_CLEAR = Recovery("clears its costmaps", STAND, 1.0)
_SPIN = Recovery("spins", Twist2D(0.0, 1.0), math.pi / 2)
_WAIT = Recovery("waits", STAND, 5.0)
_BACK_UP = Recovery("backs up", Twist2D(-0.15, 0.0), 2.0)

# What navigate_to_pose_w_replanning_and_recovery.xml of 1.3.13 does with config/nav2_params.yaml; seen in flight.
NAV2 = Manner(
    speed=0.4,
    turn=1.0,
    follower=FollowerSettings(look_ahead=0.6, position_tolerance=0.25, yaw_tolerance=0.25),
    tolerance=0.25,
    recoveries=(_CLEAR, _SPIN, _WAIT, _BACK_UP, _CLEAR, _SPIN),
    knows_distance_at_once=False,
)
"""As Nav2 does with the shipped parameters."""

MANNERS: Mapping[str, Manner] = MappingProxyType({QUICK_NAME: QUICK, NAV2_NAME: NAV2})
