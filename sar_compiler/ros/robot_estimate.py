"""The state estimate of a robot: pose, motion, localisation, and states of nodes.

Leaves, the monitoring, the readiness check, the journal and the end of a run read it. Each topic is subscribed to once for each node.
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

# A robot below these speeds counts as standing, m/s and rad/s, after this time, seconds of its own clock.
_STANDS_MPS, _STANDS_RADPS, _STANDS_SEC = 0.02, 0.05, 0.5
# How long a transform from `map` may be missing. AMCL sends about ten a second while the robot's scanner works.
TRANSFORM_SEC = 3.0
# Older odometry does not show the present state, steady seconds.
_FRESH_SEC = 1.0
# Odometry and transforms arrive continuously. With older stamps they do not show the present state, seconds of the
# node's clock.
_MAX_AGE_SEC = 30.0
# `map` as the frame of a serialised transform.
FROM_MAP = b"\x04\x00\x00\x00map\x00"

PoseListener = Callable[[PlanarPose], None]


class RobotEstimate:
    """The state estimate of a node's robot; obtain it with `robot_estimate`.

    Args:
        node: The rclpy node.

    Attributes:
        clock: The clock of waits for the robot, seconds.
        pose: The last usable pose of `amcl_pose`, in the frame `map`; None if none has come.
        pose_at: Its time of arrival, steady seconds.
        pose_problem: The reason why the last message of `amcl_pose` is unusable; empty if it is usable.
        odometry: The last usable pose of `odometry/filtered`, in the frame `odom`; None if none has come.
        odometry_at_pose: The odometry when `pose` arrived.
        speed: The speeds in the last odometry: m/s and rad/s.
        settle_timeout_sec: Time to wait for the robot to stand still, in seconds.
        arrival_tolerance_m: The tolerance for an arrival at a goal, metres; None for Nav2's tolerance and half a metre.
        lacks: The reason why the robot cannot drive, in words, set by `ros.dependency_monitor`; empty if it can.
        transform_at: The arrival of the last transform from `map`, steady seconds; None before the first one.
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
        # No limit on the speed of a simulation: this wait is not for other programs.
        self._own_time = NodeTime(node, steady=AWAKE.now)
        self._frames = ("", "")
        self._odometry_at = -math.inf
        self._slow_since: float | None = None
        self._transforms, self._has_own_transforms = b"", False
        # A localisation with a simulated clock sends nothing while that stands still.
        self._clocked, self._transform_clocked_at = ClockedTime(node), -math.inf
        self._transform_at_sec = 0.0
        self._listeners: list[PoseListener] = []
        self._awaiting: list[Callable[[], None]] = []
        self._odometry_listeners: list[Callable[[], None]] = []
        latched = qos_profile(type(self).__name__, "transient_local")
        # A robot that stands still, and may be paused, has published its pose earlier. AMCL repeats it only after a movement.
        node.create_subscription(PoseWithCovarianceStamped, "amcl_pose", self._on_pose, latched)
        # Serialised: a message of a busy topic takes longer to deserialise than to scan.
        node.create_subscription(
            Odometry, "odometry/filtered", self._on_odometry, qos_profile_sensor_data, raw=True
        )
        node.create_subscription(TFMessage, "/tf", self._on_transforms, qos_profile_sensor_data, raw=True)

    @property
    def moves(self) -> bool | None:
        """Whether the robot moves according to the last odometry; None without recent odometry."""
        if AWAKE.now() - self._odometry_at > _FRESH_SEC:
            return None
        return self._slow_since is None

    @property
    def is_standing(self) -> bool | None:
        """Whether the robot has been standing for half a second; None without recent odometry."""
        if self.moves is None or self._slow_since is None:
            return None if self.moves is None else False
        return self._own_time.now() - self._slow_since >= _STANDS_SEC

    @property
    def speed_text(self) -> str:
        """The speeds in the last odometry, in words."""
        return f"{self.speed[0]:.2f} m/s, {self.speed[1]:.2f} rad/s"

    def call_at_standstill(self, listener: Callable[[], None]) -> None:
        """Register a callback that is called once when the robot stands still."""
        self._awaiting.append(listener)

    def cancel_call(self, listener: Callable[[], None]) -> None:
        """Remove a callback of `call_at_standstill`; no effect after its call."""
        with suppress(ValueError):
            self._awaiting.remove(listener)

    @property
    def is_localised(self) -> bool:
        """Whether the localisation has published the robot's pose, in a message or as a transform."""
        return self.pose is not None or self.transform_at is not None

    def lost_transforms(self) -> str:
        """Report that transforms from `map` have stopped; empty if they arrive, or have never arrived.

        While simulated time stands still, they are neither lost nor found, and only the clock is reported.
        """
        silent_sec = self._clocked.now() - self._transform_clocked_at
        if self.transform_at is None or silent_sec <= TRANSFORM_SEC:
            return ""
        return f"No transform from 'map' has arrived for {TRANSFORM_SEC:g} s: the localisation has stopped"

    @cached_property
    def driving_nodes(self) -> LifecycleNodes:
        """The lifecycle nodes that a drive needs."""
        return LifecycleNodes([self.lifecycle(name) for name in DRIVING_NODES])

    def lifecycle(self, name: str) -> LifecycleState:
        """Return the state of a lifecycle node by its relative name, one object for each name."""
        if name not in self._states:
            self._states[name] = LifecycleState(self._node, name)
        return self._states[name]

    def last_pose(self) -> PlanarPose | None:
        """Return the robot's last localised pose, in the frame `map`; None if it is unknown."""
        return self._place_by_transforms() or self.pose

    def current_pose(self) -> PlanarPose | None:
        """Return the current pose of the robot in the frame `map`; None if it is unknown or outdated."""
        if self.lost_transforms():
            return None
        # Between two poses of the localisation, which arrive after movements, only recent odometry extends the last pose.
        return self.last_pose() if self.moves is not None else self.pose

    def add_listener(self, listener: PoseListener) -> None:
        """Register a callback for each usable pose of `amcl_pose` from now on."""
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
        """Register a callback for odometry."""
        self._odometry_listeners.append(listener)

    def _on_odometry(self, message: bytes) -> None:
        self._clocked.now()
        self._reports.read("Topic 'odometry/filtered'", partial(self._apply_odometry, message))
        for listener in self._odometry_listeners:
            listener()

    def _apply_odometry(self, message: bytes) -> None:
        """Use the valid values of odometry.

        Raises:
            UnusableValueError: If a value is invalid.
        """
        reading = read_odometry(message)
        stamp_age(reading.stamp_sec, self._node, _MAX_AGE_SEC)
        # First the speed: the movement may be the reason why the pose is lost.
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
        """Describe why the localisation may belong to another robot; empty if it does not seem to.

        Until this is resolved, no initial pose is sent or requested, because the localisation could be the other robot's.
        """
        graph = ros_graph(self._node)
        conflict = graph.foreign_localisation_problem() or frame_sources(self._node).conflict()
        if conflict or self.pose is not None or self.transform_at is None or self.hears_other_robots:
            return conflict
        others = graph.other_robots()
        if not others:
            return ""
        return (
            f"transforms from 'map' may be another robot's: {self._node.resolve_topic_name('/tf')} is also published by "
            f"{join_names(others)}. Give each robot transforms of its own "
            "(`-r __ns:=/robot1 -r /tf:=tf -r /tf_static:=tf_static`)"
        )

    @property
    def hears_other_robots(self) -> bool:
        """Whether all transforms from `map` lead to other robots' frames."""
        knows = self.odometry is not None and self.transform_at is not None
        return knows and not self._has_own_transforms and bool(ros_graph(self._node).other_robots())

    def _on_transforms(self, message: bytes) -> None:
        if FROM_MAP in message and not self._is_of_another_robot(message):
            self.transform_at, self._transforms = AWAKE.now(), message
            self._transform_clocked_at, self._transform_at_sec = self._clocked.now(), node_sec(self._node)

    def _is_of_another_robot(self, message: bytes) -> bool:
        """Return whether transforms lead only to other robots' frames."""
        leads_here = not {*child_frames(message)}.isdisjoint(filter(None, self._frames))
        self._has_own_transforms = self._has_own_transforms or leads_here
        return self._has_own_transforms and not leads_here

    def _place_by_transforms(self) -> PlanarPose | None:
        """Return the pose from the latest `map` transform, combined with odometry if necessary."""
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
        """Return the pose from a transform; None if it does not connect `map` with a frame of the odometry.

        Raises:
            UnusableValueError: If its numbers are invalid, or it is outdated.
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
    """Return the state estimate of a node's robot, one object for each node."""
    return of_node(node, RobotEstimate, lambda: RobotEstimate(node))


