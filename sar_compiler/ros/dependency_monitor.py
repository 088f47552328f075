"""Monitor the requirements of a running tree, and detect robot motion without an active goal."""

import math
from collections.abc import Collection, Iterable, Sequence

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseWithCovarianceStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from sar_compiler.nodes.nav2.log_lines import NAV2_NODES
from sar_compiler.nodes.spec import Use
from sar_compiler.ros.clock import AWAKE, deadline_clock, deadline_timer
from sar_compiler.ros.frame_sources import frame_sources
from sar_compiler.ros.graph_queries import Endpoint, ros_graph, with_full_name
from sar_compiler.ros.leaves.goals import (
    ABORTED,
    GoalEvent,
    active_goals_of,
    cancel_client,
    canceled_action,
    goal_statuses_of,
)
from sar_compiler.ros.leaves.leaf import is_node_valid
from sar_compiler.ros.poses import estimated_pose
from sar_compiler.ros.readiness import MOVED_M, SHADOW_SEC
from sar_compiler.ros.robot_estimate import robot_estimate
from sar_compiler.ros.robot_lease import RobotLease

# Maximum braking time of a robot, and maximum time from a goal's end to a motion that is attributed to the goal, in seconds.
_BRAKES_SEC, _LATEST_SEC = 0.7, 2.0
# Maximum time from the end of an aborted goal to a motion that is attributed to the goal, in seconds. On a busy machine, Nav2's controller can
# start to execute a goal seconds after the navigator has aborted it (3 s were observed).
_LATEST_ABORTED_SEC = 10.0
# If a motion after an aborted goal lasts this long, in seconds, all goals are cancelled. Nav2's controller may still execute the goal.
_ABORTED_SEC = 0.3
# Interval at which all goals are cancelled while the robot still moves, in seconds of the steady clock.
_CANCEL_SEC = 1.0
# The actions by which Nav2's servers move the robot. Their goals can outlive the navigator's goal.
_SERVERS = ("navigate_to_pose", "follow_path", "spin", "backup")


class UnrequestedMotion:
    """Detects robot motion while no goal of this node is active.

    The end of a goal does not prove that the robot stands still: Nav2's navigator can abort a goal that its controller
    still executes. Motion after the end of a goal is reported, and all goals of Nav2 are cancelled unless a goal of another client is
    active. Any other motion without a goal is only reported.

    Args:
        node: The node that sends the goals.
        actions: The resolved or relative names of the actions that move the robot.
    """

    def __init__(self, node: Node, actions: Iterable[str]) -> None:
        actions = list(actions)
        self._node = node
        self._robot, self._goals = robot_estimate(node), active_goals_of(node)
        self._clock = deadline_clock(node)
        self._statuses = [goal_statuses_of(node, action) for action in actions]
        beside = {action[: action.rfind("/") + 1] + server for action in actions for server in _SERVERS}
        self._cancellers = {name: cancel_client(node, name) for name in sorted({*actions, *beside})}
        self._actions = {canceled_action(self._cancellers[action].service_name) for action in actions}
        self._has_sent = False
        self._ended: tuple[float, float] | None = None
        self._since: tuple[float, float] | None = None
        self._is_reported = self._lacks_odometry_reported = self._was_aborted = self._cancels_early = False
        self._cancelled_at = -math.inf
        self._goals.add_listener(self._on_goal)
        self._robot.listen_to_odometry(self.poll)

    def poll(self) -> None:
        """Check whether the robot moves without a goal; report changes, and cancel goals if necessary."""
        if self._goals.drives(self._actions):
            self._ended = self._since = None
            return
        if self._has_sent and self._ended is None:
            self._ended = self._now()
        if self._robot.moves:
            self._since = self._since or self._now()
            seconds = self._seconds_since(self._since)
            if seconds >= _BRAKES_SEC:
                self._handle_motion()
            elif seconds >= _ABORTED_SEC and self._cancels_early and self._is_ours:
                self._cancels_early = (
                    False  # only once, because a robot that continues to move must be reported
                )
                self._cancel_all_goals()
        elif self._robot.moves is None:
            self._report_missing_odometry()
        elif self._robot.is_standing:
            self._on_standstill()

    def _handle_motion(self) -> None:
        """Report that the robot moves; cancel all goals if the robot still executes an ended goal of this mission."""
        if self._is_ours:
            if not self._is_reported:
                self._report_motion()
            if AWAKE.now() - self._cancelled_at >= _CANCEL_SEC:
                self._cancel_all_goals()
        elif not self._is_reported:
            self._report(
                f"The robot moves ({self._robot.speed_text}), although no goal of this mission is active."
            )

    @property
    def _is_ours(self) -> bool:
        """Whether the motion follows an ended goal of this mission, and no other client has a goal."""
        return self._ended is not None and not any(each.has_foreign_goal for each in self._statuses)

    def _available_servers(self) -> dict[str, Client]:
        return {name: client for name, client in self._cancellers.items() if client.service_is_ready()}

    def _report_motion(self) -> None:
        self._report(
            f"The robot moves ({self._robot.speed_text}) although its goal has ended and no other goal is "
            f"active. Cancelling every goal ({', '.join(self._available_servers()) or 'no server was found'})."
        )

    def _cancel_all_goals(self) -> None:
        self._cancelled_at = AWAKE.now()
        for client in self._available_servers().values():
            # A request with neither goal ID nor time stamp cancels all goals. The response is ignored, because the odometry shows the effect.
            client.call_async(CancelGoal.Request())

    def _on_standstill(self) -> None:
        """Record that the robot stands still, so that later motion is not attributed to an earlier goal."""
        self._since = None
        if self._is_reported:
            self._is_reported = False
            self._node.get_logger().info("The robot has stopped.")
        latest = _LATEST_ABORTED_SEC if self._was_aborted else _LATEST_SEC
        if self._ended is not None and self._seconds_since(self._ended) >= latest:
            self._has_sent, self._ended = False, None

    def _report_missing_odometry(self) -> None:
        if self._ended is not None and not self._lacks_odometry_reported:
            self._lacks_odometry_reported = True
            self._node.get_logger().info(
                "No odometry arrives on odometry/filtered. When a goal has ended, the robot is therefore assumed to stand still."
            )

    def _report(self, text: str) -> None:
        self._is_reported = True
        self._node.get_logger().warning(text)

    def _on_goal(self, news: GoalEvent) -> None:
        if news.action in self._actions:
            self._was_aborted = self._cancels_early = news.status == ABORTED
        if news.action in self._actions and not news.is_over:
            self._has_sent, self._ended, self._since, self._is_reported = True, None, None, False

    def _now(self) -> tuple[float, float]:
        return AWAKE.now(), self._clock.now()

    def _seconds_since(self, since: tuple[float, float]) -> float:
        """Return the seconds since a moment, measured on the slower of two clocks.

        A simulated robot brakes in simulated time.
        """
        return min(now - then for now, then in zip(self._now(), since, strict=True))


