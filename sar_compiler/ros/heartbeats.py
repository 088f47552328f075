"""The heartbeats of a tree's executor. `ros.tick_watch` sends the heartbeats, and the guardian receives them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.ros.leaves.leaf import of_node

if TYPE_CHECKING:
    from rclpy.node import Node

REPORT_SEC = 2.0
"""The time without a heartbeat after which the blocking code is reported, in seconds of the steady clock."""


class Heartbeat(NamedTuple):
    """One heartbeat of the executor that ticks a tree.

    Attributes:
        limit_sec: The maximum time to the next heartbeat before the goals are canceled, in seconds; None while the tree is not ticked.
        is_reported: Whether the mission's process itself has already reported that the executor is blocked.
        stack: The file with the stacks of all threads, which is written while the executor is blocked.
        thread: The `threading.get_ident` of the ticking thread.
    """

    limit_sec: float | None = None
    is_reported: bool = False
    stack: str = ""
    thread: int = 0


class Heartbeats:
    """Distributes the heartbeats of a node's executor to listeners; created by `heartbeats`."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[Heartbeat], None]] = []

    @property
    def has_listeners(self) -> bool:
        """Whether there is a listener."""
        return bool(self._listeners)

    def add_listener(self, listener: Callable[[Heartbeat], None]) -> None:
        """Add a listener that is called, in any thread, with each heartbeat."""
        self._listeners.append(listener)

    def send(self, beat: Heartbeat) -> None:
        """Send one heartbeat to all listeners."""
        for listener in self._listeners:
            listener(beat)


def heartbeats(node: "Node") -> Heartbeats:
    """Return the heartbeats of a node's executor; every call for a node returns the same object."""
    return of_node(node, Heartbeats, Heartbeats)
