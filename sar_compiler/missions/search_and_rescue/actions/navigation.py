"""Driving to the zones and home: goals for Nav2's action `NavigateToPose`."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

from py_trees.common import Status

from sar_compiler.missions.search_and_rescue.actions.nav2_errors import describe_end
from sar_compiler.missions.search_and_rescue.frames import MAP_FRAME
from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import Pose, ZoneManager
from sar_compiler.nodes import Answer, Kind, Use, register
from sar_compiler.ros.leaves.errors import MissingNodeError
from sar_compiler.ros.leaves.goal import ActionGoal, ActionPort, GoalDeadlines, GoalEnd
from sar_compiler.ros.leaves.leaf import RosLeaf

_OUTCOMES = {Status.SUCCESS, Status.FAILURE, Status.RUNNING}
_USES = [Use.action("{action}"), Use.nav2()]


@dataclass(frozen=True)
class Target:
    """Where to drive.

    Attributes:
        label: What the log calls it.
        pose: The pose in the frame `map`.
        headline: What the log says above the drive; said once for repeated drives to one target.
    """

    label: str
    pose: Pose
    headline: str = ""


class NavigateTo(RosLeaf):
    """What driving to a zone and driving home have in common: one goal for each activation.

    Subclasses say where to drive, and what arriving means.

    Args:
        name: The node's name.
        zone_manager: The mission's zones.
        record: Where the drive is noted.
        action: The action's name.
        server_timeout_sec: How long to wait for a server, seconds.
        acceptance_timeout_sec: How long to wait for the goal to be accepted, seconds.
        feedback_timeout_sec: How long a server may be silent or gone, seconds.
    """

    def __init__(
        self,
        name: str,
        zone_manager: ZoneManager,
        *,
        record: MissionRecord | None = None,
        action: str = "navigate_to_pose",
        server_timeout_sec: float = 10.0,
        acceptance_timeout_sec: float = 5.0,
        feedback_timeout_sec: float = 10.0,
    ) -> None:
        super().__init__(name)
        self._zones = zone_manager
        self._record = record or MissionRecord()
        self._action = action
        self._deadlines = GoalDeadlines(server_timeout_sec, acceptance_timeout_sec, feedback_timeout_sec)
        self._port: ActionPort | None = None
        self._target: Target | None = None
        self._goal: ActionGoal | None = None
        self._goals_given_up: list[ActionGoal] = []
        self._verdict = Status.INVALID
        self._headline = ""

    def setup(self, **kwargs: Any) -> None:
        """Make the action's clients; does not wait for a server.

        Args:
            **kwargs: `node` and optionally `wake`, see `RosLeaf`.
        """
        from nav2_msgs.action import NavigateToPose

        self.shutdown()
        super().setup(**kwargs)
        self._port = ActionPort(self.node, NavigateToPose, self._action)

    def initialise(self) -> None:
        """Start one drive."""
        self._drop_goal()
        self._verdict = Status.RUNNING
        self._target = self._choose_target()
        if self._target is None:
            self.complain(f"'{self.name}' has nowhere to drive to: every zone is visited.")
            self._verdict = Status.FAILURE
            return
        if self._target.headline not in ("", self._headline):
            self._headline = self._target.headline
            self.say(self._headline)
        self._goal = self._make_goal(self._target)
        self._advance(self._goal, self._target)
        if not self._goal.sent and self._goal.end is None:
            self.feedback_message = f"waiting for a server of '{self._action}'"
            self.say(f"Waiting for the action server {self._action}...")

    def update(self) -> Status:
        """Say how the drive stands."""
        if self._verdict is Status.RUNNING and self._goal is not None and self._target is not None:
            self._advance(self._goal, self._target)
            if self._goal.end is not None:
                self._verdict = self._conclude(self._goal.end, self._target)
        return self._verdict

    def terminate(self, new_status: Status) -> None:
        """Cancel the drive if it was interrupted."""
        if new_status is Status.INVALID:
            self._drop_goal()

    def shutdown(self) -> None:
        """Cancel what is still under way, and release the clients.

        While a cancel is unanswered they are left to the node: a goal that is accepted only now must still
        be cancelled.
        """
        self._drop_goal()
        if self._port is not None and self.settled():
            self._port.release()
        self._port = None
        super().shutdown()

    def settled(self) -> bool:
        """Say whether the server has answered every cancel; one that is gone will not."""
        self._goals_given_up = [goal for goal in self._goals_given_up if not goal.settled]
        under_way = bool(self._goals_given_up) or not (self._goal is None or self._goal.settled)
        return not (under_way and self._port is not None and self._port.server_is_ready)

    @abstractmethod
    def _choose_target(self) -> Target | None:
        """Return where to drive now, or None if there is nowhere."""

    def _on_arrival(self) -> None:
        """Do what arriving means."""

    def _make_goal(self, target: Target) -> ActionGoal:
        from nav2_msgs.action import NavigateToPose

        if self._port is None:
            raise MissingNodeError(self.name, type(self).__name__)
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = MAP_FRAME
        goal.pose.header.stamp = self.node.get_clock().now().to_msg()
        goal.pose.pose.position.x = float(target.pose["x"])
        goal.pose.pose.position.y = float(target.pose["y"])
        # A turn about z alone.
        goal.pose.pose.orientation.z = math.sin(target.pose["yaw"] / 2)
        goal.pose.pose.orientation.w = math.cos(target.pose["yaw"] / 2)
        return ActionGoal(self._port, goal, self._deadlines, self._wake)

    def _advance(self, goal: ActionGoal, target: Target) -> None:
        sent_before = goal.sent
        goal.advance()
        if goal.sent and not sent_before:
            self.say(f"Navigating to {target.label}...")
        if goal.sent:
            left = getattr(goal.feedback, "distance_remaining", None)
            distance = "" if left is None else f", {left:.2f} m left"
            self.feedback_message = f"navigating to {target.label}{distance}"

    def _conclude(self, end: GoalEnd, target: Target) -> Status:
        if end.succeeded:
            self.feedback_message = f"reached {target.label}"
            self.say(f"Reached {target.label}.")
            self._on_arrival()
            return Status.SUCCESS
        reason = end.trouble
        if end.status is not None:
            reason = describe_end(end.status, end.result)
        self.complain(f"Navigation to {target.label} failed: {reason}")
        return Status.FAILURE

    def _drop_goal(self) -> None:
        if self._goal is None:
            return
        if self._goal.in_flight:
            self.say(f"Canceling the goal of '{self.name}'.")
        self._goal.abandon()
        self._goals_given_up = [goal for goal in (*self._goals_given_up, self._goal) if not goal.settled]
        self._goal = None
        if self._verdict is Status.RUNNING:
            self._verdict = Status.FAILURE


@register(
    "NavigateToZone",
    kind=Kind.ACTION,
    outcomes=_OUTCOMES,
    effects="drives the robot to the current zone",
    uses=_USES,
    answers=[
        Answer("SUCCESS", "arrived", "zones_left > 0", "at = 'zone'"),
        Answer("FAILURE", "aborted", "zones_left > 0"),
        Answer("FAILURE", "no zone", "zones_left == 0"),
        Answer("RUNNING", "driving", "zones_left > 0", "at = ''"),
    ],
    facts={"zones_left": 3, "at": ""},
)
class NavigateToZone(NavigateTo):
    """Drive to the current zone: RUNNING on the way, SUCCESS on arrival, FAILURE if Nav2 does not get there.

    Args:
        name: The node's name.
        zone_manager: The mission's zones.
        record: Where the drive is noted.
        action: The action's name.
        server_timeout_sec: How long to wait for a server, seconds.
        acceptance_timeout_sec: How long to wait for the goal to be accepted, seconds.
        feedback_timeout_sec: How long a server may be silent or gone, seconds.
    """

    def _choose_target(self) -> Target | None:
        if not self._zones.has_remaining():
            return None
        zone = self._zones.current_zone()
        self._record.zone_started(zone["id"])
        place = f"{self._zones.current_index() + 1}/{self._zones.total_zones()}"
        return Target(
            label=zone["id"],
            pose=zone,
            headline=f"--- Zone {place}: {zone['id']} ({zone['x']:.2f}, {zone['y']:.2f}) ---",
        )


@register(
    "NavigateToBase",
    kind=Kind.ACTION,
    outcomes=_OUTCOMES,
    effects="drives the robot to the base station",
    uses=_USES,
    answers=[
        Answer("SUCCESS", "arrived", then="at = 'base'"),
        Answer("FAILURE", "aborted"),
        Answer("RUNNING", "driving", then="at = ''"),
    ],
    facts={"at": ""},
)
class NavigateToBase(NavigateTo):
    """Drive to the base station: RUNNING on the way, SUCCESS on arrival, FAILURE if Nav2 does not get there.

    Args:
        name: The node's name.
        zone_manager: The mission's zones and base station.
        record: Where the return is noted.
        action: The action's name.
        server_timeout_sec: How long to wait for a server, seconds.
        acceptance_timeout_sec: How long to wait for the goal to be accepted, seconds.
        feedback_timeout_sec: How long a server may be silent or gone, seconds.
    """

    _mission_complete = False

    def _choose_target(self) -> Target:
        headline = "" if self._zones.has_remaining() else f"{self._visited()} Returning to base."
        return Target(label="base station", pose=self._zones.base_pose(), headline=headline)

    def _visited(self) -> str:
        abandoned = [zone["id"] for zone in self._zones.abandoned_zones()]
        return f"No zone is left; abandoned: {', '.join(abandoned)}." if abandoned else "All zones visited."

    def _on_arrival(self) -> None:
        self._record.base_reached()
        given_up = self._record.zones_abandoned or self._record.reports_kept
        if not self._mission_complete and not given_up:
            self._mission_complete = True
            self.say("Mission complete.")
