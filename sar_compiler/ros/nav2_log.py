"""What the nodes of Nav2 have logged lately: its own reason for what it does, in the same second."""

import math
import time
from collections import deque
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.lifecycle import DRIVING_NODES
from sar_compiler.ros.of_node import of_node

if TYPE_CHECKING:
    from rclpy.node import Node

# How many lines are quoted, and up to which length.
_QUOTED, _LONGEST = 2, 200
# How many lines are kept, and may come at once.
_LINES = 100
# What says no more than that something has failed.
_GENERIC = ("Goal failed", "Aborting handle", "[ActionServer]", "Failed to change state")

MANAGER = "lifecycle_manager_navigation"
"""The lifecycle manager that brings Nav2 up."""
BEFORE_NAVIGATOR = (
    "controller_server",
    "smoother_server",
    "planner_server",
    "route_server",
    "behavior_server",
    "velocity_smoother",
    "collision_monitor",
)
"""The nodes that it activates before the navigator, in this order."""

# Who is heard.
_SPEAKERS = {*DRIVING_NODES, *BEFORE_NAVIGATOR, MANAGER}


class Nav2Log:
    """Warnings and errors of Nav2's nodes, in the namespace of a node; use `nav2_log`.

    Args:
        node: The rclpy node.
    """

    def __init__(self, node: "Node") -> None:
        from rcl_interfaces.msg import Log
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._lines: deque[tuple[float, str, str]] = deque(maxlen=_LINES)
        self._prefix = node.get_namespace().strip("/").replace("/", ".")
        self._least = Log.WARN
        # Kept for latecomers: what was said just before somebody asks counts, too.
        latched = QoSProfile(depth=_LINES, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(Log, "/rosout", self._take, latched)

    def quote(self, name: str = "", *, since: float = -math.inf) -> str:
        """Return what was logged last: `controller_server: "Failed to make progress"`; empty if nothing was.

        Args:
            name: Of this node alone; by default of all.
            since: Steady seconds from which on lines count.
        """
        said = [
            f'{who}: "{text[:_LONGEST]}"'
            for at, who, text in self._lines
            if at >= since and name in ("", who) and not any(part in text for part in _GENERIC)
        ]
        return "; ".join(list(dict.fromkeys(said))[-_QUOTED:])

    def _take(self, message: Any) -> None:
        name = message.name.removeprefix(f"{self._prefix}.") if self._prefix else message.name
        if message.level >= self._least and name in _SPEAKERS:
            self._lines.append((time.monotonic(), name, message.msg))


def nav2_log(node: "Node") -> Nav2Log:
    """Return what Nav2 has logged, the same object in every call with a node; it exists as long as it."""
    return of_node(node, Nav2Log, lambda: Nav2Log(node))