class Standstill:
    """Waits while the odometry shows a movement, at most for `settle_timeout_sec`. Without odometry it does not wait.

    Args:
        leaf: The leaf after its setup; it logs the wait, and a wait in vain.
        wake: Requests a tick.
        since: The event after which the robot must stand, in words.
        with_goals: Whether all goals of the leaf's node must have ended, not only the caller's.
    """

    def __init__(self, leaf: RosLeaf, wake: Wake, since: str, *, with_goals: bool = False) -> None:
        self._leaf, self._wake, self._since = leaf, wake, since
        self._goals = active_goals_of(leaf.node) if with_goals else None
        self._robot = robot_estimate(leaf.node)
        self._due: Deadline | None = None
        self._told = False

    def is_awaited(self) -> bool:
        """Return whether to continue waiting."""
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
        # Read the clock once: a limit that passes between two readings would end the wait without its warning.
        has_passed = self._due.has_passed
        if has_passed and not self._told:
            # Log it once: each line would have another speed.
            self._told = True
            what = f"the robot still moves ({self._robot.speed_text})" if moves else "a goal may be active"
            self._leaf.warn(
                f"'{self._leaf.name}': {what} {self._robot.settle_timeout_sec:g} s after {self._since}."
            )
            self.give_up()
        return not has_passed

    def give_up(self) -> None:
        """Stop waiting, and do not request a tick when the robot stands still."""
        self._robot.cancel_call(self._wake)
