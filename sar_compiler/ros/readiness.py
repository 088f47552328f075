"""Waiting, before the first tick, for the resources that a tree's leaves declare."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext, suppress
from functools import partial

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from sar_compiler.errors import SarError
from sar_compiler.nodes.spec import Use
from sar_compiler.ros.clock import AWAKE
from sar_compiler.ros.frame_sources import frame_sources
from sar_compiler.ros.graph_queries import Endpoint, ros_graph, with_full_name
from sar_compiler.ros.lifecycle import (
    BEFORE_NAVIGATOR,
    MANAGER,
    NAV2_NODES,
    PolledService,
)
from sar_compiler.ros.nav2_log import nav2_log
from sar_compiler.ros.nav2_parameters import nav2_parameters
from sar_compiler.ros.poses import estimated_pose
from sar_compiler.ros.robot_estimate import robot_estimate
from sar_compiler.tree.showing import in_one_line

InitialPose = tuple[float, float, float]
"""x and y in metres, yaw in radians."""

_INITIAL_POSE_PERIOD_SEC = 1.0
# How long a localisation is listened to before it is told a pose: twice what half of the participants take to meet.
_LISTEN_SEC = 1.0
# How long the odometry may take to come after the transforms from `map`: without it these are no place.
_PLACE_SEC = 5.0
MOVED_M = 0.25
"""Less movement than this is none for AMCL either (its `update_min_d`), metres."""
# A pose that is this near to the initial one is the same, metres and radians.
_AGREES_M, _AGREES_RAD = 0.5, 0.5

_ODOMETRY = Endpoint("topic", "odometry/filtered", "nav_msgs/msg/Odometry")

# What a bring-up without an initial pose fails at.
_WAITS_FOR_POSE = ("planner_server", "failed to activate")


class Requirement(ABC):
    """A requirement that must be fulfilled before the first tick.

    Attributes:
        ends_by_itself: Whether it is there in the end whatever anybody does: no time limit counts meanwhile.
    """

    ends_by_itself = False

    @abstractmethod
    def missing(self) -> str | None:
        """Take the next step, and describe what is missing; None if nothing is."""

    def close(self) -> None:  # noqa: B027 - most have created nothing
        """Destroy what was created on the node."""


class MisplacedRobotError(SarError):
    """A robot that is not where a mission would tell its localisation.

    Attributes:
        place: Where it is by its localisation: x, y (m) and yaw (rad), frame `map`; None if it has one, and does not say which.
        pose: Where the mission begins.
        moved: How far it has driven by its odometry, metres, where its localisation has no pose; else None.
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
        resume = "Go on with the mission that was interrupted (--resume)" if can_resume else ""
        if moved is not None:
            super().__init__(
                f"the localisation has no pose, and by the odometry the robot is {moved:.2f} m from its start: it is not told "
                f"{start}. {f'{resume}, or give' if resume else 'Give'} it the pose (in RViz: 2D Pose Estimate), and begin "
                "where the robot stands: -p set_initial_pose:=false"
            )
            return
        where, value = "knows where the robot is, by its transforms", ""
        if place is not None:
            far = math.dist(place[:2], pose[:2])
            where = f"has the robot at ({place[0]:.2f}, {place[1]:.2f}), {far:.2f} m from {start}"
            value = f"-p initial_pose.x:={place[0]:.2f} -p initial_pose.y:={place[1]:.2f}, or "
        super().__init__(
            f"the localisation {where}: it is not told another pose. {f'{resume}, drive' if resume else 'Drive'} back first, "
            f"or say where the robot is ({value}-p set_initial_pose:=false to begin where "
            f"it stands; where the localisation is wrong, in RViz: 2D Pose Estimate)"
        )