_PERIOD_SEC = 0.5
# Maximum time, in seconds, for which Nav2 may be inactive without a report, and for which a new localisation may publish nothing. A node that does
# not respond is reported at once, after the 2 s in which it should have responded.
_LOST_SEC = 2.0
# Times without a response from any Nav2 node, in seconds, after which discovery is lost: the first for nodes that have never sent anything to
# this process, the second for other nodes, whose process may have crashed. A crashed process leaves the graph earlier.
_DEAF_SEC, _DEAD_SEC = 4.0, SHADOW_SEC + 8.0
_REMEDY = "Restart the run with --resume, which continues the mission from the journal. The option --supervise does this automatically"
# Time for which Nav2's lifecycle manager tries to restart a crashed node, in seconds (bond_respawn_max_duration). After that, a person must
# configure the node.
_RESPAWN_SEC = 12.0
# Rotations below this angle are ignored, as by AMCL (update_min_a), in radians.
_TURNED = 0.2


class DependencyMonitor:
    """Monitors the servers, the localisation and the transforms of a running mission.

    It logs each of these events once:

    * An action or service has a second server. A killed server leaves the graph after some time. If an action still has two servers then,
      the run ends, because both servers would move the robot.
    * Another mission uses this robot. The run ends if the other mission has priority.
    * The localisation is lost. If it returns without a pose and the odometry shows that the robot has not moved, the last `amcl_pose` is
      sent to it again. Otherwise the operator is asked for the pose. Leaves that use Nav2 wait until the localisation works again
      (`ActionLeaf.hold_timeout_sec`).
    * The robot moves without a goal of the mission (`UnrequestedMotion`).
    * No transform from `map` has arrived for 3 s.
    * A frame, the clock, or a topic that should have one source has several.
    * No Nav2 node in the graph responds, not even to a new client (`lost_discovery`).

    Args:
        node: The mission's node.
        uses: The resources that the tree's leaves use, with resolved names.
        sole: The mission's lease of its robot.
        drives: The names of the actions that move the robot.

    Attributes:
        trouble: The reason why the run must end; empty if there is none.
        lost_discovery: The reason why the mission must continue in a new process; empty if there is none.
    """

    def __init__(
        self, node: Node, uses: Iterable[Use], *, sole: RobotLease | None = None, drives: Iterable[str] = ()
    ) -> None:
        uses, drives = list(dict.fromkeys(uses)), list(drives)
        self.trouble = self.lost_discovery = ""
        self._node = node
        self._sole = sole
        self._graph = ros_graph(node)
        self._servers = [Endpoint(use.kind, use.name) for use in uses if use.kind in ("action", "service")]
        self._contested: dict[Endpoint, float] = {}
        self._topics = [use.name for use in uses if use.kind == "topic"]
        self._reported: set[str] = set()
        self._localisation = _Localisation(node) if any(use.kind == "nav2" for use in uses) else None
        self._hears_transforms = self._localisation is not None or Use.transforms() in uses
        if self._localisation is not None:
            self._topics += ["odometry/filtered", "map"]
        self._motion = UnrequestedMotion(node, drives) if drives else None
        # The node's clock may stop, unless the simulation is trusted.
        deadline_timer(node, _PERIOD_SEC, self.poll)

    def poll(self) -> None:
        """Check all requirements, and log changes."""
        if not is_node_valid(self._node):
            return
        if self._sole is not None:
            self.trouble = self.trouble or self._sole.conflict()
        for server in self._servers:
            self._count_servers(server)
        self._count_sources()
        if self._localisation is not None:
            for line in self._localisation.poll():
                self._node.get_logger().warning(line)
            self.lost_discovery = self._localisation.lost_discovery
        if self._motion is not None:
            self._motion.poll()

    def _count_servers(self, server: Endpoint) -> None:
        now, answer = AWAKE.now(), self._graph.query(server)
        if not answer.is_contested:
            if self._contested.pop(server, None) is not None:
                self._node.get_logger().warning(f"{answer.title} has one server again.")
        elif server not in self._contested:
            self._contested[server] = now
            self._node.get_logger().warning(
                f"{answer.line}. A killed server stays visible for about {SHADOW_SEC:g} s."
            )
        elif server.kind == "action" and now - self._contested[server] > SHADOW_SEC:
            self.trouble = self.trouble or str(answer.line)

    def _count_sources(self) -> None:
        """Log once for each frame, topic or clock that has several sources."""
        lines = [self._graph.clock(), *map(self._graph.publisher_conflict, self._topics)]
        if self._hears_transforms:
            lines.append(frame_sources(self._node).conflict())
        for line in filter(None, lines):
            if line not in self._reported:
                self._reported.add(line)
                self._node.get_logger().warning(f"{line}.")


