"""Wait, before the first tick, for the resources that a tree's leaves declare."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext, suppress
from functools import partial

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from sar_compiler.errors import SarError
from sar_compiler.journal.display import AwaitedItem
from sar_compiler.nodes.nav2.log_lines import BEFORE_NAVIGATOR, MANAGER, NAV2_NODES
from sar_compiler.nodes.spec import Use
from sar_compiler.ros.clock import AWAKE
from sar_compiler.ros.frame_sources import frame_sources
from sar_compiler.ros.graph_queries import Endpoint, ros_graph, with_full_name
from sar_compiler.ros.lifecycle import PolledService
from sar_compiler.ros.nav2_log import nav2_log
from sar_compiler.ros.nav2_parameters import nav2_parameters
from sar_compiler.ros.poses import estimated_pose
from sar_compiler.ros.robot_estimate import robot_estimate
from sar_compiler.tree.display_text import escape_to_one_line

InitialPose = tuple[float, float, float]
"""An initial pose: x and y in metres, yaw in radians."""

_INITIAL_POSE_PERIOD_SEC = 1.0
# Time to wait for the pose of a discovered localisation before an initial pose is sent, in seconds. Half of the participants discover each other
# in half of this time.
_LISTEN_SEC = 1.0
# Maximum wait, in seconds, for the odometry after transforms from `map` have arrived. Both are needed to compute the position.
_PLACE_SEC = 5.0
MOVED_M = 0.25
"""Movements below this distance are ignored, as by AMCL (`update_min_d`), in metres."""
# Maximum differences, in metres and radians, at which a pose agrees with the initial pose.
_AGREES_M, _AGREES_RAD = 0.5, 0.5

_POSITION = "the robot's position"
_ODOMETRY = Endpoint("topic", "odometry/filtered", "nav_msgs/msg/Odometry")

# The node and the step that fail if Nav2 is brought up without an initial pose.
_WAITS_FOR_POSE = ("planner_server", "failed to activate")


class Requirement(ABC):
    """A requirement that must be fulfilled before the first tick.

    Attributes:
        ends_by_itself: Whether the requirement will be fulfilled without intervention. No time limit applies to such a requirement.
        title: The requirement's name for operators.
    """

    ends_by_itself = False
    title = "the end of the previous run"

    @abstractmethod
    def poll(self) -> str | None:
        """Perform the next step; return a description of the missing item, or None if nothing is missing."""

    def close(self) -> None:  # noqa: B027 - most requirements create no entities
        """Destroy the entities that the requirement has created on the node."""


class RobotMovedError(SarError):
    """Raised if the robot is not at the initial pose that the mission would send to the localisation.

    Attributes:
        place: The robot's pose according to the localisation: x, y (m) and yaw (rad) in the frame `map`; None if the pose is unknown.
        pose: The initial pose of the mission.
        moved: The robot's distance from its start according to the odometry, in metres, if the localisation has no pose; otherwise None.
    """

    def __init__(
        self,
        place: InitialPose | None,
        pose: InitialPose,
        *,
        moved: float | None = None,
        can_resume: bool = False,
    ) -> None:
        self.place, self.pose, self.moved = place, pose, moved
        start = f"initial_pose ({pose[0]:.2f}, {pose[1]:.2f})"
        resume = "Resume the interrupted mission (--resume)" if can_resume else ""
        if moved is not None:
            super().__init__(
                "the localisation has no pose, and according to the odometry the robot is "
                f"{moved:.2f} m from its start. {start} is not sent. {f'{resume}, or set' if resume else 'Set'} the pose "
                "(in RViz: 2D Pose Estimate), and start where the robot stands: -p set_initial_pose:=false"
            )
            return
        where, value = "already publishes the robot's transforms", ""
        if place is not None:
            far = math.dist(place[:2], pose[:2])
            where = f"locates the robot at ({place[0]:.2f}, {place[1]:.2f}), {far:.2f} m from {start}"
            value = f"-p initial_pose.x:={place[0]:.2f} -p initial_pose.y:={place[1]:.2f}, or "
        super().__init__(
            f"the localisation {where}. The initial pose is not sent. {f'{resume}, drive' if resume else 'Drive'} back "
            f"first, or give the robot's pose ({value}-p set_initial_pose:=false to start where it stands). "
            "If the localisation is wrong, correct it in RViz: 2D Pose Estimate"
        )


class LocalisationCheck(Requirement):
    """The requirement that the localisation has a pose: a pose of its own, or the mission's initial pose.

    If the localisation already has a pose, the initial pose is only sent if the two poses are nearly equal. If the two poses are far apart,
    the start is refused. If the localisation has no pose, the initial pose is only sent if the odometry shows that the robot has not moved.
    The same rule applies during a run (`ros.dependency_monitor`). The initial pose is published until the localisation publishes a new
    pose. An older pose, which late subscribers receive, does not confirm the initial pose.

    Args:
        node: The node that publishes the initial pose.
        pose: The initial pose, in the frame `map`.
        restarts: Whether the localisation certainly has no pose, as at the start of a simulation.
        can_resume: Whether the journal of an interrupted mission exists.

    Attributes:
        may_publish: Whether the initial pose may be published; if not, the node only subscribes to the localisation's pose.
    """

    may_publish = True

    def __init__(
        self, node: Node, pose: InitialPose, *, restarts: bool = False, can_resume: bool = False
    ) -> None:
        self._node = node
        self._pose = pose
        self._robot = robot_estimate(node)
        self._restarts, self._can_resume = restarts, can_resume
        self._discovered_at = -math.inf if restarts else math.inf
        self._sent_at = -math.inf
        self._localised_at = math.inf
        self._is_confirmed = False
        self._pose_topic, self._initial_pose_topic = (
            with_full_name(topic, node.resolve_topic_name(topic)) for topic in ("amcl_pose", "initialpose")
        )
        self._publisher = node.create_publisher(PoseWithCovarianceStamped, "initialpose", QoSProfile(depth=1))

    def poll(self) -> str | None:
        """Publish the initial pose if it is due. Return why the pose is missing, or None if it has arrived.

        Raises:
            RobotMovedError: If the localisation has a pose that is far from the initial pose, or the robot has moved.
        """
        has_response = self._was_sent and self._robot.pose_at >= self._sent_at
        now = AWAKE.now()
        if not (self._is_confirmed or has_response):
            if self._robot.localisation_conflict():
                return f"topic {self._pose_topic}: no initial pose is sent, because the localisation may belong to another robot"
            if self._must_wait_for_pose(now):
                return f"topic {self._pose_topic}: waiting for the localisation's pose"
        self._is_confirmed = self._is_confirmed or has_response or self._keeps_own_yaw()
        if self._is_confirmed:
            return None
        has_subscriber = self._publisher.get_subscription_count() > 0
        has_listened = self._has_listened(now)
        if (
            has_subscriber
            and self.may_publish
            and has_listened
            and self._has_not_moved()
            and now - self._sent_at >= _INITIAL_POSE_PERIOD_SEC
        ):
            self._sent_at = now
            self._publisher.publish(estimated_pose(self._node, *self._pose))
        x, y, yaw = self._pose
        cause = "" if has_subscriber else f", and no node subscribes to {self._initial_pose_topic}"
        return f"topic {self._pose_topic}: no response to the initial pose ({x:.2f}, {y:.2f}, yaw {yaw:.2f}){cause}"

    def close(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)

    @property
    def _was_sent(self) -> bool:
        return self._sent_at > -math.inf

    def _has_not_moved(self) -> bool:
        """Return whether a robot without localisation has not moved; return True if no node publishes odometry.

        Raises:
            RobotMovedError: If the robot has moved according to the odometry.
        """
        is_known = self._restarts or self._was_sent or self._robot.is_localised
        if is_known or not ros_graph(self._node).publishers(_ODOMETRY.name):
            return True
        if self._robot.odometry is None:
            return False
        here = self._robot.odometry[:2]
        moved = min(math.dist(here, (0.0, 0.0)), math.dist(here, self._pose[:2]))
        if moved > MOVED_M:
            raise RobotMovedError(None, self._pose, moved=moved, can_resume=self._can_resume)
        return True

    def _must_wait_for_pose(self, now: float) -> bool:
        """Return whether to wait longer until the pose, and the robot that publishes the transforms, are known."""
        if not self._robot.is_localised:
            return False
        is_placed = self._robot.last_pose() is not None
        if is_placed and len(ros_graph(self._node).publisher_ids("/tf")) < 2:  # noqa: PLR2004 - one publisher belongs to one robot
            return False
        self._localised_at = min(self._localised_at, now)
        return now - self._localised_at < (_LISTEN_SEC if is_placed else _PLACE_SEC)

    def _keeps_own_yaw(self) -> bool:
        """Return whether the localisation is at the initial position, but with another yaw, and will keep this yaw.

        Raises:
            RobotMovedError: If the localisation has a different position.
        """
        has_other_robots = self._robot.pose is None and self._robot.hears_other_robots
        if self._was_sent or not self._robot.is_localised or has_other_robots:
            return False
        place = self._robot.last_pose()
        if place is None or not math.dist(place[:2], self._pose[:2]) <= _AGREES_M:
            raise RobotMovedError(place, self._pose, can_resume=self._can_resume)
        turned = abs(math.remainder(place[2] - self._pose[2], math.tau))
        if not turned <= _AGREES_RAD:
            self._node.get_logger().warning(
                f"The initial pose is not sent. The localisation keeps its yaw of {place[2]:.2f} rad, which differs from initial_pose "
                f"({self._pose[2]:.2f})."
            )
        return not turned <= _AGREES_RAD

    def _has_listened(self, now: float) -> bool:
        """Return whether the node has waited long enough to receive a pose that the localisation published earlier."""
        if self._discovered_at == math.inf and ros_graph(self._node).publishers("amcl_pose"):
            self._discovered_at = now
        return now - self._discovered_at >= _LISTEN_SEC


class Nav2Check(Requirement):
    """The requirement that Nav2's navigator is active. If it is not active, the check explains why.

    Nav2's lifecycle manager activates its nodes in a fixed order. The navigator is one of the last. If an earlier node cannot be activated,
    the manager does not try again. This happens most often with `planner_server`, which waits for the frame `map`, and thus for the initial
    pose, but for no longer than `initial_transform_timeout`.

    Args:
        node: The node that queries the states.
        name: The relative name of the navigator.
        tells_pose: Whether the mission sends an initial pose to the localisation during the wait. If it does not, a missing pose is
            reported.
    """

    def __init__(self, node: Node, name: str, *, tells_pose: bool) -> None:
        self._node, self._robot, self._tells_pose = node, robot_estimate(node), tells_pose
        self._lifecycle, self._log = self._robot.lifecycle(name), nav2_log(node)
        self._manager: PolledService | None = None

    def poll(self) -> str | None:
        """Query the navigator's state if a query is due. Return why it is not active, or None if it is active."""
        # The state is queried again after a pose has arrived, because Nav2 may have waited for it.
        line, state = self._lifecycle.poll(self._robot.pose_at), self._lifecycle.state
        if line is None:
            return None
        awaited = self._log.awaited_node()
        if awaited and not ros_graph(self._node).query(Endpoint("node", awaited)).is_there:
            logged = self._log.quote(awaited)
            return (
                f"{line}. {MANAGER} waits for {awaited}, but the process of {awaited} was not started or has crashed"
                f"{f' ({logged})' if logged else ''}. Restart Nav2"
            )
        return line if state is None else line + self._reason(state) + self._pose()

    def close(self) -> None:
        """Destroy the client of the lifecycle manager."""
        if self._manager is not None:
            self._manager.close()

    def _reason(self, state: str) -> str:
        """Explain the navigator's state, from the states of the lifecycle manager and of the nodes activated before it."""
        if self._manager is None:
            self._manager = PolledService(self._node, Trigger, f"{MANAGER}/is_active")
        self._manager.query()
        before = [self._robot.lifecycle(name) for name in BEFORE_NAVIGATOR]
        for each in before:
            each.poll()
        states = {each.name: each.state for each in before if each.state is not None}
        asleep = next((pair for pair in states.items() if pair[1] != "active"), None)
        # The manager does not respond while it is busy.
        if self._manager.answer is None or self._manager.answer.success:
            return f", and {asleep[0]} is '{asleep[1]}'" if asleep else ""
        if {state, *states.values()} == {"unconfigured"} and not self._log.quote():
            call = self._node.resolve_service_name(f"{MANAGER}/manage_nodes")
            return (
                f". {MANAGER} has not started Nav2, because autostart is off. Run: "
                f'ros2 service call {call} nav2_msgs/srv/ManageLifecycleNodes "{{command: 0}}"'
            )
        stuck, what = _failed_bringup({**states, self._lifecycle.name: state}, self._log.failed_change())
        logged = self._log.quote(stuck)
        pose = ", and set the initial pose within its initial_transform_timeout"
        if self._robot.localisation_conflict():
            pose = ""
        return (
            f". {MANAGER} has given up starting Nav2, because {stuck} {what}{f' ({logged})' if logged else ''}. Restart "
            f"Nav2{pose if (stuck, what) == _WAITS_FOR_POSE else ''}"
        )

    def _pose(self) -> str:
        """Return a request to set the pose if the localisation has none and this run sends none; otherwise return ''."""
        if self._tells_pose or self._robot.is_localised or not ros_graph(self._node).publishers("amcl_pose"):
            return ""
        if self._robot.localisation_conflict():
            return ""
        poses = with_full_name("initialpose", self._node.resolve_topic_name("initialpose"))
        return f". The localisation has no pose yet. Publish the pose on {poses} (in RViz: 2D Pose Estimate)"


