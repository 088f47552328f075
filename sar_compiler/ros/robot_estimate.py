"""The state estimate of a robot: pose, motion, localisation, and states of lifecycle nodes.

All parts of a run that use a node share the node's estimate, so that the node has only one subscription to each topic.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from sar_compiler.missions.parameter_reader import SETTLE_SEC
from sar_compiler.nodes.nav2.log_lines import DRIVING_NODES
from sar_compiler.ros.clock import AWAKE, ClockedTime, Deadline, NodeTime, deadline_clock
from sar_compiler.ros.frame_sources import child_frames, frame_sources
from sar_compiler.ros.graph_queries import join_names, ros_graph
from sar_compiler.ros.leaves.goals import active_goals_of
from sar_compiler.ros.leaves.leaf import RosLeaf, of_node, qos_profile
from sar_compiler.ros.lifecycle import LifecycleNodes, LifecycleState
from sar_compiler.ros.message_values import (
    MAP_FRAME,
    PlanarPose,
    UnusableValueError,
    localised_pose,
    node_sec,
    read_odometry,
    read_transform,
    stamp_age,
    value_reports,
)
from sar_compiler.runtime.leaf_protocol import Wake

if TYPE_CHECKING:
    from rclpy.node import Node

# A robot stands still if its speeds (m/s and rad/s) have been below these limits for this time, in seconds of the node's clock.
_STANDS_MPS, _STANDS_RADPS, _STANDS_SEC = 0.02, 0.05, 0.5
# Maximum time without a transform from `map`, in seconds. AMCL publishes about ten transforms a second while the robot's scanner works.
TRANSFORM_SEC = 3.0
# Odometry shows the current motion for at most this time after its arrival, in seconds of awake time.
_FRESH_SEC = 1.0
# Maximum age of odometry and transforms according to their time stamps, in seconds of the node's clock.
_MAX_AGE_SEC = 30.0
# The frame name `map` in a serialised transform.
FROM_MAP = b"\x04\x00\x00\x00map\x00"

PoseListener = Callable[[PlanarPose], None]


class RobotEstimate:
    """The state estimate of a node's robot; created by `robot_estimate`.

    Args:
        node: The rclpy node that subscribes to the robot's topics.

    Attributes:
        clock: The clock that measures waits for the robot.
        pose: The latest usable pose of `amcl_pose`, in the frame `map`; None if no such pose has arrived.
        pose_at: The time of arrival of `pose`, in seconds of awake time; minus infinity if no pose has arrived.
        pose_problem: The reason why the latest message of `amcl_pose` is unusable; empty if it is usable.
        odometry: The latest usable pose of `odometry/filtered`, in the frame `odom`; None if no such pose has arrived.
        odometry_at_pose: The value of `odometry` when `pose` arrived.
        speed: The speeds in the latest odometry, in m/s and rad/s.
        settle_timeout_sec: The maximum wait until the robot stands still, in seconds.
        arrival_tolerance_m: The robot has arrived if its distance from the goal is at most this value, in metres; None for Nav2's tolerance
            plus half a metre.
        lacks: The reason why the robot cannot drive, in words; empty if the robot can drive. `ros.dependency_monitor` sets this attribute.
        transform_at: The time of arrival of the latest transform from `map`, in seconds of awake time; None if no such transform has arrived.
    """

    def __init__(self, node: "Node") -> None:
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from nav_msgs.msg import Odometry
        from rclpy.qos import qos_profile_sensor_data
        from tf2_msgs.msg import TFMessage

        self.pose: PlanarPose | None = None
        self.pose_at = -math.inf
        self.pose_problem = ""
        self.odometry: PlanarPose | None = None
        self.odometry_at_pose: PlanarPose | None = None
        self.speed = (0.0, 0.0)
        self.settle_timeout_sec = SETTLE_SEC
        self.arrival_tolerance_m: float | None = None
        self.transform_at: float | None = None
        self.lacks = ""
        self._node, self._reports = node, value_reports(node)
        self._states: dict[str, LifecycleState] = {}
        self.clock = deadline_clock(node)
        # The speed of a simulation is not limited, because a robot brakes in simulated time.
        self._own_time = NodeTime(node, steady=AWAKE.now)
        self._frames = ("", "")
        self._odometry_at = -math.inf
        self._slow_since: float | None = None
        self._transforms, self._has_own_transforms = b"", False
        # A localisation with simulated time sends nothing while the simulated clock stands still.
        self._clocked, self._transform_clocked_at = ClockedTime(node), -math.inf
        self._transform_at_sec = 0.0
        self._listeners: list[PoseListener] = []
        self._awaiting: list[Callable[[], None]] = []
        self._odometry_listeners: list[Callable[[], None]] = []
        latched = qos_profile(type(self).__name__, "transient_local")
        # If the robot stands still, the latest pose was published before this subscription, because AMCL only publishes a pose after a movement.
        node.create_subscription(PoseWithCovarianceStamped, "amcl_pose", self._on_pose, latched)
        # The messages of these busy topics are not deserialised, because this takes longer than reading some of their bytes.
        node.create_subscription(
            Odometry, "odometry/filtered", self._on_odometry, qos_profile_sensor_data, raw=True
        )
        node.create_subscription(TFMessage, "/tf", self._on_transforms, qos_profile_sensor_data, raw=True)

    @property
    def moves(self) -> bool | None:
        """Whether the robot moves according to the latest odometry; None without recent odometry."""
        if AWAKE.now() - self._odometry_at > _FRESH_SEC:
            return None
        return self._slow_since is None

    @property
    def is_standing(self) -> bool | None:
        """Whether the robot has stood still for half a second; None without recent odometry."""
        if self.moves is None or self._slow_since is None:
            return None if self.moves is None else False
        return self._own_time.now() - self._slow_since >= _STANDS_SEC

    @property
    def speed_text(self) -> str:
        """The speeds in the latest odometry, as text for messages."""
        return f"{self.speed[0]:.2f} m/s, {self.speed[1]:.2f} rad/s"

    def call_at_standstill(self, listener: Callable[[], None]) -> None:
        """Call a function once when the robot stands still."""
        self._awaiting.append(listener)

    def cancel_call(self, listener: Callable[[], None]) -> None:
        """Cancel a call that was requested with `call_at_standstill`, if the call has not happened yet."""
        with suppress(ValueError):
            self._awaiting.remove(listener)

    @property
    def is_localised(self) -> bool:
        """Whether the localisation has published the robot's pose as a message or a transform."""
        return self.pose is not None or self.transform_at is not None

    def lost_transforms(self) -> str:
        """Describe the problem if transforms from `map` have stopped arriving; otherwise return ''.

        The result is also empty if no transform has ever arrived. Time during which simulated time stands still is not counted, because
        only the stopped clock is reported then.
        """
        silent_sec = self._clocked.now() - self._transform_clocked_at
        if self.transform_at is None or silent_sec <= TRANSFORM_SEC:
            return ""
        return f"No transform from 'map' has arrived for {TRANSFORM_SEC:g} s: the localisation has stopped"

    @cached_property
    def driving_nodes(self) -> LifecycleNodes:
        """The lifecycle nodes that must be active during a drive."""
        return LifecycleNodes([self.lifecycle(name) for name in DRIVING_NODES])

    def lifecycle(self, name: str) -> LifecycleState:
        """Return the state of a lifecycle node, given its relative name; every call for a name returns the same object."""
        if name not in self._states:
            self._states[name] = LifecycleState(self._node, name)
        return self._states[name]

    def last_pose(self) -> PlanarPose | None:
        """Return the robot's latest localised pose, in the frame `map`; None if the pose is unknown."""
        return self._place_by_transforms() or self.pose

    def current_pose(self) -> PlanarPose | None:
        """Return the robot's current pose, in the frame `map`; None if the pose is unknown or outdated."""
        if self.lost_transforms():
            return None
        # The localisation only publishes a pose after a movement. Between two poses, only recent odometry shows the current pose.
        return self.last_pose() if self.moves is not None else self.pose

    def add_listener(self, listener: PoseListener) -> None:
        """Add a callback that is called with each usable pose of `amcl_pose`."""
        self._listeners.append(listener)

    def _on_pose(self, message: Any) -> None:
        try:
            pose = localised_pose(message, self._node)
        except UnusableValueError as error:
            self.pose_problem = str(error)
            self._reports.report_problem("Topic 'amcl_pose'", error)
            return
        self.pose, self.odometry_at_pose, self.pose_problem = pose, self.odometry, ""
        self.pose_at = AWAKE.now()
        for listener in self._listeners:
            listener(pose)

    def listen_to_odometry(self, listener: Callable[[], None]) -> None:
        """Add a callback that is called after each odometry message."""
        self._odometry_listeners.append(listener)

    def _on_odometry(self, message: bytes) -> None:
        self._clocked.now()
        self._reports.read("Topic 'odometry/filtered'", partial(self._apply_odometry, message))
        for listener in self._odometry_listeners:
            listener()

    def _apply_odometry(self, message: bytes) -> None:
        """Update the estimate with the valid values of an odometry message.

        Raises:
            UnusableValueError: If a value is invalid.
        """
        reading = read_odometry(message)
        stamp_age(reading.stamp_sec, self._node, _MAX_AGE_SEC)
        # The speed is used even if the pose is invalid, because the motion may be the reason why the pose is lost.
        self._on_speed(reading.usable_speed)
        self.odometry, self._frames = reading.usable_pose, (reading.frame, reading.child)
        if self.odometry_at_pose is None:
            self.odometry_at_pose = self.odometry

    def _on_speed(self, speed: tuple[float, float]) -> None:
        self.speed, self._odometry_at = speed, AWAKE.now()
        if speed[0] >= _STANDS_MPS or speed[1] >= _STANDS_RADPS:
            self._slow_since = None
        elif self._slow_since is None:
            self._slow_since = self._own_time.now()
        elif self._awaiting and self.is_standing:
            awaiting, self._awaiting = self._awaiting, []
            for listener in awaiting:
                listener()

    def localisation_conflict(self) -> str:
        """Explain why the localisation may belong to another robot; return '' if nothing indicates this.

        While there is a conflict, no initial pose is sent or requested, because another robot could receive it.
        """
        graph = ros_graph(self._node)
        conflict = graph.foreign_localisation_problem() or frame_sources(self._node).conflict()
        if conflict or self.pose is not None or self.transform_at is None or self.hears_other_robots:
            return conflict
        others = graph.other_robots()
        if not others:
            return ""
        return (
            f"transforms from 'map' may belong to another robot, because {self._node.resolve_topic_name('/tf')} is also "
            f"published by {join_names(others)}. Give each robot its own transforms "
            "(`-r __ns:=/robot1 -r /tf:=tf -r /tf_static:=tf_static`)"
        )

    @property
    def hears_other_robots(self) -> bool:
        """Whether other robots are present, and no transform from `map` to a frame of this robot has arrived."""
        knows = self.odometry is not None and self.transform_at is not None
        return knows and not self._has_own_transforms and bool(ros_graph(self._node).other_robots())

    def _on_transforms(self, message: bytes) -> None:
        if FROM_MAP in message and not self._is_of_another_robot(message):
            self.transform_at, self._transforms = AWAKE.now(), message
            self._transform_clocked_at, self._transform_at_sec = self._clocked.now(), node_sec(self._node)

    def _is_of_another_robot(self, message: bytes) -> bool:
        """Return whether a message with transforms belongs to another robot: this robot's frames appear only in other messages."""
        is_own = not {*child_frames(message)}.isdisjoint(filter(None, self._frames))
        self._has_own_transforms = self._has_own_transforms or is_own
        return self._has_own_transforms and not is_own

    def _place_by_transforms(self) -> PlanarPose | None:
        """Compute the robot's pose from the latest transforms from `map` and the odometry.

        Return None if the pose is unknown.
        """
        from rclpy.serialization import deserialize_message
        from tf2_msgs.msg import TFMessage

        if self.odometry is None or not self._transforms:
            return None
        for each in deserialize_message(self._transforms, TFMessage).transforms:
            if (
                place := self._reports.read("Topic '/tf'", partial(self._pose_from_transform, each))
            ) is not None:
                return place
        return None

    def _pose_from_transform(self, message: Any) -> PlanarPose | None:
        """Compute the robot's pose from a transform from `map` to a frame of the odometry; None for other transforms.

        Raises:
            UnusableValueError: If the transform's numbers are invalid, or it is outdated.
        """
        transform, odometry = read_transform(message), self.odometry
        if transform.parent != MAP_FRAME or transform.child not in self._frames or odometry is None:
            return None
        stamp_age(transform.stamp_sec, self._node, _MAX_AGE_SEC, at_sec=self._transform_at_sec)
        x, y, yaw = transform.planar
        if transform.child == self._frames[1]:
            return transform.planar
        cos, sin = math.cos(yaw), math.sin(yaw)
        return PlanarPose(
            x + cos * odometry.x - sin * odometry.y,
            y + sin * odometry.x + cos * odometry.y,
            yaw + odometry.yaw,
        )