class Localised(Requirement):
    """A localisation that must have a pose, the initial one unless it has another already.

    A localisation that has a pose is told another one only if that is nearly the same; far from it the start is refused. One without
    a pose is told the initial one only if the odometry shows that the robot has not moved, as in a run (`ros.watch`). The
    pose is published until an answer arrives: an old pose, kept by the publisher for late subscribers, does not confirm this one.

    Args:
        node: The node to publish with.
        pose: The robot's pose, in the frame `map`.
        begins_anew: Whether the localisation is known to have none, as that of a simulation that has just begun.
        can_resume: Whether the journal of the mission before is there.

    Attributes:
        may_publish: Whether the pose may be published; until then the localisation is only listened to.
    """

    may_publish = True

    def __init__(
        self, node: Node, pose: InitialPose, *, begins_anew: bool = False, can_resume: bool = False
    ) -> None:
        self._node = node
        self._pose = pose
        self._robot = robot_estimate(node)
        self._begins_anew, self._can_resume = begins_anew, can_resume
        self._heard_of_at = -math.inf if begins_anew else math.inf
        self._sent_at = -math.inf
        self._localised_at = math.inf
        self._answered = False
        self._answers, self._poses = (
            with_full_name(topic, node.resolve_topic_name(topic)) for topic in ("amcl_pose", "initialpose")
        )
        self._publisher = node.create_publisher(PoseWithCovarianceStamped, "initialpose", QoSProfile(depth=1))

    def missing(self) -> str | None:
        """Publish the pose if it is due, and describe a missing answer; None once there is one.

        Raises:
            MisplacedRobotError: If the localisation has a pose that is far from the initial one.
        """
        has_taken_it = self._has_asked and self._robot.pose_at >= self._sent_at
        now = AWAKE.now()
        if not (self._answered or has_taken_it):
            if self._robot.localisation_conflict():
                return f"topic {self._answers}: no initial pose is sent while another robot's localisation may be heard"
            if self._is_heard_too_briefly(now):
                return f"topic {self._answers}: waiting for what the localisation says"
        self._answered = self._answered or has_taken_it or self._keeps_its_own()
        if self._answered:
            return None
        heard = self._publisher.get_subscription_count() > 0
        has_been_listened_to = self._has_been_listened_to(now)
        if (
            heard
            and self.may_publish
            and has_been_listened_to
            and self._has_not_moved()
            and now - self._sent_at >= _INITIAL_POSE_PERIOD_SEC
        ):
            self._sent_at = now
            self._publisher.publish(estimated_pose(self._node, *self._pose))
        x, y, yaw = self._pose
        deaf = "" if heard else f", and nobody listens to {self._poses}"
        return f"topic {self._answers}: no answer to the initial pose ({x:.2f}, {y:.2f}, yaw {yaw:.2f}){deaf}"

    def close(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)

    @property
    def _has_asked(self) -> bool:
        return self._sent_at > -math.inf

    def _has_not_moved(self) -> bool:
        """Return whether a robot that is not localised stands where its odometry has begun, or says `initial_pose`; True without odometry.

        Raises:
            MisplacedRobotError: If it does not.
        """
        is_known = self._begins_anew or self._has_asked or self._robot.is_localised
        if is_known or not ros_graph(self._node).publishers(_ODOMETRY.name):
            return True
        if self._robot.odometry is None:
            return False
        here = self._robot.odometry[:2]
        moved = min(math.dist(here, (0.0, 0.0)), math.dist(here, self._pose[:2]))
        if moved > MOVED_M:
            raise MisplacedRobotError(None, self._pose, moved=moved, can_resume=self._can_resume)
        return True

    def _is_heard_too_briefly(self, now: float) -> bool:
        """Return whether a localisation that has just been heard may still say something else: of several publishers, or without odometry yet."""
        if not self._robot.is_localised:
            return False
        is_placed = self._robot.place() is not None
        if is_placed and len(ros_graph(self._node).publisher_ids("/tf")) < 2:  # noqa: PLR2004 - then they are of one
            return False
        self._localised_at = min(self._localised_at, now)
        return now - self._localised_at < (_LISTEN_SEC if is_placed else _PLACE_SEC)

    def _keeps_its_own(self) -> bool:
        """Return whether the localisation has a pose at the initial place, with another yaw.

        Raises:
            MisplacedRobotError: If it has one elsewhere.
        """
        others = self._robot.pose is None and self._robot.hears_others
        if self._has_asked or not self._robot.is_localised or others:
            return False
        place = self._robot.place()
        if place is None or not math.dist(place[:2], self._pose[:2]) <= _AGREES_M:
            raise MisplacedRobotError(place, self._pose, can_resume=self._can_resume)
        turned = abs(math.remainder(place[2] - self._pose[2], math.tau))
        if not turned <= _AGREES_RAD:
            self._node.get_logger().warning(
                f"The localisation keeps its yaw of {place[2]:.2f} rad, which is not that of initial_pose ({self._pose[2]:.2f})."
            )
        return not turned <= _AGREES_RAD

    def _has_been_listened_to(self, now: float) -> bool:
        """Return whether a localisation that has a pose would have said so: what it keeps for latecomers has had time to come."""
        if self._heard_of_at == math.inf and ros_graph(self._node).publishers("amcl_pose"):
            self._heard_of_at = now
        return now - self._heard_of_at >= _LISTEN_SEC


