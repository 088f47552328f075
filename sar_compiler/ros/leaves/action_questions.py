"""Requests to servers of actions that do not move the robot, such as a planner."""

import uuid
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.leaves.goals import uuid_message
from sar_compiler.ros.leaves.leaf import find_interface, is_node_valid

if TYPE_CHECKING:
    from rclpy.client import Client
    from rclpy.node import Node
    from rclpy.task import Future


class ActionQueries:
    """Requests results from an action's server, one at a time, without blocking.

    Use this class only for actions that do not move the robot. Goals of this class differ from the goals of an `ActionLeaf`: they are not
    recorded in the journal, are not cancelled when the mission crashes, and do not delay the check that the robot stands still.

    Args:
        node: The rclpy node that sends the goals.
        action_type: `"package/action/Name"`, or the Python class.
        name: The (relative) name of the action.

    Attributes:
        interface: The Python class of the action.

    Raises:
        LeafDefinitionError: If the type is not installed.
    """

    def __init__(self, node: "Node", action_type: Any, name: str) -> None:
        self.interface = find_interface(type(self).__name__, "action", name, action_type)
        self._node, services = node, self.interface.Impl
        self._status = node.resolve_topic_name(f"{name}/_action/status")
        self._goals = node.create_client(services.SendGoalService, f"{name}/_action/send_goal")
        self._results = node.create_client(services.GetResultService, f"{name}/_action/get_result")
        self._pending: tuple[Client, Future] | None = None

    @property
    def has_server(self) -> bool:
        """Whether the ROS graph shows a server. A killed server stays visible for a while."""
        return is_node_valid(self._node) and self._node.count_publishers(self._status) > 0

    @property
    def is_ready(self) -> bool:
        """Whether both clients have discovered a server, so that a request would reach the server."""
        return (
            is_node_valid(self._node) and self._goals.service_is_ready() and self._results.service_is_ready()
        )

    def send_goal(self, goal: Any, on_answer: Callable[[int, Any], None]) -> None:
        """Send a goal, and abandon the previous goal.

        Args:
            goal: The goal, an `interface.Goal`.
            on_answer: Called in the node's executor with the goal's final status, a constant of `action_msgs/msg/GoalStatus`,
                and the result, an `interface.Result`. If the server rejects the goal, the status is `STATUS_UNKNOWN`.
        """
        self.give_up()
        goal_id = uuid_message(uuid.uuid4().hex)
        request = self._goals.srv_type.Request(goal_id=goal_id, goal=goal)
        self._call(self._goals, request, partial(self._request_result, goal_id, on_answer))

    def give_up(self) -> None:
        """Ignore the response to the last request."""
        pending, self._pending = self._pending, None
        if pending is not None and is_node_valid(self._node):
            # Otherwise the client would wait for the response forever.
            pending[0].remove_pending_request(pending[1])

    def release(self) -> None:
        """Destroy the clients, unless their node is already destroyed."""
        self.give_up()
        if is_node_valid(self._node):
            for client in (self._goals, self._results):
                self._node.destroy_client(client)

    def _call(self, client: "Client", request: Any, on_success: Callable[[Any], None]) -> None:
        future = client.call_async(request)
        self._pending = client, future
        future.add_done_callback(partial(self._on_response, on_success))

    def _on_response(self, on_success: Callable[[Any], None], future: "Future") -> None:
        # The call of this method may have been scheduled before the request was abandoned.
        if self._pending is not None and self._pending[1] is future:
            self._pending = None
            on_success(future.result())

    def _request_result(self, goal_id: Any, on_answer: Callable[[int, Any], None], _: Any) -> None:
        # If the goal was rejected, the result's status says that the goal is unknown.
        request = self._results.srv_type.Request(goal_id=goal_id)
        self._call(self._results, request, lambda end: on_answer(end.status, end.result))