def _failed_bringup(states: Mapping[str, str], named: str) -> tuple[str, str]:
    """Return the node that could not be started, and a description of the failed step.

    Args:
        states: The states of the nodes, in the order of the bring-up.
        named: The node that failed according to the lifecycle manager's log; empty if the log names none.
    """
    if named in states:
        # The manager performs each step on all nodes in turn. If the named node is one step ahead of others, the manager has not received its response.
        others = {state for name, state in states.items() if name != named}
        if states[named] == "active" or (states[named] == "inactive" and "unconfigured" in others):
            done = "activated" if states[named] == "active" else "configured"
            return named, f"was {done}, but the response of this node was lost"
    steps = (("unconfigured", "failed to configure"), ("inactive", "failed to activate"))
    for state, what in steps:
        if named in states and states[named] == state:
            return named, what
    for state, what in steps:
        for name in states:
            if states[name] == state:
                return name, what
    return next(name for name in states if states[name] != "active"), "failed to activate"


# Maximum time for which a killed server stays in the ROS graph, in seconds (the default of the middleware is 20 s). If there are two servers, one
# may have been killed.
SHADOW_SEC = 22.0

_PROGRESS_PERIOD_SEC = 5.0
_ABSENT = "Nav2 is not running in this ROS domain. Start Nav2, or add --sim to run in the simulator."
_TURN_SEC = 0.05


