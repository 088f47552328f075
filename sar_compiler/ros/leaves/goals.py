"""The goals of a node that may be active, and the statuses that servers publish: another source for how a goal has ended."""

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakMethod

from sar_compiler.ros.leaves.interfaces import qos_profile
from sar_compiler.ros.leaves.leaf import of_node

if TYPE_CHECKING:
    from rclpy.client import Client
    from rclpy.node import Node

ABORTED, CANCELED, SUCCEEDED, UNKNOWN = 6, 5, 4, 0
"""Constants of `action_msgs/msg/GoalStatus`."""

FINAL = (SUCCEEDED, CANCELED, ABORTED)
"""Those of a goal that has ended."""

_CANCEL = "/_action/cancel_goal"

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


def cancel_client(node: "Node", action: str) -> "Client":
    """Return a client of the service that cancels goals of an action, whoever has sent them."""
    from action_msgs.srv import CancelGoal

    return node.create_client(CancelGoal, f"{action}{_CANCEL}")


def canceled_action(service: str) -> str:
    """Return the full name of the action whose goals a service, by its full name, cancels."""
    return service.removesuffix(_CANCEL)


def cancel_request(goal_id: str) -> Any:
    """Return the request to cancel one goal, by its id: 32 hexadecimal digits."""
    from action_msgs.srv import CancelGoal

    request = CancelGoal.Request()
    request.goal_info.goal_id = uuid_message(goal_id)
    return request


def uuid_message(goal_id: str) -> Any:
    """Return an id, 32 hexadecimal digits, as a message."""
    from unique_identifier_msgs.msg import UUID

    return UUID(uuid=list(bytes.fromhex(goal_id)))


class GoalStatuses:
    """The latest statuses of all goals of one action, from its status topic, by their ids: 32 hexadecimal digits.

    Use `goal_statuses_of`: only then is it known which goals are this node's own.

    Args:
        node: The rclpy node.
        action: The action's (relative) name.
    """

    def __init__(self, node: "Node", action: str) -> None:
        from action_msgs.msg import GoalStatusArray

        latched = qos_profile(type(self).__name__, "transient_local")
        self._listeners: dict[str, WeakMethod[StatusListener]] = {}
        self._ours: set[str] = set()
        self._latest: dict[str, int] = {}
        self._node = node
        self._topic = node.resolve_topic_name(f"{action}/_action/status")
        node.create_subscription(GoalStatusArray, f"{action}/_action/status", self._take, latched)

    @property
    def has_foreign_goal(self) -> bool:
        """Whether the server works on a goal that this node has not sent."""
        return any(status not in FINAL and goal not in self._ours for goal, status in self._latest.items())

    def end_of(self, goal: str) -> int | None:
        """Return the final status of a goal, as the topic has said it last; None while there is none."""
        status = self._latest.get(goal)
        return status if status in FINAL else None

    def servers(self) -> frozenset[bytes]:
        """Return what distinguishes the action's servers that the graph shows: the ids of who publishes their statuses."""
        there = self._node.get_publishers_info_by_topic(self._topic)
        return frozenset(bytes(each.endpoint_gid) for each in there)

    def forget(self) -> None:
        """Forget the latest statuses: their server may have died, and a new one says nothing before its first goal."""
        self._latest = {}

    def follow(self, goal: str, on_end: StatusListener) -> None:
        """Have a method called with the final status of a goal of this node; it is referred to weakly."""
        self._ours.add(goal)
        self._listeners[goal] = WeakMethod(on_end)

    def _take(self, message: Any) -> None:
        self._latest = {bytes(each.goal_info.goal_id.uuid).hex(): each.status for each in message.status_list}
        for goal, status in self._latest.items():
            if status in FINAL and (listener := self._listeners.pop(goal, lambda: None)()) is not None:
                listener(status)
        self._listeners = {goal: each for goal, each in self._listeners.items() if each() is not None}
        # A goal that is over stays in the list for a while, and must not look foreign.
        self._ours.intersection_update({*self._latest, *self._listeners})


def goal_statuses_of(node: "Node", action: str) -> GoalStatuses:
    """Return the statuses of an action's goals, the same object in every call with a node; they exist as long as it."""
    return of_node(node, (GoalStatuses, action), lambda: GoalStatuses(node, action))


class GoalNews(NamedTuple):
    """The fate of a goal.

    Attributes:
        goal_id: Its id, 32 hexadecimal digits.
        action: The full name of its action.
        status: How it has ended, a constant of `action_msgs/msg/GoalStatus`, 0 where no server knows it; None if it is
            about to be sent.
    """

    goal_id: str
    action: str
    status: int | None = None

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self.status is not None


class GoalsUnderWay:
    """Tells listeners of the goals that one node sends, by their ids: 32 hexadecimal digits; see `goals_under_way`."""

    def __init__(self) -> None:
        self._active: dict[str, str] = {}
        self._lost: set[str] = set()
        self._listeners: list[Callable[[GoalNews], None]] = []

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._active)

    def drives(self, actions: Collection[str]) -> bool:
        """Return whether a goal of some actions, by their full names, that is not lost may be active."""
        return any(action in actions and goal not in self._lost for goal, action in self._active.items())

    @property
    def may_be_active(self) -> bool:
        """Whether a goal may be active whose end can still be seen."""
        return any(goal not in self._lost for goal in self._active)

    def lost(self, goal_id: str) -> None:
        """Note that the server of a goal has fallen silent: its end will not be seen."""
        self._lost.add(goal_id)

    def listen(self, listener: Callable[[GoalNews], None]) -> None:
        """Have a function called before each goal is sent, and after its end is seen."""
        self._listeners.append(listener)

    def sending(self, goal_id: str, action: str) -> None:
        """Note, just before, that a goal is sent; *action* is the full name of its action."""
        self._active[goal_id] = action
        self._tell(GoalNews(goal_id, action))

    def ended(self, goal_id: str, status: int) -> None:
        """Note that a goal was rejected, or has ended.

        Args:
            goal_id: Its id.
            status: How, a constant of `action_msgs/msg/GoalStatus`; 0 where it was rejected, or no server knows it.
        """
        self._lost.discard(goal_id)
        action = self._active.pop(goal_id, None)
        if action is not None:
            self._tell(GoalNews(goal_id, action, status))

    def _tell(self, news: GoalNews) -> None:
        for listener in self._listeners:
            listener(news)


def goals_under_way(node: "Node") -> GoalsUnderWay:
    """Return the goals of a node, the same object in every call."""
    return of_node(node, GoalsUnderWay, GoalsUnderWay)
