"""Check with the localisation that the robot has arrived at the destination of its navigation goal.

A server that reports success does not prove that the robot has arrived. A stand-in for the server, a restarted server, or a server that
uses another localisation may report success although the robot has not moved.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.clock import AWAKE, Deadline
from sar_compiler.ros.leaves.leaf import interface_name
from sar_compiler.ros.message_values import goal_position
from sar_compiler.ros.nav2_parameters import nav2_parameters
from sar_compiler.ros.robot_estimate import robot_estimate

if TYPE_CHECKING:
    from rclpy.node import Node

EXTRA_TOLERANCE_M = 0.5
"""The distance that is added to Nav2's goal tolerance, in metres, because this localisation may differ from Nav2's estimate."""

# Maximum delay with which the localisation follows the robot, in seconds.
_FOLLOWS_SEC = 2.0


# Since ROS 2 Kilted, the poses of NavigateThroughPoses are in a separate message type.
_POSES: dict[str, Callable[[Any], Any]] = {
    "nav2_msgs/action/NavigateToPose": lambda goal: [goal.pose],
    "nav2_msgs/action/NavigateThroughPoses": lambda goal: getattr(goal.poses, "goals", goal.poses),
    "nav2_msgs/action/FollowWaypoints": lambda goal: goal.poses,
}


def drives_to_pose(interface: Any) -> bool:
    """Return whether the goals of an action end at a pose. *interface* is the Python class of the action."""
    return interface_name(interface) in _POSES


def goal_destination(interface: Any, goal: Any) -> tuple[float, float] | None:
    """Return the position at which a goal of Nav2 ends.

    Args:
        interface: The Python class of the action.
        goal: The goal, an `interface.Goal`.

    Returns:
        x and y, in metres in the frame `map`; None if goals of the action do not end at a pose, or the pose is in another frame.
    """
    poses = _POSES[interface_name(interface)](goal) if drives_to_pose(interface) else []
    return goal_position(poses[-1]) if poses else None


class Arrival:
    """Compares the destination of a succeeded goal with the robot's position according to the localisation.

    Args:
        node: The node that has sent the goal.
        destination: The position at which the goal ends, in metres in the frame `map`.
    """

    def __init__(self, node: "Node", destination: tuple[float, float]) -> None:
        self._node, self._robot, self._destination = node, robot_estimate(node), destination
        self._due: tuple[Deadline, ...] = ()

    @property
    def tolerance_m(self) -> float:
        """The maximum distance from the destination, in metres, at which the robot counts as arrived."""
        given = self._robot.arrival_tolerance_m
        return nav2_parameters(self._node).goal_tolerance + EXTRA_TOLERANCE_M if given is None else given

    @property
    def distance_m(self) -> float | None:
        """The distance of the robot from the destination, in metres; None if the localisation does not provide a pose."""
        place = self._robot.current_pose()
        return None if place is None else math.dist(place[:2], self._destination)

    def is_awaited(self) -> bool:
        """Return whether the localisation may still report an earlier position, so that the leaf must wait."""
        if not self.reason_against:
            return False
        if not self._due:
            # The time must pass on both clocks: a fast simulation does not make the network faster, and a paused simulation sends no poses.
            self._due = Deadline(_FOLLOWS_SEC, AWAKE), Deadline(_FOLLOWS_SEC, self._robot.clock)
        return not all(each.has_passed for each in self._due)

    @property
    def reason_against(self) -> str:
        """The reason why the robot has not arrived; empty if the robot has arrived or its position is unknown."""
        distance = self.distance_m
        if distance is None or distance <= self.tolerance_m:
            return ""
        return f"the localisation places the robot {distance:.2f} m away from the goal ({self.tolerance_m:.2f} m are allowed)"
