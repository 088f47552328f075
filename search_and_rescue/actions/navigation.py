"""Leaves that drive the robot to a zone or home. They send goals of Nav2's action `NavigateToPose`."""

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from py_trees.common import Status

from sar_compiler.leaves import (
    SUCCEEDED,
    ActionLeaf,
    Deadline,
    Kind,
    Outcome,
    Seconds,
    Use,
    describe_status,
    register,
    remaining_drive,
    turn_by,
)
from sar_compiler.missions import PROGRESS
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import MAP_FRAME, MapPose, ZoneManager

# Pause before a goal in an obstacle is sent again, seconds: some obstacles move away.
_OCCUPIED_SEC = 60.0
# Interval at which the remaining drive is recorded in the journal, seconds.
_PROGRESS_SEC = 1.0
_ABORTED = 6

# Nav2's error codes, from the action definitions of nav2_msgs. Each server has a range of a hundred codes. `NavigateToPose` returns the
# code of the server that failed.
FOR_GOOD = (101, 201, 204, 9001)
"""Error codes for goals that always fail, because a plug-in or tree is missing or the goal is outside the map."""
OCCUPIED = 206
"""The error code for a goal in an obstacle. A later attempt may succeed, because some obstacles move."""
_ROBOTS_PLACE = (203, 205)
OF_PLANNER = range(200, 300)
"""Error codes for drives for which the planner found no path."""
# For several poses Nav2 uses the codes of a single pose plus this offset.
_OF_SEVERAL, _LATER = {*range(301, 309), *range(9100, 9104)}, 100

_CODES = {
    1: "the goal was rejected by another server",
    2: "the goal could not be sent on to another server",
    101: "the requested controller does not exist",
    102: "the controller could not transform a pose",
    103: "the controller was given an invalid path",
    104: "the controller's patience was exceeded",
    105: "the robot makes no progress",
    106: "the controller found no safe velocity",
    107: "the controller took too long",
    201: "the requested planner does not exist",
    202: "the planner could not transform a pose",
    203: "the robot is outside the map",
    204: "the goal is outside the map",
    205: "the robot is in an obstacle",
    206: "the goal is in an obstacle",
    207: "the planner took too long",
    208: "there is no path to the goal",
    9001: "Nav2 could not load its behavior tree",
    9002: "Nav2 could not transform a pose",
    9003: "Nav2 took too long",
}

_RANGES = (
    (100, 199, "the controller failed"),
    (OF_PLANNER.start, OF_PLANNER.stop - 1, "the planner failed"),
    (300, 399, "the planner for several poses failed"),
    (400, 499, "the route server failed"),
    (500, 599, "the smoother failed"),
    (600, 699, "the waypoint follower failed"),
    (700, 799, "a recovery behavior failed"),
    (900, 999, "docking or following failed"),
    (9000, 9999, "the navigator failed"),
)


