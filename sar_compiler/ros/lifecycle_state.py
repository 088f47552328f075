"""What is known of a lifecycle node; `RobotEstimate.lifecycle` has one for each node of a robot."""

import math
from typing import TYPE_CHECKING, Any

from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState

from sar_compiler.ros.asked import Asked, with_full_name
from sar_compiler.ros.awake import AWAKE

if TYPE_CHECKING:
    from rclpy.node import Node

_KNOWN = {State.PRIMARY_STATE_ACTIVE: "active", State.PRIMARY_STATE_INACTIVE: "inactive"}


class LifecycleState:
    """The state of a lifecycle node, asked for whenever somebody wants to know, at most twice a second, and without blocking.

    Args:
        node: The node to ask with.
        name: The relative name of the lifecycle node.

    Attributes:
        name: Its relative name.
    """

    def __init__(self, node: "Node", name: str) -> None:
        self.name = name
        self._asked = Asked(node, GetState, f"{name}/get_state")
        self._service = node.resolve_service_name(f"{name}/get_state")
        self._title = f"node {with_full_name(name, self._service.removesuffix('/get_state'))}"

    @property
    def is_there(self) -> bool:
        """Whether the node can be asked."""
        return self._asked.is_there

    @property
    def is_silent(self) -> bool:
        """Whether the node has not answered in time: it was killed, or hangs."""
        return self._asked.is_silent

    @property
    def state(self) -> str | None:
        """The state that it has answered last; None if it has not."""
        return _name_of(self._asked.answer.current_state) if self._asked.answer is not None else None

    @property
    def age_sec(self) -> float:
        """How old that is, seconds; infinite while nothing is known."""
        return AWAKE.now() - self._asked.known_at

    @property
    def silent_sec(self) -> float:
        """For how long the node, which is there, answers nothing, seconds; 0 if it does."""
        return 0.0 if self._asked.silent_since is None else AWAKE.now() - self._asked.silent_since

    @property
    def has_heard_nothing(self) -> bool:
        """Whether the node has not answered since this process stood still; False if it never has stood still."""
        return self._asked.answered_at < AWAKE.stood_still_at

    def is_awaited(self, since: float = -math.inf) -> bool:
        """Return whether the node is there, and nothing is known of it as of a time, steady seconds, or later."""
        return self._asked.is_awaited(since)

    def missing(self, since: float = -math.inf) -> str | None:
        """Ask if it is due, at once if all that is known is of before *since*; describe the last answer, None if that was `active`."""
        if not self._asked.ask(since):
            return f"node {self.name}: not there (no service {self._service})"
        if self.state is None:
            late = f" for {self._asked.deadline_sec:g} s" if self.is_silent else ""
            return f"node {self.name}: {self._service} has not answered{late}"
        return None if self.state == "active" else f"{self._title}: state '{self.state}', must be 'active'"


def _name_of(state: Any) -> str:
    """Return a lifecycle state's name; some servers fill in only its number."""
    return state.label or _KNOWN.get(state.id, f"number {state.id}")
