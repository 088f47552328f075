"""Isolation of a simulated robot from real ones."""

import os
import time
from collections.abc import Callable, Sequence

from rclpy.context import Context
from rclpy.node import Node

from sar_compiler.errors import SarError
from sar_compiler.ros.readiness import services_by_node

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_CLOCK = "/clock"
_ACTION = "navigate_to_pose"
# By this service of it an action server can be seen in the graph.
_GOALS = "/_action/send_goal"
# How long to look around before concluding that no other node is there, seconds. Half of the participants on one
# machine see each other within 0.3 s; where the first announcements get lost, they meet with the next
# periodic one, which Fast DDS sends every 3 s (up to 3.1 s were seen).
LOOK_AROUND_SEC = 4.0
_LOOK_EVERY_SEC = 0.02

LOOKING_AROUND = f"Looking whether another simulation or robot is on this machine ({LOOK_AROUND_SEC:g} s)..."
"""The message of a command before it looks for other nodes."""
# The name that a node has before its announcement arrives, after that of its publisher: up to seconds, on a busy machine.
_UNKNOWN = "_NODE_NAME_UNKNOWN_"
_ANOTHER = "another node"


class IsolationError(SarError):
    """Another simulation or a robot's navigation is running on the same ROS names.

    Attributes:
        node: The other node: `node '/its/full/name'` if known.
        what: The resource that it provides.
    """

    def __init__(self, node: str, what: str) -> None:
        self.node, self.what = node, what
        super().__init__(
            f"{node} already provides {what} here: a simulated robot must not mix with another one. "
            f"Stop it, or choose another ROS_DOMAIN_ID."
        )


def stay_on_this_machine() -> None:
    """Restrict ROS to this machine, unless the user has set otherwise. Call it before rclpy is initialised."""
    os.environ.setdefault(_RANGE, "LOCALHOST")


def refuse_company(
    *,
    context: Context | None = None,
    namespace: str | None = None,
    actions: Sequence[str] = (_ACTION,),
    look_around_sec: float = LOOK_AROUND_SEC,
    should_stop: Callable[[], bool] = lambda: False,
) -> None:
    """Check that no other node provides `/clock` or `navigate_to_pose`.

    Args:
        context: An initialised context; the default context if None.
        namespace: Namespace of relative names; that of the command line if None.
        actions: Names of the navigation actions of all robots.
        look_around_sec: How long to look, seconds; ends at once when another node is found.
        should_stop: Returns whether to stop looking; the function then just returns.

    Raises:
        IsolationError: If another node does; names the node.
    """
    node = Node("look_around", context=context, namespace=namespace, start_parameter_services=False)
    try:
        # Absence can only be concluded from waiting: discovery has no end that could be waited for.
        deadline = time.monotonic() + look_around_sec
        while time.monotonic() < deadline and not should_stop():
            found = _company(node, actions)
            if found is not None and found.node != _ANOTHER:
                raise found
            time.sleep(_LOOK_EVERY_SEC)
        found = _company(node, actions)
        if found is not None:
            raise found
    finally:
        node.destroy_node()


def refuse_rivals(node: Node, actions: Sequence[str] = (_ACTION,)) -> None:
    """Check, while a simulation runs, that no other node provides `/clock` or `navigate_to_pose`.

    Discovery can miss a node at the start, and others may appear later.

    Raises:
        IsolationError: If another node does; names the node.
    """
    if node.count_publishers(_CLOCK) > 1:
        raise IsolationError(_ANOTHER, _CLOCK)
    for action in actions:
        goals = node.resolve_service_name(action + _GOALS)
        if node.count_services(goals) > 1:
            raise IsolationError(_ANOTHER, _title(goals))


def _company(node: Node, actions: Sequence[str]) -> IsolationError | None:
    for publisher in node.get_publishers_info_by_topic(_CLOCK):
        return IsolationError(_full_name(publisher.node_name, publisher.node_namespace), _CLOCK)
    found = (_server(node, node.resolve_service_name(action + _GOALS)) for action in actions)
    return next((error for error in found if error is not None), None)


def _server(node: Node, goals: str) -> IsolationError | None:
    """Return a description of the server of the service *goals*, if there is one."""
    # The name of a mere client is in the graph, too.
    if not node.count_services(goals):
        return None
    what = _title(goals)
    for name, namespace, services in services_by_node(node):
        if goals in services:
            return IsolationError(_full_name(name, namespace), what)
    return IsolationError(_ANOTHER, what)


def _title(goals: str) -> str:
    return f"the action {goals.removesuffix(_GOALS)}"


def _full_name(name: str, namespace: str) -> str:
    return f"node '{namespace.rstrip('/')}/{name}'" if name != _UNKNOWN else _ANOTHER
