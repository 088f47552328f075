"""Warnings and errors of Nav2's nodes on `/rosout`, which explain failed goals and bring-ups."""

import math
import re
import time
from collections import deque
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.ros.leaves.leaf import of_node
from sar_compiler.ros.lifecycle import BEFORE_NAVIGATOR, DRIVING_NODES, MANAGER

if TYPE_CHECKING:
    from rclpy.node import Node

# Maximum number of quoted lines, and their maximum length.
_QUOTED, _LONGEST = 2, 120
# Number of lines that are stored and queued.
_LINES = 200

# Phrases of Nav2 (1.1 to 1.5) that name a cause. Lines with one rank before all others, whichever node logs them: the
# client of an action logs as `bt_navigator_navigate_to_pose_rclcpp_node`, a library as `tf_help`.
_CAUSES = re.compile(
    r"timed out while waiting for action server|server not available|is inactive|while inactive"
    r"|transform data too old|transform timeout|timed out waiting for transform|(extrapolation|connectivity) error"
    r"|no transform|to transform|pose is not available|no pose"
    r"|failed to make progress|patience exceeded|collision|no valid"
    r"|failed to (generate|plan)|is outside|lethal|is not a valid|which does not exist"
    r"|open input xml|bt file not found|exception when loading bt|behavior tree threw",
    re.IGNORECASE,
)
# Lines that occur without a failure: on a busy computer, and when a default is used.
_SECONDARY = re.compile(
    r"missed its desired rate|tick rate .* exceeded|No (goal|progress) checker was specified|No (planner|controller)s? (was )?specified"
    r"|Received a preemption|will use only plugin"
)
# Lines that only report a failure without its cause, and one of each start.
_EMPTY = re.compile(
    r"Goal failed|Aborting handle|Error_code parameters were not set|\[ActionServer\]|Failed to change state|Aborting bringup|has been idle"
)
_NAV2_NODES = {*DRIVING_NODES, *BEFORE_NAVIGATOR, MANAGER, "local_costmap", "global_costmap", "tf_help"}
_FAILED_CHANGE = re.compile(r"Failed to change state for node: ([\w/]+)")
# Logged by the lifecycle manager before it waits for a node, between colour codes, and at its end.
_AWAITED = re.compile(
    r"(?:Configuring|Activating|Failed to change state for node:) ([\w/]+)|Waiting for service ([\w/]+)/get_state"
)
_ALL_ACTIVE = "Managed nodes are active"
# This long after the manager's line its node has been discovered if it exists, steady seconds.
_DISCOVERED_SEC = 2.0


class _LoggedLine(NamedTuple):
    """A line of the log.

    Attributes:
        at: The time of arrival, steady seconds.
        who: The name of its logger, below the namespace.
        text: Its text.
        is_error: Whether it is an error, not a warning.
    """

    at: float
    who: str
    text: str
    is_error: bool

    @property
    def rank(self) -> int | None:
        """Its rank as an explanation of a failure, 0 for the best; None for other lines."""
        if _EMPTY.search(self.text):
            return None
        if _SECONDARY.search(self.text):
            return 3
        if _CAUSES.search(self.text):
            return 0
        is_nav2 = any(
            self.who == name or self.who.startswith((f"{name}.", f"{name}_")) for name in _NAV2_NODES
        )
        return 1 if is_nav2 else 2 if self.is_error else None


class Nav2Log:
    """Warnings and errors of the nodes in the namespace of a node, without its own; use `nav2_log`.

    Args:
        node: The rclpy node.
    """

    def __init__(self, node: "Node") -> None:
        from rcl_interfaces.msg import Log
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._lines: deque[_LoggedLine] = deque(maxlen=_LINES)
        self._awaited = ("", math.inf)
        self._node, self._prefix = node, node.get_namespace().strip("/").replace("/", ".")
        self._own = f"{self._prefix}.{node.get_name()}".lstrip(".")
        self._warning, self._error = Log.WARN, Log.ERROR
        # Stored for late queries: lines logged just before the first query are included.
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(Log, "/rosout", self._on_line, latched)

    def quote(self, name: str = "", *, since: float = -math.inf) -> str:
        """Return the lines that best explain a failure: `controller_server: "Failed to make progress"`; may be empty.

        Args:
            name: The node that logged them; all by default.
            since: Only lines from this time on, steady seconds.
        """
        lines = [(rank, each) for each in self._lines_since(name, since) if (rank := each.rank) is not None]
        best = min((rank for rank, _ in lines), default=None)
        said = [f'{each.who}: "{_first_line(each.text)}"' for rank, each in lines if rank == best]
        return "; ".join(list(dict.fromkeys(said))[-_QUOTED:])

    def failed_change(self) -> str:
        """Return the last node whose state the lifecycle manager could not change; empty if none."""
        found = [
            each
            for line in self._lines_since(MANAGER, -math.inf)
            if (each := _FAILED_CHANGE.search(line.text))
        ]
        return found[-1][1].rpartition("/")[2] if found else ""

    def awaited_node(self) -> str:
        """Return the last node that the lifecycle manager waited for during start-up; empty if none.

        If the process of this node crashes, the manager waits for its answer forever and logs nothing more.
        """
        name, since = self._awaited
        return name if time.monotonic() - since >= _DISCOVERED_SEC else ""

    def _lines_since(self, name: str, since: float) -> Iterator[_LoggedLine]:
        foreign = self._foreign_namespaces()
        for each in self._lines:
            if each.at < since or each.who.startswith(foreign):
                continue
            if name in ("", each.who) or each.who.startswith(f"{name}."):
                yield each

    def _foreign_namespaces(self) -> tuple[str, ...]:
        """Return the prefixes of other robots' loggers: namespaces below this one with a Nav2 of their own."""
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
            self._lines.append(_LoggedLine(time.monotonic(), name, message.msg, message.level >= self._error))

    def _on_manager(self, text: str) -> None:
        if (found := _AWAITED.search(text)) is not None:
            self._awaited = ((found[1] or found[2]).rpartition("/")[2], time.monotonic())
        elif _ALL_ACTIVE in text:
            self._awaited = ("", math.inf)


def _first_line(text: str) -> str:
    """Return the first line of a text, shortened."""
    first = text.strip().partition("\n")[0]
    return first if len(first) <= _LONGEST else f"{first[: _LONGEST - 1]}…"


def nav2_log(node: "Node") -> Nav2Log:
    """Return the log of Nav2, one object for the lifetime of a node."""
    return of_node(node, Nav2Log, lambda: Nav2Log(node))