class NavigatorActive(Requirement):
    """Nav2's navigator, which must be active; where it stays inactive, the reason is looked for.

    Nav2's lifecycle manager activates its nodes in an order, the navigator late. Where one before it cannot be
    activated, it gives up for good: the most frequent is `planner_server`, which waits for the frame `map`, thus for the
    initial pose, no longer than `initial_transform_timeout`.

    Args:
        node: The node to ask with.
        name: The relative name of the navigator.
        tells_pose: Whether the localisation is told a pose meanwhile; if not, it is named where that is what is missing.
    """

    def __init__(self, node: Node, name: str, *, tells_pose: bool) -> None:
        self._node, self._robot, self._tells_pose = node, robot_estimate(node), tells_pose
        self._lifecycle, self._log = self._robot.lifecycle(name), nav2_log(node)
        self._manager: PolledService | None = None

    def missing(self) -> str | None:
        """Ask if it is due, and describe the last answer and its reason; None if that was `active`."""
        # What it waits for may just have come.
        line, state = self._lifecycle.missing(self._robot.pose_at), self._lifecycle.state
        if line is None:
            return None
        awaited = self._log.awaited_node()
        if awaited and not ros_graph(self._node).ask(Endpoint("node", awaited)).is_there:
            said = self._log.quote(awaited)
            return (
                f"{line}: {MANAGER} waits for {awaited}, whose process was not started or has died"
                f"{f' ({said})' if said else ''}; start Nav2 again"
            )
        return line if state is None else line + self._reason(state) + self._pose()

    def close(self) -> None:
        """Destroy the client."""
        if self._manager is not None:
            self._manager.close()

    def _reason(self, state: str) -> str:
        """Ask the manager, and the nodes that it activates before; return what they have answered."""
        if self._manager is None:
            self._manager = PolledService(self._node, Trigger, f"{MANAGER}/is_active")
        self._manager.ask()
        before = [self._robot.lifecycle(name) for name in BEFORE_NAVIGATOR]
        for each in before:
            each.missing()
        states = {each.name: each.state for each in before if each.state is not None}
        asleep = next((pair for pair in states.items() if pair[1] != "active"), None)
        # It does not answer while it is at work.
        if self._manager.answer is None or self._manager.answer.success:
            return f"; {asleep[0]} is '{asleep[1]}', too" if asleep else ""
        if {state, *states.values()} == {"unconfigured"} and not self._log.quote():
            call = self._node.resolve_service_name(f"{MANAGER}/manage_nodes")
            return (
                f"; {MANAGER} has not started Nav2 up (autostart is off): "
                f'ros2 service call {call} nav2_msgs/srv/ManageLifecycleNodes "{{command: 0}}"'
            )
        stuck, what = _stuck({**states, self._lifecycle.name: state}, self._log.failed_change())
        said = self._log.quote(stuck)
        pose = ", and give the initial pose within its initial_transform_timeout"
        if self._robot.localisation_conflict():
            pose = ""
        return (
            f"; {MANAGER} has given up starting Nav2 up, {stuck} {what}{f' ({said})' if said else ''}: "
            f"start Nav2 again{pose if (stuck, what) == _WAITS_FOR_POSE else ''}"
        )

    def _pose(self) -> str:
        """Describe that the localisation has no pose and is given none: the nodes behind it wait for that."""
        if self._tells_pose or self._robot.is_localised or not ros_graph(self._node).publishers("amcl_pose"):
            return ""
        if self._robot.localisation_conflict():
            return ""
        poses = with_full_name("initialpose", self._node.resolve_topic_name("initialpose"))
        return f"; the localisation has no pose yet: give it one ({poses}; in RViz: 2D Pose Estimate)"


def _stuck(states: Mapping[str, str], named: str) -> tuple[str, str]:
    """Return the node that a bring-up has failed at, and what it failed to do, in words.

    Args:
        states: The states of the nodes, in the order of the bring-up.
        named: The node that the lifecycle manager names; empty if it names none.
    """
    if named in states:
        # The manager takes one step of all nodes after the other: a node that is one step ahead has taken it, and its answer was lost.
        others = {state for name, state in states.items() if name != named}
        if states[named] == "active" or (states[named] == "inactive" and "unconfigured" in others):
            done = "activated" if states[named] == "active" else "configured"
            return named, f"was {done}, and its answer was lost"
    steps = (("unconfigured", "failed to configure"), ("inactive", "failed to activate"))
    for state, what in steps:
        if named in states and states[named] == state:
            return named, what
    for state, what in steps:
        for name in states:
            if states[name] == state:
                return name, what
    return next(name for name in states if states[name] != "active"), "failed to activate"


