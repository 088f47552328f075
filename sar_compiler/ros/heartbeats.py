"""Heartbeats of the executor that ticks a tree, sent by `ros.tick_watch` and received by the guardian."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.ros.leaves.leaf import of_node

if TYPE_CHECKING:
    from rclpy.node import Node

REPORT_SEC = 2.0
"""Steady seconds without a heartbeat until the blocking code is reported."""


class Heartbeat(NamedTuple):
    """One heartbeat of the executor.

    Attributes:
        limit_sec: The longest time to the next heartbeat before the goals are canceled; None while nothing is ticked.
        is_reported: Whether this process has already reported that it stopped.
        stack: The file with the stacks of all threads, written when the executor stops.
        thread: The thread that ticks, by `threading.get_ident`.
    """

    limit_sec: float | None = None
    is_reported: bool = False
    stack: str = ""
    thread: int = 0


class Heartbeats:
    """Distributes the heartbeats of a node's executor; obtain it with `heartbeats`."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[Heartbeat], None]] = []

    @property
    def has_listeners(self) -> bool:
        """Whether any listener is registered."""
        return bool(self._listeners)

    def add_listener(self, listener: Callable[[Heartbeat], None]) -> None:
        """Register a listener, which is called with each heartbeat from any thread."""
        self._listeners.append(listener)

    def send(self, beat: Heartbeat) -> None:
        """Send one heartbeat to all listeners."""
        for listener in self._listeners:
            listener(beat)


def heartbeats(node: "Node") -> Heartbeats:
    """Return the heartbeats of a node's executor, the same object in every call."""
    return of_node(node, Heartbeats, Heartbeats)
