"""Lifecycle nodes whose state decides whether a server takes goals."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sar_compiler.ros.clock import AWAKE
from sar_compiler.ros.of_node import of_node
from sar_compiler.ros.robot_estimate import robot_estimate

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.ros.lifecycle_state import LifecycleState


NAV2_NODES = ("amcl", "bt_navigator")
"""The lifecycle nodes of Nav2 that localise and navigate, by their relative names."""


NAVIGATOR = NAV2_NODES[-1]
"""The one of these whose actions drive the robot."""


DRIVING_NODES = (*NAV2_NODES, "planner_server", "controller_server", "behavior_server")
"""Those that a drive needs: while one is not active, or answers nothing, the end of a goal says nothing of its place."""


class LifecycleNodes:
    """Lifecycle nodes that must be active.

    A node that was never there is not asked for: there are servers without a lifecycle.

    Args:
        node: The node to ask with.
        names: Their relative names.
    """

    def __init__(self, node: "Node", names: Sequence[str]) -> None:
        robot = robot_estimate(node)
        self._nodes = [robot.lifecycle(name) for name in names]
        self._known: set[LifecycleState] = set()
        self._since = -math.inf

    def look(self) -> None:
        """Note which of the nodes are there."""
        self._known.update(each for each in self._nodes if each.is_there)

    def ask_anew(self) -> None:
        """Ignore what the nodes have answered until now."""
        self._since = AWAKE.now()

    def obstacle(self) -> str | None:
        """Return what is missing, in words; empty if nothing is, None if not all have answered yet."""
        self.look()
        missing = [each.missing(self._since) for each in self._nodes if each in self._known]
        if any(each.is_awaited(self._since) for each in self._known):
            return None
        return "; ".join(line for line in missing if line is not None)


def driving_nodes(node: "Node") -> LifecycleNodes:
    """Return the nodes that a drive needs, the same object in every call with a node; they exist as long as it."""
    return of_node(node, LifecycleNodes, lambda: LifecycleNodes(node, DRIVING_NODES))