# How long a server that was killed still counts in the graph (20 s by default of the middleware), and a
# little more: two servers may be one and the shadow of another.
SHADOW_SEC = 22.0

_PROGRESS_PERIOD_SEC = 5.0
_TURN_SEC = 0.05


class NotReadyError(SarError):
    """A resource that the mission needs did not become available in time, or never can.

    Attributes:
        missing: The missing resources, in one line each.
        waited_sec: The time waited, in seconds; None if waiting could not help.
    """

    exit_status = 3

    def __init__(self, missing: Iterable[str], waited_sec: float | None) -> None:
        self.missing = list(missing)
        self.waited_sec = waited_sec
        lines = "".join(f"\n  {line}" for line in self.missing)
        problem = "the mission cannot start" if waited_sec is None else f"not ready after {waited_sec:.1f} s"
        super().__init__(f"{problem}:{lines}")


class Readiness:
    """The requirements of a tree, and which of them are fulfilled.

    Nothing here blocks: `poll` takes the next step, between two spins of the executor.

    Args:
        node: The node that the tree will run on.
        uses: The resources that the tree's leaves use, with resolved names; may contain duplicates.
        initial_pose: The initial pose for the localisation, if Nav2 is used: x, y (m), yaw (rad) in the
            frame `map`; None to send none and not to wait for it.
        begins_anew: Whether the localisation is known to have no pose yet.
        can_resume: Whether the journal of the mission before is there.
        endpoints: How the leaves use actions, services and topics; those that are not among them may be of any type.
        first: Requirements of the caller, who also closes them, to look at before all others.

    Attributes:
        uses_nav2: Whether a leaf needs Nav2 to be localised and active.
        ends_by_itself: Whether one of those of the caller that was missing when it was looked last will be there by itself.
    """

    def __init__(
        self,
        node: Node,
        uses: Iterable[Use],
        *,
        initial_pose: InitialPose | None,
        begins_anew: bool = False,
        can_resume: bool = False,
        endpoints: Mapping[Use, Endpoint] | None = None,
        first: Iterable[Requirement] = (),
    ) -> None:
        self.node = node
        self._first = tuple(first)
        self.ends_by_itself = False
        # The next steps of what is looked at, each of which says what is missing; and what is to be closed in the end.
        self._steps: list[Callable[[], str | None]] = []
        self._closing: list[Requirement] = []
        self._localised: Localised | None = None
        self._graph = ros_graph(node)
        uses = list(dict.fromkeys(uses))
        self._endpoints = [
            (endpoints or {}).get(use, Endpoint(use.kind, use.name)) for use in uses if use.name
        ]
        self._steps.append(lambda: self._graph.clock() or None)
        self.uses_nav2 = any(use.kind == "nav2" for use in uses)
        if self.uses_nav2:
            self._wait_for_nav2(initial_pose, begins_anew, can_resume)
        elif Use.transforms() in uses:
            sources = frame_sources(node)
            self._steps.append(lambda: self._graph.missing_transforms() or sources.conflict() or None)
        self._steps += [
            partial(self._missing_endpoint, each) for each in self._endpoints if each.kind != "node"
        ]

    @property
    def _is_robot_elsewhere(self) -> bool:
        """Whether the localisation is there under another name, which explains all the rest."""
        return bool(self._graph.ask(Endpoint("node", NAV2_NODES[0])).elsewhere)

    def _localisation_conflict(self) -> str | None:
        if self._is_robot_elsewhere:
            return None
        return robot_estimate(self.node).localisation_conflict() or None

    def _missing_endpoint(self, endpoint: Endpoint) -> str | None:
        return self._graph.ask(endpoint).line

    def _wait_for_nav2(self, initial_pose: InitialPose | None, begins_anew: bool, can_resume: bool) -> None:
        localizer, navigator = NAV2_NODES
        self._parameters = nav2_parameters(self.node)
        if initial_pose is not None:
            self._localised = Localised(
                self.node, initial_pose, begins_anew=begins_anew, can_resume=can_resume
            )
            self._closing.append(self._localised)
            self._steps.append(self._localised.missing)
        # Asked even after it was active: it may no longer be when all else is there.
        self._steps.append(robot_estimate(self.node).lifecycle(localizer).missing)
        self._closing.append(NavigatorActive(self.node, navigator, tells_pose=initial_pose is not None))
        self._steps.append(self._closing[-1].missing)
        self._endpoints += [Endpoint("node", name) for name in NAV2_NODES]
        self._steps.append(self._localisation_conflict)

    @property
    def contested(self) -> bool:
        """Whether several servers have the same name, and would all accept the same goal."""
        servers = any(self._graph.ask(each).is_contested for each in self._endpoints)
        return servers or self._graph.is_clock_contested

    def poll(self) -> bool:
        """Take the next step.

        Returns:
            Whether all requirements are fulfilled; the clients and subscriptions made for them are then destroyed.
        """
        if self.missing():
            return False
        if self._steps:
            self.warn()
        self.close()
        return True

    def missing(self) -> list[str]:
        """Take the next step, and return what is missing, one readable line each."""
        first = {each: line for each in self._first if (line := each.missing()) is not None}
        self.ends_by_itself = any(each.ends_by_itself for each in first)
        if self._localised is not None:
            self._localised.may_publish = not first
        # Questions are asked, and answers heard, also while something must be there before anything is changed.
        others: list[str] = []
        with suppress(SarError) if first else nullcontext():  # it is raised again when nothing goes before it
            others = [line for step in self._steps if (line := step()) is not None]
        lines = [*first.values()] or others
        advice = self._graph.advice(self._endpoints) if lines and not first else ""
        # Nav2's nodes declare most of their parameters while they are configured.
        if not lines and self.uses_nav2 and self._parameters.are_awaited():
            return ["the parameters of Nav2: no answer yet"]
        return [*lines, advice] if advice else lines

    def warn(self) -> None:
        """Log what does not keep the mission from starting, and may be wrong: several sources, or a clock that is not used."""
        topics = [each.name for each in self._endpoints if each.kind == "topic"]
        lines = [self._graph.unused_clock()]
        if self.uses_nav2 and not self._is_robot_elsewhere:
            topics += ["map", "amcl_pose", _ODOMETRY.name]
            odometry = self._graph.ask(_ODOMETRY)
            lines.append(
                f"{odometry.title}: {odometry.problem}{odometry.explanation}" if odometry.elsewhere else ""
            )
        for line in dict.fromkeys([*lines, *map(self._graph.several_publishers, topics)]):
            if line:
                self.node.get_logger().warning(in_one_line(f"{line}."))

    def close(self) -> None:
        """Destroy the clients and subscriptions on the node, when the wait is given up."""
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
        timeout_sec: The time limit, in seconds of the steady clock, from when no requirement is looked at that ends by itself.
        should_stop: Returns whether to stop waiting; the function then just returns.

    Raises:
        NotReadyError: If the time is over, if two servers share a name for longer than a killed
            server remains visible, or if the robot is not where the mission is said to begin.
    """
    start = time.monotonic()
    told, contested_since = start, None
    logger = readiness.node.get_logger()
    try:
        while not should_stop() and not readiness.poll():
            now = time.monotonic()
            if readiness.ends_by_itself:
                start = now
            if not readiness.contested:
                contested_since = None
            elif contested_since is None:
                contested_since = now
                logger.warning(_waiting_line(readiness))
            shadow = contested_since is None or now - contested_since < SHADOW_SEC
            if now - start >= timeout_sec or not shadow:
                readiness.warn()
                raise NotReadyError(readiness.missing(), now - start)
            if now - told >= _PROGRESS_PERIOD_SEC:
                told = now
                logger.info(_waiting_line(readiness))
            if not _spin_for(executor, min(_TURN_SEC, timeout_sec)):
                return
    except MisplacedRobotError as error:
        raise NotReadyError([str(error)], None) from error
    finally:
        readiness.close()


def _waiting_line(readiness: Readiness) -> str:
    return in_one_line("Waiting for: " + "; ".join(readiness.missing()))


def _spin_for(executor: Executor, duration_sec: float) -> bool:
    """Spin for a moment; return whether ROS is still up."""
    deadline = time.monotonic() + duration_sec
    try:
        while executor.context.ok() and (left := deadline - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)
    except (ExternalShutdownException, InvalidHandle):
        return False
    return bool(executor.context.ok())
