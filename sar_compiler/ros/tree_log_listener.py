"""Receive the serialised messages of Nav2's `behavior_tree_log`, and of `/rosout`."""

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node

_DEPTH, _MOST = 1000, 100_000


class TreeLogListener:
    """Collects the serialised messages of a topic, and of the log.

    Args:
        node: The node that subscribes to the topic.
        topic: The topic, whose type is `nav2_msgs/msg/BehaviorTreeLog`.
    """

    def __init__(self, node: "Node", topic: str) -> None:
        from nav2_msgs.msg import BehaviorTreeLog
        from rcl_interfaces.msg import Log

        self._messages: deque[bytes] = deque(maxlen=_MOST)
        self._lines: deque[bytes] = deque(maxlen=_MOST)
        node.create_subscription(BehaviorTreeLog, topic, self._on_message, _DEPTH, raw=True)
        node.create_subscription(Log, "/rosout", self._on_line, _DEPTH, raw=True)

    def messages(self) -> list[bytes]:
        """Return the messages that have arrived since the last call."""
        return [self._messages.popleft() for _ in range(len(self._messages))]

    def lines(self) -> list[bytes]:
        """Return the messages of `/rosout` that have arrived since the last call."""
        return [self._lines.popleft() for _ in range(len(self._lines))]

    def _on_message(self, message: bytes) -> None:
        self._messages.append(message)

    def _on_line(self, message: bytes) -> None:
        self._lines.append(message)
