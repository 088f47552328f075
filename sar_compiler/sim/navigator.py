"""The execution of one goal like Nav2's, without ROS: plan, drive, check the progress, brake."""

from dataclasses import dataclass
from enum import Enum

from sar_compiler.sim.follower import Follower
from sar_compiler.sim.geometry import Pose2D, normalise_angle
from sar_compiler.sim.manner import QUICK, Manner
from sar_compiler.sim.planner import NavCode, Planner
from sar_compiler.sim.robot import STAND, Limits, RobotState, Twist2D

# Without this much movement in this much simulated time the robot counts as stuck.
_MOVE, _TURN, _PATIENCE_SEC = 0.2, 0.4, 10.0
# Slower than this counts as standing: m/s and rad/s.
_STILL = 0.02
# The speed that time estimates assume while the robot has none, m/s.
_CRUISE = 0.4


class DriveEnd(Enum):
    """The end of a goal."""

    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    ABORTED = "aborted"


@dataclass(frozen=True)
class DriveOutcome:
    """The end of a goal with its reason.

    Attributes:
        ending: The kind of end.
        code: Nav2's error code, one of `NavCode` unless a fault says another.
        text: The reason in words, or "".
    """

    ending: DriveEnd
    code: int = NavCode.NONE
    text: str = ""


@dataclass(frozen=True)
class DriveProgress:
    """The state of a drive after a step.

    Attributes:
        command: The next velocity command.
        elapsed_sec: Simulated seconds since the start of the goal.
        distance_remaining: Remaining distance, metres.
        time_remaining_sec: Estimate, simulated seconds.
        outcome: The end of the goal; None until then.
    """

    command: Twist2D
    elapsed_sec: float
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
        now: Simulated time, seconds.
        manner: How it is driven.

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
        manner: Manner = QUICK,
    ) -> None:
        self.goal = goal
        self.path = planner.plan(start, goal, manner.tolerance)
        self._follower = Follower(self.path, goal.yaw, manner.limits(limits), manner.follower)
        self._began = now
        self._mark, self._mark_time = start, now
        self._braking = False

    def brake(self) -> None:
        """Stop the robot and end as canceled."""
        self._braking = True

    def step(self, state: RobotState, now: float) -> DriveProgress:
        """Return the progress and the next command for the robot's state.

        Args:
            state: The robot's current state.
            now: Simulated time, seconds.
        """
        command = STAND if self._braking else self._follower.command(state)
        left = self._follower.distance_remaining(state.pose)
        elapsed = now - self._began
        speed = max(abs(state.velocity.v), _CRUISE)
        return DriveProgress(command, elapsed, left, left / speed, self._outcome(state, now))

    def _outcome(self, state: RobotState, now: float) -> DriveOutcome | None:
        if self._braking:
            still = abs(state.velocity.v) < _STILL and abs(state.velocity.w) < _STILL
            return DriveOutcome(DriveEnd.CANCELED) if still else None
        if self._follower.done:
            return DriveOutcome(DriveEnd.SUCCEEDED)
        turned = abs(normalise_angle(state.pose.yaw - self._mark.yaw))
        if state.pose.distance_to(self._mark) > _MOVE or turned > _TURN:
            self._mark, self._mark_time = state.pose, now
        if now - self._mark_time > _PATIENCE_SEC:
            reason = ": something that is not on the map is in its way" if state.touching else ""
            text = f"the robot has not moved for {_PATIENCE_SEC:g} s{reason}"
            return DriveOutcome(DriveEnd.ABORTED, NavCode.FAILED_TO_MAKE_PROGRESS, text)
        return None
