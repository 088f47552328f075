"""The goals of a node that may be active: sent, and no end of them seen."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from rclpy.node import Node


class GoalNews(NamedTuple):
    """What has become of a goal.

    Attributes:
        goal_id: Its id, 32 hexadecimal digits.
        canceller: The full name of the service that cancels it.
        is_over: Whether it has ended; else it is about to be sent.
    """

    goal_id: str
    canceller: str
    is_over: bool


class GoalsUnderWay:
    """Tells whoever wants to know of the goals that one node sends; see `goals_under_way`."""

    def __init__(self) -> None:
        self._active: dict[str, str] = {}
        self._listeners: list[Callable[[GoalNews], None]] = []

    def listen(self, listener: Callable[[GoalNews], None]) -> None:
        """Have a function called before each goal is sent, and after its end is seen."""
        self._listeners.append(listener)

    def sending(self, goal_id: Any, canceller: str) -> None:
        """Note, just before, that a goal is sent.

        Args:
            goal_id: Its id, a `unique_identifier_msgs/msg/UUID`.
            canceller: The full name of the service that cancels it.
        """
        digits = bytes(goal_id.uuid).hex()
        self._active[digits] = canceller
        self._tell(GoalNews(digits, canceller, is_over=False))

    def ended(self, goal_id: Any) -> None:
        """Note that a goal was rejected, or has ended."""
        digits = bytes(goal_id.uuid).hex()
        canceller = self._active.pop(digits, None)
        if canceller is not None:
            self._tell(GoalNews(digits, canceller, is_over=True))

    def _tell(self, news: GoalNews) -> None:
        for listener in self._listeners:
            listener(news)


_of_node: "WeakKeyDictionary[Any, GoalsUnderWay]" = WeakKeyDictionary()


def goals_under_way(node: "Node") -> GoalsUnderWay:
    """Return the goals of a node, the same object in every call."""
    return _of_node.setdefault(node, GoalsUnderWay())