class NotReadyError(SarError):
    """Raised if a resource that the mission needs was not available in time.

    Attributes:
        missing: A line for each missing resource.
        waited_sec: The duration of the wait, in seconds; None if the run did not wait because waiting cannot help.
        hint: A common remedy for all missing resources; empty if there is none.
    """

    exit_status = 3

    def __init__(self, missing: Iterable[str], waited_sec: float | None, hint: str = "") -> None:
        self.missing = list(missing)
        self.waited_sec = waited_sec
        problem = "the mission cannot start" if waited_sec is None else f"not ready after {waited_sec:.1f} s"
        lines = [f"{problem}:", *(f"  {line}" for line in self.missing)]
        super().__init__("\n".join([*lines, hint] if hint else lines))


class Readiness:
    """Checks whether the requirements of a tree are fulfilled.

    The methods do not block: `poll` performs the next step between two spins of the executor.

    Args:
        node: The node on which the tree will run.
        uses: The resources that the tree's leaves use, with resolved names; may contain duplicates.
        initial_pose: The initial pose for the localisation, if Nav2 is used: x, y (m), yaw (rad) in the
            frame `map`; None to send no pose, and not to wait for the localisation's pose.
        restarts: Whether the localisation is known to have no pose yet.
        can_resume: Whether the journal of an interrupted mission exists.
        endpoints: The types and QoS profiles of the actions, services and topics that leaves use; a resource that is not listed may have any type.
        first: Further requirements, which are checked before all others. The caller must close them.
        report: Called whenever a requirement changes, with a description of all requirements for operators.

    Attributes:
        uses_nav2: Whether a leaf requires Nav2 to be localised and active.
        ends_by_itself: Whether one of the further requirements is not fulfilled yet, but will be without intervention.
    """

    def __init__(
        self,
        node: Node,
        uses: Iterable[Use],
        *,
        initial_pose: InitialPose | None,
        restarts: bool = False,
        can_resume: bool = False,
        endpoints: Mapping[Use, Endpoint] | None = None,
        first: Iterable[Requirement] = (),
        report: Callable[[Sequence[AwaitedItem]], object] = lambda _: None,
    ) -> None:
        self.node = node
        self._first = tuple(first)
        self.ends_by_itself = False
        # The name of each check, and the function that performs the check's next step and returns what is missing.
        self._steps: list[tuple[str, Callable[[], str | None]]] = []
        self._report, self._reported = report, dict[str, str]()
        self._closing: list[Requirement] = []
        self._localised: LocalisationCheck | None = None
        self._graph = ros_graph(node)
        uses = list(dict.fromkeys(uses))
        self._endpoints = [
            (endpoints or {}).get(use, Endpoint(use.kind, use.name)) for use in uses if use.name
        ]
        self._steps.append(("the clock", lambda: self._graph.clock() or None))
        self.uses_nav2 = any(use.kind == "nav2" for use in uses)
        if self.uses_nav2:
            self._wait_for_nav2(initial_pose, restarts, can_resume)
        elif Use.transforms() in uses:
            sources = frame_sources(node)
            explain = self._graph.explain_missing_transforms
            self._steps.append((_POSITION, lambda: explain() or sources.conflict() or None))
        self._steps += [
            (each.name.rpartition("/")[2].replace("_", " "), partial(self._missing_endpoint, each))
            for each in self._endpoints
            if each.kind != "node"
        ]

    @property
    def _is_robot_elsewhere(self) -> bool:
        """Whether the localisation has a different name, which explains why other resources are missing."""
        return bool(self._graph.query(Endpoint("node", NAV2_NODES[0])).elsewhere)

    def _localisation_conflict(self) -> str | None:
        if self._is_robot_elsewhere:
            return None
        return robot_estimate(self.node).localisation_conflict() or None

    def _missing_endpoint(self, endpoint: Endpoint) -> str | None:
        return self._graph.query(endpoint).line

    def _wait_for_nav2(self, initial_pose: InitialPose | None, restarts: bool, can_resume: bool) -> None:
        localizer, navigator = NAV2_NODES
        self._parameters = nav2_parameters(self.node)
        if initial_pose is not None:
            self._localised = LocalisationCheck(
                self.node, initial_pose, restarts=restarts, can_resume=can_resume
            )
            self._closing.append(self._localised)
            self._steps.append((_POSITION, self._localised.poll))
        # The state is queried until all requirements are fulfilled, because the node may become inactive again.
        self._steps.append((_POSITION, robot_estimate(self.node).lifecycle(localizer).poll))
        self._closing.append(Nav2Check(self.node, navigator, tells_pose=initial_pose is not None))
        self._steps.append(("navigation", self._closing[-1].poll))
        self._endpoints += [Endpoint("node", name) for name in NAV2_NODES]
        self._steps.append((_POSITION, self._localisation_conflict))

    @property
    def is_nav2_absent(self) -> bool:
        """Whether Nav2 is required, but the ROS graph contains no Nav2 node under any name."""
        nodes = [self._graph.query(Endpoint("node", name)) for name in NAV2_NODES]
        return self.uses_nav2 and not any(each.is_there or each.elsewhere for each in nodes)

    @property
    def has_rival_servers(self) -> bool:
        """Whether several servers with the same name would accept the same goal, or `/clock` has several publishers."""
        servers = any(self._graph.query(each).is_contested for each in self._endpoints)
        return servers or self._graph.is_clock_contested

    def poll(self) -> bool:
        """Perform the next step of all checks.

        Returns:
            Whether all requirements are fulfilled. The clients and publishers of the checks are then destroyed.
        """
        if self.poll_all():
            return False
        if self._steps:
            self.warn()
        self.close()
        return True

    def poll_all(self) -> list[str]:
        """Perform the next step of all checks; return a line for each missing resource."""
        first = {each: line for each in self._first if (line := each.poll()) is not None}
        self.ends_by_itself = any(each.ends_by_itself for each in first)
        if self._localised is not None:
            self._localised.may_publish = not first
        items = {each.title: first.get(each, "") for each in self._first}
        # While a further requirement is missing, the other checks continue, but change nothing. Their error is raised when no further requirement is missing.
        others: list[str] = []
        with suppress(SarError) if first else nullcontext():
            for name, step in self._steps:
                line = step()
                items[name] = items.get(name) or line or ""
                others += [line] if line is not None else []
        if items != self._reported:
            self._reported = items
            self._report([*map(AwaitedItem, items, items.values())])
        lines = [*first.values()] or others
        advice = self._graph.advice(self._endpoints) if lines and not first else ""
        # The parameters are queried last, because Nav2's nodes declare most parameters while they are configured.
        if not lines and self.uses_nav2 and self._parameters.are_awaited():
            return ["the parameters of Nav2's nodes (no response yet)"]
        return [*lines, advice] if advice else lines

    def warn(self) -> None:
        """Log problems that do not prevent the start, such as a topic with several sources."""
        topics = [each.name for each in self._endpoints if each.kind == "topic"]
        lines = [self._graph.unused_clock_problem()]
        if self.uses_nav2 and not self._is_robot_elsewhere:
            topics += ["map", "amcl_pose", _ODOMETRY.name]
            odometry = self._graph.query(_ODOMETRY)
            lines.append(
                f"{odometry.title}: {odometry.problem}{odometry.explanation}" if odometry.elsewhere else ""
            )
        for line in dict.fromkeys([*lines, *map(self._graph.publisher_conflict, topics)]):
            if line:
                self.node.get_logger().warning(escape_to_one_line(f"{line}."))

    def close(self) -> None:
        """Destroy the clients and publishers of the checks."""
        closing, self._closing, self._steps, self._endpoints = self._closing, [], [], []
        for each in closing:
            each.close()
        if self.uses_nav2:
            self._parameters.close()


