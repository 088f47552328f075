"""Warnings and errors of Nav2's nodes on `/rosout`, which explain failed goals and failed bring-ups."""

import math
import re
import time
from collections import deque
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from sar_compiler.nodes.nav2.log_lines import DRIVING_NODES, MANAGER, LoggedLine, quote_lines
from sar_compiler.ros.leaves.leaf import of_node

if TYPE_CHECKING:
    from rclpy.node import Node

# Maximum number of stored lines.
_LINES = 200

_FAILED_CHANGE = re.compile(r"Failed to change state for node: ([\w/]+)")
# Log messages of the lifecycle manager before it waits for a node, and after the node has failed. They may contain colour codes.
_AWAITED = re.compile(
    r"(?:Configuring|Activating|Failed to change state for node:) ([\w/]+)|Waiting for service ([\w/]+)/get_state"
)
_ALL_ACTIVE = "Managed nodes are active"
# If the node in a manager's message exists, it is discovered within this time, in seconds of the steady clock.
_DISCOVERED_SEC = 2.0


class Nav2Log:
    """The warnings and errors that other nodes in a node's namespace have logged; created by `nav2_log`.

    Args:
        node: The rclpy node, which subscribes to `/rosout`.
    """

    def __init__(self, node: "Node") -> None:
        from rcl_interfaces.msg import Log
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._lines: deque[LoggedLine] = deque(maxlen=_LINES)
        self._awaited = ("", math.inf)
        self._node, self._prefix = node, node.get_namespace().strip("/").replace("/", ".")
        self._own = f"{self._prefix}.{node.get_name()}".lstrip(".")
        self._warning, self._error = Log.WARN, Log.ERROR
        # A transient local subscription also receives lines that were logged shortly before.
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(Log, "/rosout", self._on_line, latched)

    def quote(self, name: str = "", *, since: float = -math.inf) -> str:
        """Return the log lines that best explain a failure, or an empty string if there are no such lines.

        Args:
            name: The name of the node that has logged the lines; by default any node.
            since: The earliest time of the returned lines, in seconds of the steady clock.
        """
        return quote_lines(self._lines_since(name, since))

    def failed_change(self) -> str:
        """Return the name of the last node whose state the lifecycle manager failed to change, or ''."""
        found = [
            each
            for line in self._lines_since(MANAGER, -math.inf)
            if (each := _FAILED_CHANGE.search(line.text))
        ]
        return found[-1][1].rpartition("/")[2] if found else ""

    def awaited_node(self) -> str:
        """Return the name of the node that the lifecycle manager waits for during start-up, or ''.

        If the process of this node crashes, the lifecycle manager waits forever for a response and logs nothing more.
        """
        name, since = self._awaited
        return name if time.monotonic() - since >= _DISCOVERED_SEC else ""

    def _lines_since(self, name: str, since: float) -> Iterator[LoggedLine]:
        foreign = self._foreign_namespaces()
        for each in self._lines:
            if each.at < since or each.who.startswith(foreign):
                continue
            if name in ("", each.who) or each.who.startswith(f"{name}."):
                yield each

    def _foreign_namespaces(self) -> tuple[str, ...]:
        """Return the logger prefixes of other robots whose Nav2 runs in a namespace below the node's namespace."""
        own = self._node.get_namespace()
        there = (
            namespace
            for name, namespace in self._node.get_node_names_and_namespaces()
            if name in DRIVING_NODES
        )
        below = own.rstrip("/") + "/"
        return tuple(
            f"{each.removeprefix(below).replace('/', '.')}."
            for each in {*there}
            if each != own and each.startswith(below)
        )

    def _on_line(self, message: Any) -> None:
        name = message.name
        if f"{name}.".startswith(f"{self._own}."):
            return
        if self._prefix and "." in name:
            if not name.startswith(f"{self._prefix}."):
                return
            name = name.removeprefix(f"{self._prefix}.")
        elif self._prefix and name != "tf_help":
            return
        if name == MANAGER:
            self._on_manager(message.msg)
        if message.level >= self._warning:
            self._lines.append(LoggedLine(time.monotonic(), name, message.msg, message.level >= self._error))

    def _on_manager(self, text: str) -> None:
        if (found := _AWAITED.search(text)) is not None:
            self._awaited = ((found[1] or found[2]).rpartition("/")[2], time.monotonic())
        elif _ALL_ACTIVE in text:
            self._awaited = ("", math.inf)


def nav2_log(node: "Node") -> Nav2Log:
    """Return the `Nav2Log` of a node; every call for a node returns the same object."""
    return of_node(node, Nav2Log, lambda: Nav2Log(node))
