"""The statuses that an action's server publishes of all its goals: another source for how a goal has ended."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from weakref import WeakMethod

from sar_compiler.ros.leaves.interfaces import qos_profile
from sar_compiler.ros.of_node import of_node

if TYPE_CHECKING:
    from rclpy.node import Node

ABORTED, CANCELED, SUCCEEDED, UNKNOWN = 6, 5, 4, 0
"""Constants of `action_msgs/msg/GoalStatus`."""

FINAL = (SUCCEEDED, CANCELED, ABORTED)
"""Those of a goal that has ended."""

_ENDS = {
    SUCCEEDED: "has arrived",
    CANCELED: "is cancelled",
    ABORTED: "was aborted",
    UNKNOWN: "it does not know (any more)",
}

StatusListener = Callable[[int], None]


def end_in_words(status: int) -> str:
    """Return what has become of a goal, by its final status."""
    return _ENDS.get(status, f"has ended with status {status}")


class GoalStatuses:
    """The latest statuses of all goals of one action, from its status topic.

    Use `goal_statuses_of`: only then is it known which goals are this node's own.

    Args:
        node: The rclpy node.
        action: The action's (relative) name.
    """

    def __init__(self, node: "Node", action: str) -> None:
        from action_msgs.msg import GoalStatusArray

        latched = qos_profile(type(self).__name__, "transient_local")
        self._listeners: dict[bytes, WeakMethod[StatusListener]] = {}
        self._ours: set[bytes] = set()
        self._latest: dict[bytes, int] = {}
        self._node = node
        self._topic = node.resolve_topic_name(f"{action}/_action/status")
        node.create_subscription(GoalStatusArray, f"{action}/_action/status", self._take, latched)

    @property
    def has_foreign_goal(self) -> bool:
        """Whether the server works on a goal that this node has not sent."""
        return any(status not in FINAL and goal not in self._ours for goal, status in self._latest.items())

    def servers(self) -> frozenset[bytes]:
        """Return what distinguishes the action's servers that the graph shows: the ids of who publishes their statuses."""
        there = self._node.get_publishers_info_by_topic(self._topic)
        return frozenset(bytes(each.endpoint_gid) for each in there)

    def forget(self) -> None:
        """Forget the latest statuses: their server may have died, and a new one says nothing before its first goal."""
        self._latest = {}

    def follow(self, goal: bytes, on_end: StatusListener) -> None:
        """Have a method called with the final status of a goal of this node; it is referred to weakly."""
        self._ours.add(goal)
        self._listeners[goal] = WeakMethod(on_end)

    def _take(self, message: Any) -> None:
        self._latest = {bytes(each.goal_info.goal_id.uuid): each.status for each in message.status_list}
        for goal, status in self._latest.items():
            if status in FINAL and (listener := self._listeners.pop(goal, lambda: None)()) is not None:
                listener(status)
        self._listeners = {goal: each for goal, each in self._listeners.items() if each() is not None}
        # A goal that is over stays in the list for a while, and must not look foreign.
        self._ours.intersection_update({*self._latest, *self._listeners})


def goal_statuses_of(node: "Node", action: str) -> GoalStatuses:
    """Return the statuses of an action's goals, the same object in every call with a node; they exist as long as it."""
    return of_node(node, (GoalStatuses, action), lambda: GoalStatuses(node, action))
