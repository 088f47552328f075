"""Three leaves that drive a robot by its odometry: a condition, an action and a recovery.

Use them as examples for your own leaves. They are py_trees behaviours, and the parameters of their constructors are
the attributes in a tree file. `TopicLeaf` subscribes to the odometry.
"""

import math
from abc import abstractmethod
from typing import Any

from py_trees.common import Status

from sar_compiler.leaves import Kind, TopicLeaf, Use, planar_pose, register


class _OdometryLeaf(TopicLeaf):
    """Base class of leaves that use the robot's pose from the odometry."""

    topic_type = "nav_msgs/msg/Odometry"
    topic_name = "odometry/filtered"
    max_age_sec = 0.5

    def check_message(self, message: Any) -> None:
        """Reject a message with an invalid pose, such as NaN. The leaf then behaves as without a message."""
        planar_pose(message.pose.pose)

    def on_message(self, message: Any) -> Status:
        """Return the status for the robot's pose, in the odometry's frame."""
        return self.on_pose(*planar_pose(message.pose.pose))

    @abstractmethod
    def on_pose(self, x: float, y: float, yaw: float) -> Status:
        """Return the status for the robot's pose (m, m, rad)."""


class _DrivingLeaf(_OdometryLeaf):
    """Base class of leaves that send velocity commands, and stop the robot when they end."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._commands: Any = None

    def setup(self, **kwargs: Any) -> None:
        """Also create the publisher of `cmd_vel`.

        Args:
            kwargs: Contains `node`, the rclpy node.
        """
        from geometry_msgs.msg import TwistStamped

        super().setup(**kwargs)
        self._commands = self.node.create_publisher(TwistStamped, "cmd_vel", 10)

    def shutdown(self) -> None:
        """Remove the publisher."""
        self._commands = None
        super().shutdown()

    def on_silence(self) -> Status:
        """Stop the robot while its pose is unknown."""
        self.feedback_message = "no odometry"
        self.command(0.0, 0.0)
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002
        """Stop the robot after any end of the leaf."""
        if self._commands is not None:
            self.command(0.0, 0.0)

    def command(self, linear: float, angular: float) -> None:
        """Publish a velocity command in m/s and rad/s."""
        from geometry_msgs.msg import TwistStamped

        message = TwistStamped()
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.header.frame_id = "base_link"
        message.twist.linear.x = linear
        message.twist.angular.z = angular
        self._commands.publish(message)


@register(
    "GoalNotReached",
    kind=Kind.CONDITION,
    outcomes={Status.SUCCESS, Status.FAILURE},
    uses=[Use.topic("odometry/filtered")],
)
class GoalNotReached(_OdometryLeaf):
    """Return SUCCESS while the robot is away from the goal or its pose is unknown.

    Args:
        name: The node's name.
        goal_x: x of the goal in the odometry's frame, metres.
        goal_y: y of the goal in the odometry's frame, metres.
        tolerance: The tolerated distance, metres.
    """

    def __init__(self, name: str, goal_x: float = 2.0, goal_y: float = 0.0, tolerance: float = 0.3) -> None:
        super().__init__(name)
        self._goal = (goal_x, goal_y)
        self._tolerance = tolerance

    def on_pose(self, x: float, y: float, yaw: float) -> Status:  # noqa: ARG002 - only the position matters
        """Compare the distance with the tolerance."""
        distance = math.dist(self._goal, (x, y))
        self.feedback_message = f"{distance:.2f} m to go"
        return Status.SUCCESS if distance > self._tolerance else Status.FAILURE

    def on_silence(self) -> Status:
        """Return SUCCESS, because the goal may not be reached yet."""
        self.feedback_message = "no odometry"
        return Status.SUCCESS


@register(
    "DriveForward",
    kind=Kind.ACTION,
    outcomes={Status.RUNNING},
    effects="drives the robot",
    uses=[Use.topic("odometry/filtered")],
)
class DriveForward(_DrivingLeaf):
    """Drive towards the goal with a proportional controller. Always return RUNNING.

    Args:
        name: The node's name.
        goal_x: x of the goal in the odometry's frame, metres.
        goal_y: y of the goal in the odometry's frame, metres.
        k_rho: Gain of the speed: m/s per metre of distance.
        k_alpha: Gain of the rotation: rad/s per radian of bearing.
    """

    def __init__(
        self, name: str, goal_x: float = 2.0, goal_y: float = 0.0, k_rho: float = 0.4, k_alpha: float = 0.8
    ) -> None:
        super().__init__(name)
        self._goal = (goal_x, goal_y)
        self._k_rho = k_rho
        self._k_alpha = k_alpha

    def on_pose(self, x: float, y: float, yaw: float) -> Status:
        """Send the next command."""
        distance = math.dist(self._goal, (x, y))
        bearing = _wrap_angle(math.atan2(self._goal[1] - y, self._goal[0] - x) - yaw)
        self.feedback_message = f"{distance:.2f} m to go"
        self.command(self._k_rho * distance, self._k_alpha * bearing)
        return Status.RUNNING


@register(
    "SpinInPlace",
    kind=Kind.ACTION,
    outcomes={Status.RUNNING, Status.SUCCESS},
    effects="turns the robot",
    uses=[Use.topic("odometry/filtered")],
)
class SpinInPlace(_DrivingLeaf):
    """Turn to a heading with a proportional controller. Return SUCCESS when the heading is reached.

    Args:
        name: The node's name.
        goal_yaw: The target heading in the odometry's frame, radians.
        k_yaw: Gain of the rotation: rad/s per radian.
        tolerance: The tolerated difference, radians.
    """

    def __init__(self, name: str, goal_yaw: float = 0.0, k_yaw: float = 0.8, tolerance: float = 0.3) -> None:
        super().__init__(name)
        self._goal_yaw = goal_yaw
        self._k_yaw = k_yaw
        self._tolerance = tolerance

    def on_pose(self, x: float, y: float, yaw: float) -> Status:  # noqa: ARG002 - only the heading matters
        """Send the next command."""
        error = _wrap_angle(self._goal_yaw - yaw)
        self.feedback_message = f"{math.degrees(error):.0f} degrees to turn"
        if abs(error) <= self._tolerance:
            return Status.SUCCESS
        self.command(0.0, self._k_yaw * error)
        return Status.RUNNING


def _wrap_angle(angle: float) -> float:
    """Return the angle in the range from -pi to pi."""
    return math.remainder(angle, math.tau)
