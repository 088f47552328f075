"""The states of lifecycle nodes, which are queried repeatedly without blocking."""

import math
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.clock import AWAKE
from sar_compiler.ros.graph_queries import Endpoint, ros_graph, with_full_name

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.task import Future

_ASK_PERIOD_SEC = 0.5
# Maximum time in which a new client discovers its server, in seconds.
_MEETING_SEC = 1.0


class PolledService:
    """Queries a service repeatedly, and stores the latest response.

    A response can be lost while the two nodes are still discovering each other. The node waits for a response for at most `deadline_sec`.

    Args:
        node: The node that queries the service.
        service_type: The Python class of the service, whose request has no fields.
        name: The relative name of the service.

    Attributes:
        answer: The latest response; None before the first response, or if the latest query received no response.
        is_silent: Whether the latest query did not receive a response in time.
        deadline_sec: The maximum wait for a response, in seconds.
        known_at: The time at which the query of the latest response was sent, or an unanswered query was abandoned, in seconds of awake
            time; minus infinity before.
        silent_since: The time at which the first of the latest queries without a response was sent, in seconds of awake time; None if the
            latest query received a response.
        answered_at: The time of the latest response, in seconds of the steady clock.
    """

    deadline_sec: float = 2.0

    def __init__(self, node: "Node", service_type: Any, name: str) -> None:
        self.answer: Any = None
        self.is_silent = False
        self.known_at = self.answered_at = self._renewed_at = -math.inf
        self.silent_since: float | None = None
        self._node = node
        self._type, self._name = service_type, name
        self._client: Any = node.create_client(service_type, name)
        self._call: Future | None = None
        self._asked_at = -math.inf
        self._is_there = True

    @property
    def is_there(self) -> bool:
        """Whether a server of the service is available."""
        return bool(self._client.service_is_ready())

    def is_awaited(self, since: float = -math.inf) -> bool:
        """Return whether an available server has not responded to any query sent after the time *since*.

        *since* is in seconds of awake time.
        """
        return self._is_there and (self.known_at == -math.inf or self.known_at < since)

    def query(self, since: float = -math.inf) -> bool:
        """Read the response, and send a new query if one is due; return whether a server is available."""
        now = AWAKE.now()
        self._is_there = self.is_there
        if not self._is_there:
            if now - self._renewed_at < _MEETING_SEC:
                self._is_there = True
                return True
            self._drop()
            self.answer, self.is_silent, self.known_at, self.silent_since = None, False, -math.inf, None
            return False
        self._read_response()
        if self._call is None and (now - self._asked_at >= _ASK_PERIOD_SEC or self._asked_at < since):
            self._asked_at = now
            self._call = self._client.call_async(self._type.Request())
        return True

    def close(self) -> None:
        """Destroy the client."""
        self._drop()
        self._node.destroy_client(self._client)

    def _read_response(self) -> None:
        if self._call is None:
            return
        if self._call.done():
            self.answer, self.is_silent, self.known_at = self._call.result(), False, self._asked_at
            self._call = None
            self.silent_since, self.answered_at = None, time.monotonic()
        elif (now := AWAKE.now()) - self._asked_at > self.deadline_sec:
            self.answer, self.is_silent, self.known_at = None, True, now
            self.silent_since = self.silent_since or self._asked_at
            # A server that has not discovered this client's reader drops every response. It may discover the reader of a new client.
            self.close()
            self._client = self._node.create_client(self._type, self._name)
            self._renewed_at = now

    def _drop(self) -> None:
        call, self._call = self._call, None
        if call is not None:
            self._client.remove_pending_request(call)


# The names of the states by the constants of lifecycle_msgs/msg/State.
_STATES = {3: "active", 2: "inactive"}


class LifecycleState(PolledService):
    """Queries the state of a lifecycle node on demand, without blocking and at most twice a second.

    Args:
        node: The node that queries the state.
        name: The relative name of the lifecycle node.

    Attributes:
        name: The relative name of the lifecycle node.
    """

    def __init__(self, node: "Node", name: str) -> None:
        from lifecycle_msgs.srv import GetState

        super().__init__(node, GetState, f"{name}/get_state")
        self.name = name
        self._service = node.resolve_service_name(f"{name}/get_state")
        self._title = f"node {with_full_name(name, self._service.removesuffix('/get_state'))}"

    @property
    def state(self) -> str | None:
        """The state in the latest response; None if there is no response."""
        return _state_name(self.answer.current_state) if self.answer is not None else None

    @property
    def age_sec(self) -> float:
        """The age of the latest response, in seconds; infinite if there was no response."""
        return AWAKE.now() - self.known_at

    @property
    def silent_sec(self) -> float:
        """The time for which the lifecycle node has not responded, in seconds; 0 if the node responds."""
        return 0.0 if self.silent_since is None else AWAKE.now() - self.silent_since

    @property
    def has_heard_nothing(self) -> bool:
        """Whether the node has not responded since this process was last suspended; False without a suspension."""
        return self.answered_at < AWAKE.stood_still_at

    def poll(self, since: float = -math.inf) -> str | None:
        """Query the state if a query is due; return a description of the problem, or None if the state is `active`."""
        if not self.query(since):
            there = ros_graph(self._node).query(Endpoint("node", self.name)).hint
            return f"node {self.name}: missing (no service {self._service}){there}"
        if self.state is None:
            late = f" for {self.deadline_sec:g} s" if self.is_silent else ""
            return f"node {self.name}: {self._service} has not responded{late}"
        return None if self.state == "active" else f"{self._title}: state '{self.state}', must be 'active'"


def _state_name(state: Any) -> str:
    """Return the name of a lifecycle state. If the server sets no name, use the number of the state."""
    return state.label or _STATES.get(state.id, f"number {state.id}")


class LifecycleNodes:
    """A group of lifecycle nodes that must be active.

    A node that was never present is not required to be active, because some servers have no lifecycle.

    Args:
        nodes: The states of the nodes.
    """

    def __init__(self, nodes: Sequence[LifecycleState]) -> None:
        self._nodes = nodes
        self._known: set[LifecycleState] = set()
        self._since = -math.inf

    def update_presence(self) -> None:
        """Store which nodes are present. These nodes are required from now on."""
        self._known.update(each for each in self._nodes if each.is_there)

    def ignore_answers(self) -> None:
        """Ignore the responses to earlier queries."""
        self._since = AWAKE.now()

    def obstacle(self) -> str | None:
        """Describe the required nodes that are missing or inactive; return '' if there are none.

        Return None until all nodes have responded.
        """
        self.update_presence()
        polled = [(each, each.poll(self._since)) for each in self._nodes if each in self._known]
        missing = [(each, line) for each, line in polled if line is not None]
        if any(each.is_awaited(self._since) for each in self._known):
            return None
        return "; ".join(self._missing_lines(missing))

    def _missing_lines(self, missing: Sequence[tuple[LifecycleState, str]]) -> Iterator[str]:
        """Yield one line for each state other than `active`; the line names the nodes in this state."""
        by_state: dict[str, list[tuple[str, str]]] = {}
        for node, line in missing:
            by_state.setdefault(node.state or line, []).append((node.name, line))
        for state, nodes in by_state.items():
            names = ", ".join(name for name, _ in nodes)
            yield nodes[0][1] if len(nodes) == 1 else f"nodes {names}: state '{state}', must be 'active'"
