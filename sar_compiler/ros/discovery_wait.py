"""Wait until discovery has found the other nodes of the ROS graph."""

import time
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node

# The default time without a new node, in seconds: twice the time in which half of the participants discover each other.
SETTLING_SEC = 1.0
# The maximum duration of the wait if new nodes keep appearing, as a multiple of the time without a new node.
_LONGEST = 10.0


def node_names(node: "Node") -> "Counter[str]":
    """Count the discovered nodes, including the node itself, by full name."""
    return Counter(f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces())


class DiscoveryWait:
    """A wait that ends when no new node has appeared for some time.

    Discovery begins when a node is created. Create this object at the same time, and do other work during the wait.

    Args:
        node: The node that discovers other nodes.
        settling_sec: The time without a new node after which the wait is over, in seconds.
    """

    def __init__(self, node: "Node", settling_sec: float = SETTLING_SEC) -> None:
        # Nodes that are already discovered do not prolong the wait.
        self._node, self._settling_sec, self._seen = node, settling_sec, node_names(node)
        self._since: float | None = time.monotonic()
        self._over_at = self._since + settling_sec

    def ignore(self, name: str) -> None:
        """Ignore the appearance of one node with this full name, because this process has created it."""
        self._seen |= Counter([name])

    def extend(self, share: float) -> None:
        """Extend the wait by a share of the settling time, so that a new subscription can receive messages."""
        self._over_at = max(self._over_at, time.monotonic() + share * self._settling_sec)

    def has_settled(self) -> bool:
        """Check for new nodes, and return whether the wait is over."""
        now, names = time.monotonic(), node_names(self._node)
        if names - self._seen:
            self._seen |= names
            if self._since is None:
                self._since = now
            self._over_at = min(now + self._settling_sec, self._since + _LONGEST * self._settling_sec)
        if now >= self._over_at:
            self._since = None
        return now >= self._over_at
