"""The goals of a node that may be active: sent, and no end of them seen."""

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.ros.of_node import of_node

if TYPE_CHECKING:
    from rclpy.node import Node


class GoalNews(NamedTuple):
    """The fate of a goal.

    Attributes:
        goal_id: Its id, 32 hexadecimal digits.
        canceller: The full name of the service that cancels it.
        status: How it has ended, a constant of `action_msgs/msg/GoalStatus`, 0 where no server knows it; None if it is
            about to be sent.
    """

    goal_id: str
    canceller: str
    status: int | None = None

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self.status is not None

    @property
    def action(self) -> str:
        """The full name of its action."""
        return self.canceller.removesuffix("/_action/cancel_goal")


class GoalsUnderWay:
    """Tells listeners of the goals that one node sends; see `goals_under_way`."""

    def __init__(self) -> None:
        self._active: dict[str, str] = {}
        self._lost: set[str] = set()
        self._listeners: list[Callable[[GoalNews], None]] = []

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._active)

    def drives(self, cancellers: Collection[str]) -> bool:
        """Return whether a goal that is not lost may be active; *cancellers*: the services by which such are cancelled."""
        return any(
            canceller in cancellers and goal not in self._lost for goal, canceller in self._active.items()
        )

    @property
    def may_be_active(self) -> bool:
        """Whether a goal may be active whose end can still be seen."""
        return any(goal not in self._lost for goal in self._active)

    def lost(self, goal_id: Any) -> None:
        """Note that the server of a goal has fallen silent: its end will not be seen.

        Args:
            goal_id: Its id, a `unique_identifier_msgs/msg/UUID`.
        """
        self._lost.add(bytes(goal_id.uuid).hex())

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
        self._tell(GoalNews(digits, canceller))

    def ended(self, goal_id: Any, status: int) -> None:
        """Note that a goal was rejected, or has ended.

        Args:
            goal_id: Its id, a `unique_identifier_msgs/msg/UUID`.
            status: How, a constant of `action_msgs/msg/GoalStatus`; 0 where it was rejected, or no server knows it.
        """
        digits = bytes(goal_id.uuid).hex()
        self._lost.discard(digits)
        canceller = self._active.pop(digits, None)
        if canceller is not None:
            self._tell(GoalNews(digits, canceller, status))

    def _tell(self, news: GoalNews) -> None:
        for listener in self._listeners:
            listener(news)


def goals_under_way(node: "Node") -> GoalsUnderWay:
    """Return the goals of a node, the same object in every call."""
    return of_node(node, GoalsUnderWay, GoalsUnderWay)
