"""A substitute for Nav2's localiser and map server."""

from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from lifecycle_msgs.srv import GetState
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from sar_compiler.sim.geometry import ORIGIN, Pose2D, normalise_angle
from sar_compiler.sim.messages import from_pose, set_lifecycle_state, to_grid, to_pose, to_stamp, to_transform
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.robot import Robot

_MAP, _ODOM = "map", "odom"
# The number of steps between two transforms (10 Hz with steps of 0.05 s).
_TF_EVERY = 2
# The movement after which a new pose is published, as by AMCL: metres and radians.
_UPDATE_MOVE, _UPDATE_TURN = 0.25, 0.2
# The pose error above which the robot drives to wrong positions: metres and radians.
_NOTABLE_MOVE, _NOTABLE_TURN = 0.3, 0.3
# Variances of x and y in m², and of yaw in rad².
_VARIANCES = {0: 0.01, 7: 0.01, 35: 0.005}


class Amcl:
    """The node `amcl`, which receives `initialpose` and publishes `amcl_pose`, the transform `map` → `odom`, and the topic `map`.

    The node also serves `amcl/get_state`. The substitute does not compare laser scans with the map. So if the initial pose is wrong, the
    error remains, and the robot misses its goals by this error.

    Args:
        host: Creates the node.
        robot: The robot.
        occupancy: The map; an initial pose outside the map is refused.
        localised: Whether the node knows the robot's pose without an initial pose.
    """

    def __init__(
        self,
        host: NodeHost,
        robot: Robot,
        occupancy: OccupancyMap,
        *,
        localised: bool = False,
    ) -> None:
        self._host, self._robot, self._map = host, robot, occupancy
        # The transform from the true pose to the estimated pose, both in `map`; None before there is an estimate.
        self._error: Pose2D | None = ORIGIN if localised else None
        self._published: Pose2D | None = None
        self._now_ns = 0
        self._node = host.create("amcl")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._pose = self._node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)
        self._grid = self._node.create_publisher(OccupancyGrid, "map", latched)
        self._grid.publish(to_grid(occupancy))
        self._tf = self._node.create_publisher(TFMessage, "/tf", 100)
        self._node.create_subscription(PoseWithCovarianceStamped, "initialpose", self._on_initial_pose, 10)
        self._node.create_service(
            GetState, "amcl/get_state", lambda _, response: set_lifecycle_state(response, active=True)
        )

    def die(self) -> None:
        """Simulate a crash: destroy the node without notifying other nodes."""
        self._node.get_logger().warning("Fault: amcl disappears.")
        self._host.destroy(self._node)

    def pose(self) -> Pose2D | None:
        """Return the robot's estimated pose in `map`, or None before an initial pose was received."""
        return None if self._error is None else self._error.compose(self._robot.state.pose)

    def step(self, step: int, now_ns: int) -> None:
        """Publish the messages that are due at the simulated time *now_ns*, in nanoseconds."""
        self._now_ns = now_ns
        pose = self.pose()
        if pose is None:
            return
        if step % _TF_EVERY == 0:
            offset = pose.compose(self._robot.state.odometry.inverse())
            self._tf.publish(TFMessage(transforms=[to_transform(_MAP, _ODOM, offset, to_stamp(now_ns))]))
        if self._published is None or _differs(pose, self._published, _UPDATE_MOVE, _UPDATE_TURN):
            self._publish(pose)

    def _on_initial_pose(self, message: Any) -> None:
        frame = message.header.frame_id
        if frame not in {_MAP, f"/{_MAP}"}:
            self._node.get_logger().error(
                f"The initial pose was ignored, because it is in the frame '{frame}'. Send the pose in the frame '{_MAP}'."
            )
            return
        pose = from_pose(message.pose.pose)
        if pose is None or self._map.cell_at(pose.x, pose.y) is None:
            self._node.get_logger().error(
                "The initial pose was ignored, because it is malformed or outside the map."
            )
            return
        self._set_estimate(pose)

    def _set_estimate(self, pose: Pose2D) -> None:
        truth = self._robot.state.pose
        if _differs(truth, pose, _NOTABLE_MOVE, _NOTABLE_TURN):
            self._node.get_logger().warning(
                f"The initial pose ({pose.x:.2f}, {pose.y:.2f}, yaw={pose.yaw:.2f}) differs from the robot's true pose "
                f"({truth.x:.2f}, {truth.y:.2f}, yaw={truth.yaw:.2f}). The robot will miss its goals by this error."
            )
        self._error = pose.compose(truth.inverse())
        self._publish(pose)

    def _publish(self, pose: Pose2D) -> None:
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.header.stamp = _MAP, to_stamp(self._now_ns)
        message.pose.pose = to_pose(pose)
        for index, variance in _VARIANCES.items():
            message.pose.covariance[index] = variance
        self._pose.publish(message)
        self._published = pose


def _differs(pose: Pose2D, other: Pose2D, move: float, turn: float) -> bool:
    return pose.distance_to(other) > move or abs(normalise_angle(pose.yaw - other.yaw)) > turn
