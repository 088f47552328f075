"""Isolation of a simulated robot from real robots and from other simulations."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from rclpy.context import Context
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

from sar_compiler.errors import SarError
from sar_compiler.ros.graph_queries import UNKNOWN_NODE, services_by_node

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_CLOCK = "/clock"
_ACTION = "navigate_to_pose"
# The suffix of the service that identifies an action server in the graph.
_GOALS = "/_action/send_goal"
# The time to wait before concluding that no other node exists, seconds. Half of the participants on one machine discover each other within
# 0.3 s. If the first announcements are lost, participants discover each other by the next periodic announcement, which Fast DDS sends every
# 3 s (3.1 s was the longest observed delay). The wait is skipped if this process can hear no other process.
LOOK_AROUND_SEC = 4.0
_LOOK_EVERY_SEC = 0.02

LOOKING_AROUND = f"Checking for other simulations or robots on this machine ({LOOK_AROUND_SEC:g} s)..."
"""The message that a command prints before it searches for other nodes."""
_ANOTHER = "another node"


class IsolationError(SarError):
    """Another simulation, or the navigation of a robot, is running and uses the same ROS names.

    Attributes:
        node: The other node, such as `node '/its/full/name'` if its name is known.
        what: The topic or action that the other node provides.
    """

    def __init__(self, node: str, what: str) -> None:
        self.node, self.what = node, what
        super().__init__(
            f"{node} already provides {what} in this ROS domain, and a simulated robot must not mix with another robot. Stop that node, or "
            f"set another ROS_DOMAIN_ID."
        )


def stay_on_this_machine() -> None:
    """Restrict discovery to this machine, unless the user has set a range; call this before `rclpy.init`."""
    os.environ.setdefault(_RANGE, "LOCALHOST")


def require_no_other_nodes(
    *,
    context: Context | None = None,
    namespace: str | None = None,
    actions: Sequence[str] = (_ACTION,),
    look_around_sec: float = LOOK_AROUND_SEC,
    on_waiting: Callable[[], object] = lambda: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> None:
    """Check that no other node provides `/clock` or `navigate_to_pose`.

    Args:
        context: An initialised context; the default context if None.
        namespace: The namespace of relative names; None for the namespace of the command line.
        actions: The names of the navigation actions of all robots.
        look_around_sec: The duration of the search, seconds. The search ends early if another node is found, or if there cannot be another
            node.
        on_waiting: Called before the wait for other nodes.
        should_stop: Returns whether to stop searching; the function then returns.

    Raises:
        IsolationError: If another node provides the topic or the action. The error names the node.
    """
    node = Node("require_isolation", context=context, namespace=namespace, start_parameter_services=False)
    try:
        # This process's own entities are already in the graph.
        if _find_foreign_node(node, actions) is None and _is_alone(node.context.get_domain_id()):
            return
        # Only waiting can show that no other node exists, because discovery does not report its completion.
        on_waiting()
        deadline = time.monotonic() + look_around_sec
        while time.monotonic() < deadline and not should_stop():
            found = _find_foreign_node(node, actions)
            if found is not None and found.node != _ANOTHER:
                raise found
            time.sleep(_LOOK_EVERY_SEC)
        found = _find_foreign_node(node, actions)
        if found is not None:
            raise found
    finally:
        node.destroy_node()


# The environment variables that enable ways of discovery that `_is_alone` does not check.
_DISCOVERY_VARIABLES = (
    "CYCLONEDDS_URI",
    "FASTDDS_BUILTIN_TRANSPORTS",
    "FASTDDS_DEFAULT_PROFILES_FILE",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "ROS_DISCOVERY_SERVER",
    "ROS_STATIC_PEERS",
)
_PROFILES = Path("DEFAULT_FASTRTPS_PROFILES.xml")  # in the current folder
_SOCKETS = (Path("/proc/net/udp"), Path("/proc/net/udp6"))
# The ports of a domain according to the standard (DDSI-RTPS, 9.6.1.1), two of which belong to each participant.
_FIRST_PORT, _PORTS_OF_A_DOMAIN = 7400, 250
_PORTS_OF_A_PARTICIPANT = 2


def _is_alone(domain: int) -> bool:
    """Return whether this process is certainly the only participant that it can discover in a ROS domain.

    If discovery is limited to this machine, every participant listens at the domain's ports on this machine, as the DDS standard requires.
    """
    here_only = os.environ.get(_RANGE) == "LOCALHOST" and not any(map(os.environ.get, _DISCOVERY_VARIABLES))
    by_dds = get_rmw_implementation_identifier().startswith(("rmw_fastrtps", "rmw_cyclonedds"))
    if not here_only or not by_dds or _PROFILES.exists():
        return False
    try:
        sockets, own = set(_sockets_of(domain)), set(_own_sockets())
    except OSError:
        return False
    return 0 < len(sockets) <= _PORTS_OF_A_PARTICIPANT and sockets <= own


def _sockets_of(domain: int) -> Iterator[str]:
    """Yield the inode numbers of all sockets on this machine at the ports of a domain."""
    first = _FIRST_PORT + _PORTS_OF_A_DOMAIN * domain
    for path in _SOCKETS:
        for line in path.read_text(encoding="ascii").splitlines()[1:]:
            _, local, *others = line.split()
            if first <= int(local.rpartition(":")[2], 16) < first + _PORTS_OF_A_DOMAIN:
                yield others[7]


def _own_sockets() -> Iterator[str]:
    """Yield the inode numbers of the sockets of this process."""
    for descriptor in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # the descriptor of the folder itself is closed by now
            yield str(descriptor.readlink()).removeprefix("socket:[").removesuffix("]")


def require_no_rival_servers(node: Node, actions: Sequence[str] = (_ACTION,)) -> None:
    """Check, while a simulation runs, that no other node provides `/clock` or `navigate_to_pose`.

    Discovery can miss a node at the start, and further nodes may appear later.

    Raises:
        IsolationError: If another node provides the topic or the action.
    """
    if node.count_publishers(_CLOCK) > 1:
        raise IsolationError(_ANOTHER, _CLOCK)
    for action in actions:
        goals = node.resolve_service_name(action + _GOALS)
        if node.count_services(goals) > 1:
            raise IsolationError(_ANOTHER, _title(goals))


def _find_foreign_node(node: Node, actions: Sequence[str]) -> IsolationError | None:
    for publisher in node.get_publishers_info_by_topic(_CLOCK):
        return IsolationError(_full_name(publisher.node_name, publisher.node_namespace), _CLOCK)
    found = (_find_server(node, node.resolve_service_name(action + _GOALS)) for action in actions)
    return next((error for error in found if error is not None), None)


def _find_server(node: Node, goals: str) -> IsolationError | None:
    """Return an error that names the server of the service *goals*; None if the service has no server."""
    # The graph also contains services that only have clients.
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
    return f"node '{namespace.rstrip('/')}/{name}'" if name != UNKNOWN_NODE else _ANOTHER