@dataclass(eq=False, repr=False)
class NavigateTo(ActionLeaf):
    """The base class of the leaves that drive to a zone or home. Each activation of a leaf sends one goal.

    Subclasses define the target, and what happens on arrival.

    Args:
        zone_manager: The mission's zones.
        record: Records the drive.
        action: The action's name.
        server_timeout_sec: Time to wait for a server, in seconds.
        acceptance_timeout_sec: Time to wait for the goal to be accepted, in seconds.
        feedback_timeout_sec: Maximum silence of the server, in seconds.
        hold_timeout_sec: Time to wait, in seconds, for Nav2 and its localisation, or for the end of another client's goal.
    """

    name: str
    zone_manager: ZoneManager
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)
    action: str = "navigate_to_pose"
    server_timeout_sec: Seconds = 10.0
    acceptance_timeout_sec: Seconds = 5.0
    feedback_timeout_sec: Seconds = 10.0
    hold_timeout_sec: Seconds = 60.0

    action_type = "nav2_msgs/action/NavigateToPose"
    rivals = ("navigate_to_pose", "navigate_through_poses")
    # People cannot read faster updates, and the page receives every change in any case.
    feedback_period_sec = 0.4

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self.action_name = self.action
        self._target = self._headline = ""
        self._hopeless: dict[str, tuple[str, Deadline]] = {}
        self._next_progress: Deadline | None = None

    @property
    def _needs_nav2(self) -> bool:
        return True

    def on_send(self) -> None:
        """Log the target."""
        self.feedback_message = f"navigating to {self._target}"
        self.log(f"Navigating to {self._target}...")

    def on_feedback(self, feedback: Any) -> Status | None:
        """Show the remaining distance in the feedback message, and record this distance in the journal."""
        left = remaining_drive(feedback)
        if left is None:
            self.feedback_message = f"navigating to {self._target}"
            return None
        distance, seconds = left
        self.feedback_message = f"navigating to {self._target}, {distance:.2f} m left"
        if self._next_progress is None or self._next_progress.has_passed:
            self._next_progress = Deadline(_PROGRESS_SEC, self._clock)
            figures = {"distance": round(distance, 3), "time_left": round(seconds, 1)}
            self.record.journal.record_observation(PROGRESS, target=self._target, **figures)
        return None

    def on_result(self, status: int, result: Any) -> Status:
        """Return SUCCESS on arrival. Otherwise log Nav2's reason and return FAILURE."""
        if status != SUCCEEDED:
            reason, code = describe_end(status, result, self.nav2_reason()), error_code(result)
            if code in (*FOR_GOOD, OCCUPIED):
                seconds = _OCCUPIED_SEC if code == OCCUPIED else math.inf
                self._hopeless[self._target] = reason, Deadline(seconds, self._clock)
            return self.on_failure(reason)
        self.feedback_message = f"reached {self._target}"
        self.log(f"Reached {self._target}.")
        self._on_arrival()
        return Status.SUCCESS

    def update(self) -> Status:
        """Return the leaf's status. If it is RUNNING, set a label that says whether the robot drives or waits."""
        status = super().update()
        if status is Status.RUNNING:
            waits = "not arrived" if self.has_not_arrived else "waiting for Nav2"
            self.outcome_label = waits if self.record.navigation_lost else "driving"
        return status

    def on_failure(self, reason: str) -> Status:
        """Log that the robot did not reach the target, and return FAILURE."""
        self.warn(f"Navigation to {self._target} failed: {reason}")
        return self.outcome(Status.FAILURE, "aborted")

    def on_hold(self, obstacle: str) -> None:
        """Record that navigation is unavailable."""
        self.record.navigation_lost = obstacle

    def on_available(self) -> None:
        """Record that navigation is available again."""
        self.record.navigation_lost = ""

    def on_unavailable(self, reason: str) -> Status:
        """Return FAILURE for a reason unrelated to the target. `NavigationAvailable` can detect this case."""
        self.record.navigation_lost = reason
        self.warn(f"Navigation to {self._target} is unavailable: {reason}")
        return self.outcome(Status.FAILURE, "unavailable")

    def _on_arrival(self) -> None:
        """Record the arrival at the target. Overridden by subclasses."""

    def _drive_to(self, target: str, *poses: MapPose, headline: str = "") -> Any:
        """Return the goal for poses in the frame `map`. The last pose is the target."""
        self._target = target
        reason, until = self._hopeless.get(target, ("", None))
        if until is not None and not until.has_passed:
            return self.on_failure(reason)
        if headline not in ("", self._headline):
            self._headline = headline
            self.log(headline)
        return self._message_to([self._with_stamp(pose) for pose in poses])

    def _message_to(self, poses: Sequence[Any]) -> Any:
        """Return the goal message for pose messages."""
        return self.interface.Goal(pose=poses[0])

    def _with_stamp(self, pose: MapPose) -> Any:
        from geometry_msgs.msg import PoseStamped

        message = PoseStamped()
        message.header.frame_id = MAP_FRAME
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.pose.position.x, message.pose.position.y = float(pose["x"]), float(pose["y"])
        turn_by(message.pose.orientation, pose["yaw"])
        return message


def drive_outcomes(arrived: Outcome, *failed: Outcome) -> tuple[Outcome, ...]:
    """Return all outcomes of a driving leaf, given the outcome on arrival and additional failures."""
    when = arrived.when
    return (
        arrived,
        Outcome("FAILURE", "aborted", when, "navigation_lost = false"),
        *failed,
        Outcome("FAILURE", "unavailable", when, "navigation_lost = true"),
        Outcome("RUNNING", "driving", when, "at = ''; navigation_lost = false"),
        Outcome("RUNNING", "waiting for Nav2", when, "at = ''; navigation_lost = true"),
        Outcome("RUNNING", "not arrived", when, "at = ''; navigation_lost = true"),
    )


