"""Whether an action's server lives: one that answers nothing for long is dead, whatever the graph says."""

import uuid
from typing import TYPE_CHECKING, Any

from sar_compiler.ros.leaves.deadline import Deadline

if TYPE_CHECKING:
    from rclpy.client import Client
    from rclpy.task import Future

    from sar_compiler.runtime.clock import Clock

# How often the server is asked, seconds.
_PERIOD_SEC = 1.0


class Pulse:
    """Heartbeat: requests the result of an unknown goal, which a live server refuses at once.

    A server that works in the only thread that it has answers nothing meanwhile. So it counts as dead only after it
    has answered once.

    Args:
        prober: A client of the action's result service.
        limit_sec: How long an answer may take, seconds.
        clock: The clock of the limits.
    """

    def __init__(self, prober: "Client", limit_sec: float, clock: "Clock") -> None:
        self._prober, self._limit_sec, self._clock = prober, limit_sec, clock
        self._question: Future | None = None
        self._has_answered = False
        self._due = Deadline(0.0, clock)
        self._limit = Deadline(limit_sec, clock)

    def has_stopped(self) -> bool:
        """Ask if it is due; return whether the server, which has answered before, has not for too long."""
        if self._question is None:
            if self._due.passed:
                self._ask()
        elif self._question.done():
            self._has_answered = True
            self.rest()
        elif self._limit.passed:
            self._drop()
            return self._has_answered
        return False

    def rest(self) -> None:
        """Ask no more for a while: the server has been heard."""
        self._drop()
        self._due = Deadline(_PERIOD_SEC, self._clock)

    def _ask(self) -> None:
        request: Any = self._prober.srv_type.Request()
        request.goal_id.uuid = list(uuid.uuid4().bytes)
        self._limit = Deadline(self._limit_sec, self._clock)
        self._question = self._prober.call_async(request)

    def _drop(self) -> None:
        question, self._question = self._question, None
        if question is not None:
            # Without this the client would wait for the answer for good.
            self._prober.remove_pending_request(question)
