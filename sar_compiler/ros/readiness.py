"""Waiting, before the first tick, for the resources that a tree's leaves declare."""

import time
from collections.abc import Callable, Iterable, Mapping

from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node

from sar_compiler.errors import SarError
from sar_compiler.nodes.spec import Use
from sar_compiler.ros.leaves.lifecycle import NAV2_NODES
from sar_compiler.ros.requirements import (
    ClockRuns,
    InitialPose,
    Localised,
    MisplacedRobotError,
    NavigatorActive,
    NodeActive,
    OneServer,
    Published,
    Requirement,
)
from sar_compiler.tree.showing import in_one_line

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
        types: The types that actions, services and topics must have; those without one may have any.
        first: Requirements of the caller, who also closes them, to look at before all others.

    Attributes:
        ends_by_itself: Whether one of those of the caller that was missing when it was looked last will be there by itself.
    """

    def __init__(
        self,
        node: Node,
        uses: Iterable[Use],
        *,
        initial_pose: InitialPose | None,
        begins_anew: bool = False,
        types: Mapping[Use, str] | None = None,
        first: Iterable[Requirement] = (),
    ) -> None:
        self.node = node
        self._first = tuple(first)
        self.ends_by_itself = False
        self._uses = list(dict.fromkeys(uses))
        self._requirements: list[Requirement] = []
        if node.get_clock().ros_time_is_active:
            self._requirements.append(ClockRuns(node))
        if self.uses_nav2:
            if initial_pose is not None:
                self._requirements.append(Localised(node, initial_pose, begins_anew=begins_anew))
            localizer, navigator = NAV2_NODES
            self._requirements += [
                NodeActive(node, localizer),
                NavigatorActive(node, navigator, tells_pose=initial_pose is not None),
            ]
        for use in self._uses:
            type_name = (types or {}).get(use)
            if use.kind in ("action", "service"):
                self._requirements.append(OneServer(node, use.kind, use.name, type_name))
            elif use.kind == "topic":
                self._requirements.append(Published(node, use.name, type_name))

    @property
    def uses_nav2(self) -> bool:
        """Whether a leaf needs Nav2 to be localised and active."""
        return any(use.kind == "nav2" for use in self._uses)

    @property
    def contested(self) -> bool:
        """Whether several servers have the same name, and would all accept the same goal."""
        return any(isinstance(each, OneServer) and each.contested for each in self._requirements)

    def poll(self) -> bool:
        """Take the next step.

        Returns:
            Whether all requirements are fulfilled; the clients and subscriptions made for them are then destroyed.
        """
        if self.missing():
            return False
        self.close()
        return True

    def missing(self) -> list[str]:
        """Take the next step, and return what is missing, one readable line each."""
        first = {each: line for each in self._first if (line := each.missing()) is not None}
        self.ends_by_itself = any(each.ends_by_itself for each in first)
        return list(first.values()) or _missing(self._requirements)

    def close(self) -> None:
        """Destroy the clients and subscriptions on the node, when the wait is given up."""
        requirements, self._requirements = self._requirements, []
        for each in requirements:
            each.close()


def _missing(requirements: Iterable[Requirement]) -> list[str]:
    return [line for line in [each.missing() for each in requirements] if line is not None]


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