@register(
    "NavigateToZone",
    kind=Kind.ACTION,
    effects="drives the robot to the current zone",
    uses=(Use.action("{action}"), Use.nav2()),
    outcomes=drive_outcomes(
        Outcome("SUCCESS", "arrived", "zones_left > 0", "at = 'zone'; navigation_lost = false"),
        Outcome("FAILURE", "no zone", "zones_left == 0"),
    ),
    facts={"zones_left": 3, "at": "", "navigation_lost": False},
)
class NavigateToZone(NavigateTo):
    """Drive to the current zone. The leaf succeeds on arrival, and fails if the robot does not arrive.

    If navigation is unavailable, the leaf is RUNNING for at most `hold_timeout_sec`, and then returns
    FAILURE. This failure says nothing about the zone. `NavigationAvailable` distinguishes it from other
    failures.
    """

    def goal(self) -> Any:
        """Return the goal for the current zone, SUCCESS if the zone was already searched, or FAILURE if none is left."""
        if not self.zone_manager.has_remaining():
            self.warn(f"'{self.name}' has no target: every zone has already been visited.")
            return self.outcome(Status.FAILURE, "no zone")
        zone = self.zone_manager.current_zone()
        if self.record.before.has_searched(zone["id"]):
            self.feedback_message = f"{zone['id']} was searched in an earlier run"
            return Status.SUCCESS
        self.record.zone_started(zone["id"])
        place = f"{self.zone_manager.current_index() + 1}/{self.zone_manager.total_zones()}"
        headline = f"--- Zone {place}: {zone['id']} ({zone['x']:.2f}, {zone['y']:.2f}) ---"
        return self._drive_to(zone["id"], zone, headline=headline)


@register(
    "NavigateToBase",
    kind=Kind.ACTION,
    effects="drives the robot to the base station",
    uses=(Use.action("{action}"), Use.nav2()),
    outcomes=drive_outcomes(Outcome("SUCCESS", "arrived", then="at = 'base'; navigation_lost = false")),
    facts={"at": "", "navigation_lost": False},
)
class NavigateToBase(NavigateTo):
    """Drive to the base station. The leaf succeeds on arrival, and fails if the robot does not arrive.

    Args:
        zone_manager: The mission's zones and base station.
        record: Records the return.
    """

    _told = ""

    def goal(self) -> Any:
        """Return the goal for the base station, or SUCCESS if an earlier run has already reached it."""
        if self.record.before.pop_home():
            self.feedback_message = "the robot drove home in an earlier run"
            self._on_arrival()
            return Status.SUCCESS
        headline = "" if self.zone_manager.has_remaining() else f"{self._no_zone_text()} Returning to base."
        return self._drive_to("base station", self.zone_manager.base_pose(), headline=headline)

    def _no_zone_text(self) -> str:
        abandoned = [zone["id"] for zone in self.zone_manager.abandoned_zones()]
        return (
            f"No zone is left. Abandoned zones: {', '.join(abandoned)}."
            if abandoned
            else "All zones visited."
        )

    def _on_arrival(self) -> None:
        self.record.base_reached()
        shortfalls = self.record.shortfalls(self.zone_manager)
        told = "Mission complete."
        if shortfalls:
            # The log states the shortfalls on arrival. A stored report may still be delivered at the base station.
            told = " ".join(["Back at base with the mission incomplete:", *shortfalls])
        if told != self._told:
            self._told = told
            self.log(told)


def describe_end(status: int, result: Any, said: str = "") -> str:
    """Describe why a drive failed, as text for a log message.

    Args:
        status: The goal's status, a constant of `action_msgs/msg/GoalStatus` other than success.
        result: The result of `nav2_msgs/action/NavigateToPose`. In older versions, the result has no error
            code.
        said: Log output of Nav2's nodes during the drive.

    Returns:
        Status and error code, each as a number and in words, and Nav2's reason if Nav2 stated one.
    """
    code = error_code(result)
    own = str(getattr(result, "error_msg", ""))
    words = own or _describe_code(code, aborted=status == _ABORTED)
    quoted = f" ({said})" if said and not own else ""
    return f"{describe_status(status)}, error code {getattr(result, 'error_code', 0)}: {words}{quoted}{_advice(code)}"


def error_code(result: Any) -> int:
    """Return the error code of a result. Replace a code for several poses by the code for a single pose."""
    code = int(getattr(result, "error_code", 0))
    return code - _LATER if code in _OF_SEVERAL else code


def _advice(code: int) -> str:
    if code in FOR_GOOD:
        return "; the goal is not sent again"
    return "; the robot cannot reach any goal from this position" if code in _ROBOTS_PLACE else ""


def _describe_code(code: int, *, aborted: bool) -> str:
    if code == 0:
        # Nav2 aborts without a code for many reasons: a server that was late or has crashed, an inactive node, a missing pose.
        return "no code" if aborted else "none"
    if code in _CODES:
        return _CODES[code]
    ranges = (words for first, last, words in _RANGES if first <= code <= last)
    return next(ranges, "an unknown code")
