"""One mission for a robot: each says in the ROS graph which actions it drives, and heeds what others say."""

import json
import math
import os
import platform
import time
import uuid
from collections import Counter
from collections.abc import Iterable
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from sar_compiler.errors import SarError
from sar_compiler.ros.graph_queries import ros_graph
from sar_compiler.ros.readiness import SHADOW_SEC, Requirement

# How long to look for another mission before the first message that changes anything, seconds, from when the last node came
# into sight: twice what half of the participants take to meet.
LOOK_SEC = 1.0
# Where nodes keep coming, so many times that.
_LONGEST_LOOK = 10.0
CLAIMS = "/_mission"
"""How the topic of claims to an action ends."""

# What somebody else writes is shown up to this length.
_SHOWN = 80
# So many other missions are kept and told: whoever is in the domain can claim as often as he likes.
_MOST = 8


class AnotherMissionError(SarError):
    """Another mission drives this robot already.

    Attributes:
        claim: What it says of itself.
    """

    def __init__(self, claim: "MissionClaim") -> None:
        self.claim = claim
        super().__init__(
            f"another mission drives this robot already: {claim.describe()} uses the action '{claim.action}'. Stop it first"
        )


class MissionClaim(NamedTuple):
    """What a mission says of itself.

    Attributes:
        action: The action that it drives.
        runs: Whether its tree is ticked.
        since: When it began, nanoseconds of its machine's clock.
        key: Distinguishes it from any other.
        node: The full name of its node.
        host: The machine's name.
        pid: The process.
    """

    action: str
    runs: bool
    since: int
    key: str
    node: str
    host: str
    pid: int

    def describe(self) -> str:
        """Return who it is, in words, with unprintable characters escaped."""
        node, host = (ascii(text[:_SHOWN])[1:-1] for text in (self.node, self.host))
        return f"node {node} (process {self.pid} on {host})"

    def goes_before(self, other: "MissionClaim") -> bool:
        """Return whether the other has to give way: one that runs goes first, then the older one."""
        return (not self.runs, self.since, self.key) < (not other.runs, other.since, other.key)


class SoleMission(Requirement):
    """The claim of a mission to the actions that it drives, and those of others.

    A claim is a message that is kept for late subscribers, so it is there exactly as long as its process lives.

    Args:
        node: The mission's node.
        actions: The actions, with resolved or relative names.
        look_sec: How long to look for others at first, seconds; anew when a node comes into sight, with which a mission may.
        claims: Whether to claim them, or only to look.
    """

    ends_by_itself = True

    def __init__(
        self, node: Node, actions: Iterable[str], *, look_sec: float = LOOK_SEC, claims: bool = True
    ) -> None:
        self._node = node
        self._look_sec, self._seen = look_sec, Counter[str]()
        self._looks_since: float | None = time.monotonic()
        self._clear_at = self._looks_since + look_sec
        self._others: dict[str, MissionClaim] = {}
        self._told: set[str] = set()
        # When another node of this name was first seen: infinity for not yet, None once it was told.
        self._named_since: float | None = math.inf
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        own = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._mine = MissionClaim(
            "",
            runs=False,
            since=time.time_ns(),
            key=uuid.uuid4().hex,
            node=node.get_fully_qualified_name(),
            host=platform.node(),
            pid=os.getpid(),
        )
        # The action is among the services; names of topics are resolved by other rules.
        topics = {f"{node.resolve_service_name(action)}{CLAIMS}" for action in actions}
        self._publishers = (
            {topic: node.create_publisher(String, topic, own) for topic in topics} if claims else {}
        )
        self._subscriptions = [
            node.create_subscription(String, topic, self._take, latched) for topic in topics
        ]
        self._publish()

    def missing(self) -> str | None:
        """Describe that the look around is not over; None once it is.

        Raises:
            AnotherMissionError: If another mission goes before this one.
        """
        rival = self._rival()
        if rival is not None:
            raise AnotherMissionError(rival)
        looks = self._subscriptions and self._looks_around()
        return "looking for another mission on this robot" if looks else None

    def _looks_around(self) -> bool:
        """Return whether a mission may be there that was not heard yet: on a busy machine nodes meet late."""
        now, nodes = time.monotonic(), ros_graph(self._node).nodes()
        if nodes - self._seen:
            self._seen |= nodes
            if self._looks_since is None:
                self._looks_since = now
            self._clear_at = min(now + self._look_sec, self._looks_since + _LONGEST_LOOK * self._look_sec)
        if now >= self._clear_at:
            self._looks_since = None
        return now < self._clear_at

    def run(self) -> None:
        """Announce that the tree is ticked from now on."""
        self._mine = self._mine._replace(runs=True)
        self._publish()

    def trouble(self) -> str:
        """Return why this mission has to give way, while it runs; empty if it need not. Reports who else has come."""
        for key in self._others.keys() - self._told:
            self._told.add(key)
            self._node.get_logger().warning(
                f"Another mission wants this robot: {self._others[key].describe()}."
            )
            if len(self._told) == _MOST:
                self._node.get_logger().warning("No more missions that want this robot are told.")
        self._look_for_namesake()
        rival = self._rival()
        return "" if rival is None else str(AnotherMissionError(rival))

    def _look_for_namesake(self) -> None:
        """Report once that another node has this one's name: parameters and orders reach either of the two."""
        own, now = self._mine.node, time.monotonic()
        if self._named_since is None:
            return
        if ros_graph(self._node).nodes()[own] < 2:  # noqa: PLR2004 - this one and another
            self._named_since = math.inf
        elif self._named_since == math.inf:
            self._named_since = now
        elif now - self._named_since > SHADOW_SEC:
            self._named_since = None
            self._node.get_logger().warning(
                f"Another node is called {own}, too: what is sent to its parameters and services reaches one of the two. "
                "Give this one another name: --ros-args -r __node:=NAME"
            )

    def _rival(self) -> MissionClaim | None:
        return next((other for other in self._others.values() if other.goes_before(self._mine)), None)

    def _publish(self) -> None:
        for topic, publisher in self._publishers.items():
            action = topic.removesuffix(CLAIMS)
            publisher.publish(String(data=json.dumps(self._mine._replace(action=action)._asdict())))

    def _take(self, message: String) -> None:
        claim = parse_claim(message.data)
        if claim is None or claim.key == self._mine.key:
            return
        if len(self._others) >= _MOST and claim.key not in self._others:
            # One that goes before this mission is all that matters.
            if self._rival() is not None or not claim.goes_before(self._mine):
                return
            self._told.add(claim.key)
            del self._others[next(iter(self._others))]
        self._others[claim.key] = claim


def parse_claim(text: str) -> MissionClaim | None:
    """Return the claim that a message holds; None if it holds none."""
    try:
        said: Any = json.loads(text)
        claim = MissionClaim(**said)
    except (ValueError, TypeError, RecursionError):
        return None
    kinds = (str, bool, int, str, str, str, int)
    return claim if all(isinstance(part, kind) for part, kind in zip(claim, kinds, strict=True)) else None
