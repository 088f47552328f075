"""The stand-in for Nav2's localiser and map server: silent until it receives an initial pose, exact from then on."""

from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from sar_compiler.sim.geometry import Pose2D, normalise_angle
from sar_compiler.sim.messages import from_pose, to_grid, to_pose, to_stamp, to_transform
from sar_compiler.sim.node_host import NodeHost
from sar_compiler.sim.occupancy import OccupancyMap
from sar_compiler.sim.robot import Robot

_MAP, _ODOM = "map", "odom"
# One transform in this many steps (10 Hz at 0.05 s).
_TF_EVERY = 2
# A new pose is published after this much movement, as AMCL does: metres and radians.
_UPDATE_MOVE, _UPDATE_TURN = 0.25, 0.2
# A real localiser does not recover from an initial pose that is farther off than this: metres, radians.
_CREDIBLE_MOVE, _CREDIBLE_TURN = 1.0, 0.8
# Variances of x and y in m², and of yaw in rad².
_VARIANCES = {0: 0.01, 7: 0.01, 35: 0.005}


class Amcl:
    """Node `amcl`: `initialpose` in; `amcl_pose`, `map` → `odom`, `amcl/get_state`, and the topic `map` of Nav2's map server out.

    Args:
        host: Creates the node.
        robot: The robot whose true pose is published.
        occupancy: The map; an initial pose outside it is refused.
    """

    def __init__(self, host: NodeHost, robot: Robot, occupancy: OccupancyMap) -> None:
        self._robot, self._map = robot, occupancy
        self._localised = False
        self._published: Pose2D | None = None
        self._now_ns = 0
        self._node = host.create("amcl")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._pose = self._node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", latched)
        self._grid = self._node.create_publisher(OccupancyGrid, "map", latched)
        self._grid.publish(to_grid(occupancy))
        self._tf = self._node.create_publisher(TFMessage, "/tf", 100)
        self._node.create_subscription(PoseWithCovarianceStamped, "initialpose", self._on_initial_pose, 10)
        self._node.create_service(GetState, "amcl/get_state", _active)

    def pose(self) -> Pose2D | None:
        """Return the robot's pose in `map`, or None before an initial pose was received."""
        return self._robot.state.pose if self._localised else None

    def step(self, step: int, now_ns: int) -> None:
        """Publish what is due at the simulated time *now_ns*, nanoseconds."""
        self._now_ns = now_ns
        if not self._localised:
            return
        pose = self._robot.state.pose
        if step % _TF_EVERY == 0:
            offset = pose.compose(self._robot.state.odometry.inverse())
            self._tf.publish(TFMessage(transforms=[to_transform(_MAP, _ODOM, offset, to_stamp(now_ns))]))
        if self._published is None or _moved(pose, self._published, _UPDATE_MOVE, _UPDATE_TURN):
            self._publish(pose)

    def _on_initial_pose(self, message: Any) -> None:
        frame = message.header.frame_id
        if frame not in {_MAP, f"/{_MAP}"}:
            self._node.get_logger().error(
                f"Initial pose in frame '{frame}' ignored; it has to be in '{_MAP}'."
            )
            return
        pose = from_pose(message.pose.pose)
        if pose is None or self._map.cell_at(pose.x, pose.y) is None:
            self._node.get_logger().error("Initial pose ignored: it is malformed or outside the map.")
            return
        truth = self._robot.state.pose
        if _moved(truth, pose, _CREDIBLE_MOVE, _CREDIBLE_TURN):
            self._node.get_logger().warning(
                f"The initial pose ({pose.x:.2f}, {pose.y:.2f}, yaw={pose.yaw:.2f}) is far from the robot's "
                f"({truth.x:.2f}, {truth.y:.2f}, yaw={truth.yaw:.2f}); on a real robot this would end badly."
            )
        self._localised = True
        self._publish(truth)

    def _publish(self, pose: Pose2D) -> None:
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.header.stamp = _MAP, to_stamp(self._now_ns)
        message.pose.pose = to_pose(pose)
        for index, variance in _VARIANCES.items():
            message.pose.covariance[index] = variance
        self._pose.publish(message)
        self._published = pose


def _moved(here: Pose2D, there: Pose2D, move: float, turn: float) -> bool:
    return here.distance_to(there) > move or abs(normalise_angle(here.yaw - there.yaw)) > turn


def _active(_: Any, response: Any) -> Any:
    response.current_state = State(id=State.PRIMARY_STATE_ACTIVE, label="active")
    return response
