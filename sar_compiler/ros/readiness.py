"""Waiting, before the first tick, for what a tree's leaves say that they use."""

import time
from collections.abc import Callable, Iterable

from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node

from sar_compiler.errors import SarError
from sar_compiler.nodes.spec import Use
from sar_compiler.ros.requirements import (
    ClockRuns,
    Localised,
    NodeActive,
    OneServer,
    Pose,
    Published,
    Requirement,
)

# How long a server that was killed still counts in the graph (20 s by default of the middleware), and a
# little more: two servers may be one and the shadow of another.
_SHADOW_SEC = 22.0

_PROGRESS_PERIOD_SEC = 5.0
_TURN_SEC = 0.05


class NotReadyError(SarError):
    """Something that the mission needs did not appear in time.

    Attributes:
        missing: What, in one line each.
        waited_sec: How long it was waited for.
    """

    def __init__(self, missing: Iterable[str], waited_sec: float) -> None:
        self.missing = list(missing)
        self.waited_sec = waited_sec
        lines = "".join(f"\n  {line}" for line in self.missing)
        super().__init__(f"not ready after {waited_sec:.1f} s:{lines}")


class Readiness:
    """What a tree needs, and how much of it is there.

    Nothing here blocks: `poll` takes the next step, between two turns of the executor.

    Args:
        node: The node that the tree will run on.
        uses: What the tree's leaves use, with the names filled in; the same may be named repeatedly.
        initial_pose: What the localisation is told, if Nav2 is used: x, y (m), yaw (rad) in the frame
            `map`; None to tell it nothing and not to wait for it.
        localizer: The lifecycle node that localises, by its relative name.
        navigator: The lifecycle node that navigates, by its relative name.
    """

    def __init__(
        self,
        node: Node,
        uses: Iterable[Use],
        *,
        initial_pose: Pose | None,
        localizer: str = "amcl",
        navigator: str = "bt_navigator",
    ) -> None:
        self.node = node
        self._uses = list(dict.fromkeys(uses))
        self._requirements: list[Requirement] = []
        if node.get_clock().ros_time_is_active:
            self._requirements.append(ClockRuns(node))
        if self.uses_nav2:
            if initial_pose is not None:
                self._requirements.append(Localised(node, initial_pose))
            self._requirements += [NodeActive(node, name) for name in (localizer, navigator)]
        for use in self._uses:
            if use.kind in ("action", "service"):
                self._requirements.append(OneServer(node, use.kind, use.name))
            elif use.kind == "topic":
                self._requirements.append(Published(node, use.name))

    @property
    def uses_nav2(self) -> bool:
        """Whether a leaf needs a Nav2 that is localised and active."""
        return any(use.kind == "nav2" for use in self._uses)

    @property
    def contested(self) -> bool:
        """Whether several servers answer to the same name, and would all take the same goal."""
        return any(isinstance(each, OneServer) and each.contested for each in self._requirements)

    def poll(self) -> bool:
        """Take the next step.

        Returns:
            Whether everything is there; whatever was made on the node is then destroyed.
        """
        if self.missing():
            return False
        self.close()
        return True

    def missing(self) -> list[str]:
        """Take the next step, and return what is missing, one readable line each."""
        return [line for line in [each.missing() for each in self._requirements] if line is not None]

    def close(self) -> None:
        """Destroy what was made on the node, for one who waits no longer."""
        requirements, self._requirements = self._requirements, []
        for each in requirements:
            each.close()


def wait_until_ready(
    executor: Executor, readiness: Readiness, timeout_sec: float, should_stop: Callable[[], bool]
) -> None:
    """Spin until everything is there.

    Args:
        executor: The executor of the node.
        readiness: What to wait for.
        timeout_sec: For how long altogether, in seconds of the steady clock.
        should_stop: Says that nobody waits any more; the function then just returns.

    Raises:
        NotReadyError: If the time is over, or if two servers stay on one name for longer than a server
            that was killed is still seen.
    """
    start = time.monotonic()
    told, contested_since = start, None
    logger = readiness.node.get_logger()
    try:
        while not should_stop() and not readiness.poll():
            now = time.monotonic()
            if not readiness.contested:
                contested_since = None
            elif contested_since is None:
                contested_since = now
                logger.warning(_waiting_line(readiness))
            shadow = contested_since is None or now - contested_since < _SHADOW_SEC
            if now - start >= timeout_sec or not shadow:
                raise NotReadyError(readiness.missing(), now - start)
            if now - told >= _PROGRESS_PERIOD_SEC:
                told = now
                logger.info(_waiting_line(readiness))
            if not _spin_for(executor, min(_TURN_SEC, timeout_sec)):
                return
    finally:
        readiness.close()


def _waiting_line(readiness: Readiness) -> str:
    return "Waiting for: " + "; ".join(readiness.missing())


def _spin_for(executor: Executor, duration_sec: float) -> bool:
    """Spin for a moment; return whether ROS is still up."""
    deadline = time.monotonic() + duration_sec
    try:
        while executor.context.ok() and (left := deadline - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)
    except (ExternalShutdownException, InvalidHandle):
        return False
    return bool(executor.context.ok())
