"""Lifecycle nodes whose state decides whether a server takes goals."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node


NAV2_NODES = ("amcl", "bt_navigator")
"""The lifecycle nodes of Nav2 that localise and navigate, by their relative names."""


class LifecycleNodes:
    """Lifecycle nodes that must be active; asked only while somebody wants to know, and without blocking.

    A node that was never there is not asked for: there are servers without a lifecycle.

    Args:
        node: The node to ask with.
        names: Their relative names.
    """

    def __init__(self, node: "Node", names: Sequence[str]) -> None:
        from sar_compiler.ros.requirements import NodeActive

        self._nodes: list[NodeActive] = [NodeActive(node, name) for name in names]
        self._known: set[NodeActive] = set()

    def look(self) -> None:
        """Note which of the nodes are there."""
        self._known.update(each for each in self._nodes if each.is_there)

    def ask_anew(self) -> None:
        """Forget what the nodes have answered."""
        for each in self._nodes:
            each.forget()

    def obstacle(self) -> str | None:
        """Return what is missing, in words; empty if nothing is, None if not all have answered yet."""
        self.look()
        missing = [each.missing() for each in self._nodes if each in self._known]
        if any(each.is_awaited for each in self._known):
            return None
        return "; ".join(line for line in missing if line is not None)

    def close(self) -> None:
        """Destroy what was created on the node."""
        for each in self._nodes:
            each.close()
