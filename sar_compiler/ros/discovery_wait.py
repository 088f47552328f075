"""Wait until discovery has found the other nodes of the ROS graph."""

import time
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node

# Twice the time in which half of the participants discover each other; seconds.
SETTLING_SEC = 1.0
# The maximum, as a multiple, if nodes keep appearing.
_LONGEST = 10.0


def node_names(node: "Node") -> "Counter[str]":
    """Return the full names of all nodes that a node has discovered, including its own, with their counts."""
    return Counter(f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces())


class DiscoveryWait:
    """A wait that is over when no other node has appeared for some time.

    Discovery begins when a node is created. Create this object then, so that other work is done meanwhile.

    Args:
        node: The node that discovers the others.
        settling_sec: The time without a new node, seconds.
    """

    def __init__(self, node: "Node", settling_sec: float = SETTLING_SEC) -> None:
        # Nodes that are already discovered do not prolong the wait.
        self._node, self._settling_sec, self._seen = node, settling_sec, node_names(node)
        self._since: float | None = time.monotonic()
        self._over_at = self._since + settling_sec

    def ignore(self, name: str) -> None:
        """Ignore that one node with a full name appears: another one of this process."""
        self._seen |= Counter([name])

    def extend(self, share: float) -> None:
        """Wait from now on for at least a share of the time, because a new subscription receives nothing at once."""
        self._over_at = max(self._over_at, time.monotonic() + share * self._settling_sec)

    def has_settled(self) -> bool:
        """Look for new nodes, and return whether the wait is over; discovery is slow on a busy machine."""
        now, names = time.monotonic(), node_names(self._node)
        if names - self._seen:
            self._seen |= names
            if self._since is None:
                self._since = now
            self._over_at = min(now + self._settling_sec, self._since + _LONGEST * self._settling_sec)
        if now >= self._over_at:
            self._since = None
        return now >= self._over_at
