"""Ensure that only one mission uses a robot: missions publish claims in the ROS graph."""

import json
import math
import os
import platform
import time
import uuid
from collections.abc import Iterable
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from sar_compiler.errors import SarError
from sar_compiler.ros.discovery_wait import DiscoveryWait
from sar_compiler.ros.frame_sources import listener_name
from sar_compiler.ros.graph_queries import ros_graph
from sar_compiler.ros.readiness import SHADOW_SEC, Requirement

# The claims of nodes that are already discovered arrive within this share of the settling time for discovery.
_SHARE = 0.5
CLAIMS = "/_mission"
"""The suffix of the topic for claims to an action. The name of the topic is the action's name with this suffix."""

# Maximum length of a string from another node in a message, in characters.
_SHOWN = 80
# Maximum number of other missions that are stored and reported, because any node in the domain can send any number of claims.
_MOST = 8


class AnotherMissionError(SarError):
    """Raised if another mission already uses this robot.

    Attributes:
        claim: The claim of the other mission.
    """

    def __init__(self, claim: "LeaseClaim") -> None:
        self.claim = claim
        super().__init__(
            f"another mission already uses this robot: {claim.describe()} uses the action '{claim.action}'. "
            "Stop that mission first"
        )


class LeaseClaim(NamedTuple):
    """A mission's claim to an action, with the identity of its process.

    Attributes:
        action: The full name of the action.
        runs: Whether the mission's tree is ticked.
        since: The start of the mission, in nanoseconds of the clock of its machine.
        key: A unique identifier of the mission.
        node: The full name of the mission's node.
        host: The name of the mission's machine.
        pid: The process ID of the mission.
    """

    action: str
    runs: bool
    since: int
    key: str
    node: str
    host: str
    pid: int

    def describe(self) -> str:
        """Describe the mission by its node, process and machine; unprintable characters are escaped."""
        node, host = (ascii(text[:_SHOWN])[1:-1] for text in (self.node, self.host))
        return f"node {node} (process {self.pid} on {host})"

    def has_priority_over(self, other: "LeaseClaim") -> bool:
        """Return whether this claim has priority: running missions come first, then the mission that started first."""
        return (not self.runs, self.since, self.key) < (not other.runs, other.since, other.key)


class RobotLease(Requirement):
    """The requirement that no other mission uses the robot. Missions exchange claims to check this.

    Each mission claims the robot's actions. A claim is a latched message, so late subscribers receive it as long as the process of the
    mission exists.

    Args:
        node: The mission's node.
        actions: The resolved or relative names of the actions.
        discovery: The wait until other nodes are discovered.
        claims: Whether to claim the actions. If not, only the claims of other missions are checked.
    """

    ends_by_itself = True
    title = "a robot that no other mission uses"

    def __init__(
        self, node: Node, actions: Iterable[str], discovery: DiscoveryWait, *, claims: bool = True
    ) -> None:
        self._node, self._discovery = node, discovery
        discovery.ignore(f"{node.get_namespace().rstrip('/')}/{listener_name(node)}")
        self._others: dict[str, LeaseClaim] = {}
        self._reported: set[str] = set()
        # The time at which another node with the name of this node was first discovered: infinity before, None after the report.
        self._named_since: float | None = math.inf
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        own = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._mine = LeaseClaim(
            "",
            runs=False,
            since=time.time_ns(),
            key=uuid.uuid4().hex,
            node=node.get_fully_qualified_name(),
            host=platform.node(),
            pid=os.getpid(),
        )
        # An action's name is resolved like a service name, to which different remapping rules apply than to topic names.
        topics = {f"{node.resolve_service_name(action)}{CLAIMS}" for action in actions}
        self._publishers = (
            {topic: node.create_publisher(String, topic, own) for topic in topics} if claims else {}
        )
        self._subscriptions = [
            node.create_subscription(String, topic, self._on_claim, latched) for topic in topics
        ]
        self._publish()
        discovery.extend(_SHARE)

    def poll(self) -> str | None:
        """Describe the search for other missions while it continues; return None when the search has ended.

        Raises:
            AnotherMissionError: If another mission has priority.
        """
        rival = self._rival()
        if rival is not None:
            raise AnotherMissionError(rival)
        looks = self._subscriptions and not self._discovery.has_settled()
        return "looking for another mission on this robot" if looks else None

    def run(self) -> None:
        """Publish in the claims that the mission's tree is now being ticked."""
        self._mine = self._mine._replace(runs=True)
        self._publish()

    def conflict(self) -> str:
        """Return why this mission must end in favour of another mission, or '' if it can continue; log other missions."""
        for key in self._others.keys() - self._reported:
            self._reported.add(key)
            self._node.get_logger().warning(
                f"Another mission claims this robot: {self._others[key].describe()}."
            )
            if len(self._reported) == _MOST:
                self._node.get_logger().warning("Further missions that claim this robot are not reported.")
        self._check_namesake()
        rival = self._rival()
        return "" if rival is None else str(AnotherMissionError(rival))

    def _check_namesake(self) -> None:
        """Log once that another node has the same name as this node."""
        own, now = self._mine.node, time.monotonic()
        if self._named_since is None:
            return
        if ros_graph(self._node).node_counts()[own] < 2:  # noqa: PLR2004 - this one and another
            self._named_since = math.inf
        elif self._named_since == math.inf:
            self._named_since = now
        elif now - self._named_since > SHADOW_SEC:
            self._named_since = None
            self._node.get_logger().warning(
                f"Another node is also called {own}, so parameters and commands reach only one of the two. "
                "Give this node another name with --ros-args -r __node:=NAME"
            )

    def _rival(self) -> LeaseClaim | None:
        return next((other for other in self._others.values() if other.has_priority_over(self._mine)), None)

    def _publish(self) -> None:
        for topic, publisher in self._publishers.items():
            action = topic.removesuffix(CLAIMS)
            publisher.publish(String(data=json.dumps(self._mine._replace(action=action)._asdict())))

    def _on_claim(self, message: String) -> None:
        claim = parse_claim(message.data)
        if claim is None or claim.key == self._mine.key:
            return
        if len(self._others) >= _MOST and claim.key not in self._others:
            # If the maximum is reached, only a claim with priority over this mission is stored.
            if self._rival() is not None or not claim.has_priority_over(self._mine):
                return
            self._reported.add(claim.key)
            del self._others[next(iter(self._others))]
        self._others[claim.key] = claim


def parse_claim(text: str) -> LeaseClaim | None:
    """Parse the claim in a message; return None if the message contains no valid claim."""
    try:
        content: Any = json.loads(text)
        claim = LeaseClaim(**content)
    except (ValueError, TypeError, RecursionError):
        return None
    kinds = (str, bool, int, str, str, str, int)
    return claim if all(isinstance(part, kind) for part, kind in zip(claim, kinds, strict=True)) else None