class _Localisation:
    """The state of the localisation, and the robot's pose when it was lost."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._robot = robot_estimate(node)
        self._nodes = [self._robot.lifecycle(name) for name in NAV2_NODES]
        self._lost_since: float | None = None
        self._is_lost = False
        self._inactive = ""
        self._unconfigured_since: dict[str, float] = {}
        self._known: set[bytes] = set()
        self._new_since: float | None = None
        self._transform_is_lost = False
        self.lost_discovery = ""
        self._pose_topic = node.resolve_topic_name("amcl_pose")
        self._poses = with_full_name("initialpose", node.resolve_topic_name("initialpose"))
        self._publisher = node.create_publisher(PoseWithCovarianceStamped, "initialpose", QoSProfile(depth=1))

    def poll(self) -> Iterable[str]:
        """Yield a message for each change since the last call."""
        states = [(each, each.poll()) for each in self._nodes]
        was_deaf, self.lost_discovery = bool(self.lost_discovery), self._lost_discovery()
        if self.lost_discovery:
            if not was_deaf:
                yield f"{self.lost_discovery}."
            self._robot.lacks = self.lost_discovery
            return
        if any(
            each.is_there and each.has_heard_nothing and each.silent_sec < _DEAF_SEC for each in self._nodes
        ):
            return  # a node that is present may be silent, so the result of the last call still applies
        missing = [line for each, line in states if line is not None and not each.is_awaited()]
        if missing:
            yield from self._report_missing(missing)
            # Nav2 is inactive until every node that has returned has responded.
            self._inactive = (
                f"the navigation (Nav2) is not active: {'; '.join(missing)}" if self._is_lost else ""
            )
        elif not any(each.is_awaited() for each in self._nodes):
            self._lost_since = None
            if self._is_lost:
                self._is_lost, self._inactive = False, ""
                yield "Nav2 is active again."
        yield from self._check_unconfigured()
        yield from self._check_new_localizer()
        yield from self._check_transform()
        self._robot.lacks = self._inactive or self._robot.lost_transforms()

    def _lost_discovery(self) -> str:
        """Describe a loss of discovery, or return an empty string if a Nav2 node in the graph responds.

        Discovery is lost if the graph shows Nav2's nodes, but none of them responds. In Fast DDS, other participants forget a participant
        that was silent for longer than its lease. The forgotten participant does not notice this: it still sees the others, but receives
        nothing from them until it is replaced by a new participant.
        """
        there = [each for each in self._nodes if each.is_there]
        silent_sec = min((each.silent_sec for each in there), default=0.0)
        if silent_sec < _DEAF_SEC:
            return ""
        names = " and ".join(each.name for each in there)
        if all(each.has_heard_nothing for each in there):
            return f"Since this process was suspended, it has received nothing from {names}, although the ROS graph shows them. {_REMEDY}"
        if silent_sec < _DEAD_SEC:
            return ""
        return f"{names} do not respond to this process, not even to new clients, although the ROS graph shows them. {_REMEDY}"

    def _report_missing(self, missing: list[str]) -> Iterable[str]:
        now = AWAKE.now()
        self._lost_since = self._lost_since or now
        is_sure = now - self._lost_since >= _LOST_SEC or any(each.is_silent for each in self._nodes)
        if not self._is_lost and is_sure:
            self._is_lost = True
            yield f"Nav2 is no longer active: {'; '.join(missing)}. Leaves that move the robot wait for Nav2."

    def _check_unconfigured(self) -> Iterable[str]:
        """Yield a message for each restarted node that the lifecycle manager has not configured."""
        now = AWAKE.now()
        for each in self._nodes:
            if each.state != "unconfigured":
                self._unconfigured_since.pop(each.name, None)
                continue
            since = self._unconfigured_since.setdefault(each.name, now)
            if now - since >= _RESPAWN_SEC:
                self._unconfigured_since[each.name] = math.inf  # once
                name = self._node.resolve_service_name(f"{each.name}/get_state").removesuffix("/get_state")
                # The lifecycle manager cannot take these steps: its version 1.3.13 waits forever for a response of the crashed process.
                steps = " && ".join(f"ros2 lifecycle set {name} {step}" for step in ("configure", "activate"))
                yield f"{each.name} was restarted, but Nav2's lifecycle manager has not configured it. Run: {steps}"

    def _check_new_localizer(self) -> Iterable[str]:
        """Restore the robot's pose if a restarted localisation has published nothing; yield a message about this."""
        sources, now = self._sources_of_poses(), AWAKE.now()
        if not self._known:
            self._known = sources
        if sources <= self._known or self._nodes[0].poll() is not None:
            self._new_since = None
            return
        self._new_since = self._new_since or now
        heard_at = max(self._robot.pose_at, self._robot.transform_at or -math.inf)
        if heard_at > self._new_since:
            self._known = sources
        elif now - self._new_since >= _LOST_SEC:
            self._known = sources
            yield self._restore()

    def _sources_of_poses(self) -> set[bytes]:
        return {
            bytes(each.endpoint_gid) for each in self._node.get_publishers_info_by_topic(self._pose_topic)
        }

    def _restore(self) -> str:
        """Send the robot's last pose to a restarted localisation if the robot has not moved; return a message."""
        if conflict := self._robot.localisation_conflict():
            return f"A localisation node has appeared. No pose is sent to this node, because it may belong to another robot: {conflict}."
        ask = f"send the pose to the localisation ({self._poses}; in RViz: 2D Pose Estimate)"
        if self._robot.pose is None:
            return f"The localisation is back, but its last pose is unknown: {ask}."
        if self._robot.odometry_at_pose is None or self._robot.odometry is None:
            return f"The localisation is back, but without odometry it is unknown whether the robot has moved: {ask}."
        moved, turned = _pose_difference(self._robot.odometry_at_pose, self._robot.odometry)
        if moved > MOVED_M or turned > _TURNED:
            return (
                f"The localisation is back, but the robot has moved by {moved:.2f} m and turned by {turned:.2f} rad "
                f"since its last pose: {ask}."
            )
        x, y, yaw = self._robot.pose
        self._publisher.publish(estimated_pose(self._node, x, y, yaw))
        return f"The localisation is back. Its last pose ({x:.2f}, {y:.2f}) is sent again, because the odometry shows no movement."

    def _check_transform(self) -> Iterable[str]:
        lost = self._robot.lost_transforms()
        if bool(lost) != self._transform_is_lost:
            self._transform_is_lost = bool(lost)
            yield f"{lost}." if lost else "Transforms from 'map' arrive again."


def _pose_difference(there: Sequence[float], here: Sequence[float]) -> tuple[float, float]:
    """Return the distance (metres) and the rotation (radians) between two poses (x, y, yaw)."""
    return math.dist(here[:2], there[:2]), abs(math.remainder(here[2] - there[2], math.tau))


def refuse_parameters(node: Node, names: Collection[str]) -> None:
    """Reject changes of parameters that the program only reads before the start of a run.

    Args:
        node: The node with the parameters.
        names: The names of the parameters; for a group of parameters, the first part of their names, such as `points` for `points.kitchen.x`.
    """

    def check(parameters: list[Parameter]) -> SetParametersResult:
        fixed = [each.name for each in parameters if each.name.partition(".")[0] in names]
        reason = (
            f"{', '.join(fixed)} is only read before the start. Stop the run, and start it with the new value"
        )
        return SetParametersResult(successful=not fixed, reason=reason if fixed else "")

    node.add_on_set_parameters_callback(check)
