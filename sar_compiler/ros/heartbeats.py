"""The heartbeats of the executor that ticks a tree: `ros.tick_watch` reports them, and the guardian hears of them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.ros.leaves.leaf import of_node

if TYPE_CHECKING:
    from rclpy.node import Node

REPORT_SEC = 2.0
"""After how long without a heartbeat what blocks is named, steady seconds."""


class Heartbeat(NamedTuple):
    """What is reported of the executor.

    Attributes:
        limit_sec: How long it may take to the next one, before the goals are canceled; None while nothing is ticked.
        is_reported: Whether this process itself has reported that it has stopped.
        stack: The file with the stacks of all threads, which is written where it stops.
        thread: The thread that ticks, as `threading.get_ident` has it.
    """

    limit_sec: float | None = None
    is_reported: bool = False
    stack: str = ""
    thread: int = 0


class Heartbeats:
    """Passes the heartbeats of a node's executor on; see `heartbeats`."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[Heartbeat], None]] = []

    @property
    def are_heard(self) -> bool:
        """Whether anybody listens."""
        return bool(self._listeners)

    def listen(self, listener: Callable[[Heartbeat], None]) -> None:
        """Have a function called with each, from any thread."""
        self._listeners.append(listener)

    def report(self, beat: Heartbeat) -> None:
        """Pass one on."""
        for listener in self._listeners:
            listener(beat)


def heartbeats(node: "Node") -> Heartbeats:
    """Return the heartbeats of a node's executor, the same object in every call."""
    return of_node(node, Heartbeats, Heartbeats)