def wait_until_ready(
    executor: Executor, readiness: Readiness, timeout_sec: float, should_stop: Callable[[], bool]
) -> None:
    """Spin until all requirements are fulfilled.

    Args:
        executor: The executor of the node.
        readiness: The requirements to wait for.
        timeout_sec: The time limit, in seconds of the steady clock. The limit does not run while a missing requirement will be fulfilled
            without intervention.
        should_stop: Returns whether to stop waiting. The function then returns normally.

    Raises:
        NotReadyError: If the time limit expires, if the robot is not at the initial pose of the mission, or if two servers share a name for
            longer than a killed server stays in the ROS graph.
    """
    start = time.monotonic()
    reported_at, contested_since = start, None
    logger = readiness.node.get_logger()
    try:
        while not should_stop() and not readiness.poll():
            now = time.monotonic()
            if readiness.ends_by_itself:
                start = now
            if not readiness.has_rival_servers:
                contested_since = None
            elif contested_since is None:
                contested_since = now
                logger.warning(_waiting_line(readiness))
            shadow = contested_since is None or now - contested_since < SHADOW_SEC
            if now - start >= timeout_sec or not shadow:
                readiness.warn()
                raise NotReadyError(
                    readiness.poll_all(), now - start, _ABSENT if readiness.is_nav2_absent else ""
                )
            if now - reported_at >= _PROGRESS_PERIOD_SEC:
                reported_at = now
                logger.info(_waiting_line(readiness))
            if not _spin_for(executor, min(_TURN_SEC, timeout_sec)):
                return
    except RobotMovedError as error:
        raise NotReadyError([str(error)], None) from error
    finally:
        readiness.close()


def _waiting_line(readiness: Readiness) -> str:
    return escape_to_one_line("Waiting for: " + "; ".join(readiness.poll_all()))


def _spin_for(executor: Executor, duration_sec: float) -> bool:
    """Spin an executor for a duration; return whether ROS is still running."""
    deadline = time.monotonic() + duration_sec
    try:
        while executor.context.ok() and (left := deadline - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)
    except (ExternalShutdownException, InvalidHandle):
        return False
    return bool(executor.context.ok())