def robot_estimate(node: "Node") -> RobotEstimate:
    """Return the state estimate of a node's robot; every call for a node returns the same object."""
    return of_node(node, RobotEstimate, lambda: RobotEstimate(node))


class Standstill:
    """Lets a leaf wait until the odometry shows that the robot stands still, for at most `settle_timeout_sec`.

    Without odometry, the leaf does not wait.

    Args:
        leaf: The leaf, after its setup. The leaf shows the wait as its feedback message, and logs a warning after the time limit.
        wake: Requests a tick.
        since: The event after which the robot must stand still, in words.
        with_goals: Whether to wait until all goals of the leaf's node have ended, too.
    """

    def __init__(self, leaf: RosLeaf, wake: Wake, since: str, *, with_goals: bool = False) -> None:
        self._leaf, self._wake, self._since = leaf, wake, since
        self._goals = active_goals_of(leaf.node) if with_goals else None
        self._robot = robot_estimate(leaf.node)
        self._due: Deadline | None = None
        self._is_reported = False

    def is_awaited(self) -> bool:
        """Return whether the leaf must continue to wait."""
        moves = self._robot.is_standing is False
        if not moves and not (self._goals is not None and self._goals.may_be_active):
            if self._due is not None:
                self._leaf.feedback_message = ""
            self.give_up()
            return False
        if self._due is None:
            self._due = Deadline(self._robot.settle_timeout_sec, self._robot.clock)
            self._robot.call_at_standstill(self._wake)
            self._leaf.feedback_message = "waiting for the robot to stop"
        # The clock is read once, because a limit that passes between two readings would end the wait without the warning.
        has_passed = self._due.has_passed
        if has_passed and not self._is_reported:
            # `warn` would not recognise a repetition, because the speed in the message changes.
            self._is_reported = True
            what = f"the robot still moves ({self._robot.speed_text})" if moves else "a goal may be active"
            self._leaf.warn(
                f"'{self._leaf.name}': {what} {self._robot.settle_timeout_sec:g} s after {self._since}."
            )
            self.give_up()
        return not has_passed

    def give_up(self) -> None:
        """End the wait, so that no tick is requested when the robot stands still."""
        self._robot.cancel_call(self._wake)
