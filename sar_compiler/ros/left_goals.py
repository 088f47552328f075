"""Goals that a process has left behind: cancelled, and their ends awaited; those in a journal before its mission goes on."""

import math
import time
from collections.abc import Callable
from functools import partial

from action_msgs.srv import CancelGoal
from rclpy.node import Node
from rclpy.task import Future

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT
from sar_compiler.ros.leaves.goals import (
    UNKNOWN,
    GoalNews,
    cancel_client,
    cancel_request,
    goal_statuses_of,
    goals_under_way,
)
from sar_compiler.ros.leaves.leaf import of_node
from sar_compiler.ros.readiness import Requirement

# A cancel that is not answered, or not followed, is repeated after so many seconds of the steady clock.
_PERIOD_SEC = 1.0


def note_goals(node: Node, journal: Journal) -> None:
    """Have a journal told of every goal that a node sends, before it is sent, and of its end."""

    def note(news: GoalNews) -> None:
        if news.status is None:
            journal.note(GOAL_SENT, action=news.action, goal=news.goal_id)
        else:
            _watch_end(journal, news.goal_id, news.status)

    goals_under_way(node).listen(note)


def _watch_end(journal: Journal, goal_id: str, status: int) -> None:
    journal.watch(GOAL_ENDED, goal=goal_id, status=status)


class LeftGoals(Requirement):
    """The goals that earlier runs have sent, each of which must have ended.

    Args:
        node: The node to cancel them from.
        journal: Has the goals, and is told of their ends.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._goals = [
            LeftGoal(node, GoalNews(goal.goal_id, goal.action), partial(_watch_end, journal, goal.goal_id))
            for goal in journal.goals_left()
        ]

    def missing(self) -> str | None:
        """Cancel what is still to be cancelled; describe the first goal that has not ended, None if all have."""
        return next((line for line in [goal.missing() for goal in self._goals] if line is not None), None)


class LeftGoal:
    """A goal of a process that is gone.

    It has ended when the status topic says so, or when its server does not know it: it has been restarted, or the goal never came.

    Args:
        node: The node to cancel it from.
        goal: Which it is.
        on_end: Called with its final status; 0 where the server does not know it any more, or how it has ended.
        patience_sec: How long a server must say that it does not know the goal: one that was sent just before its
            client's death may be accepted after it.
    """

    def __init__(
        self, node: Node, goal: GoalNews, on_end: Callable[[int], None], patience_sec: float = 0.0
    ) -> None:
        self._id, self.action = goal.goal_id, goal.action
        self._client = of_node(node, (cancel_client, self.action), lambda: cancel_client(node, self.action))
        self._statuses = goal_statuses_of(node, self.action)
        self._on_end, self._patience_sec = on_end, patience_sec
        self._is_over = False
        self._asked_at = -math.inf
        self._unknown_since: float | None = None
        self._future: Future | None = None

    def missing(self) -> str | None:
        """Cancel it if that is due; return why it may be active, None once it has ended."""
        status = self._statuses.end_of(self._id)
        if status is not None:
            self._end(status)
        if self._is_over:
            return None
        if not self._client.service_is_ready():
            return f"action {self.action}: no server, to cancel the goal that was left active"
        if time.monotonic() - self._asked_at >= _PERIOD_SEC:
            self._asked_at = time.monotonic()
            self._ask()
        return f"action {self.action}: the goal that was left active has not ended; the robot may be moving"

    def _ask(self) -> None:
        if self._future is not None:
            self._client.remove_pending_request(self._future)
        self._future = self._client.call_async(cancel_request(self._id))
        self._future.add_done_callback(self._on_answer)

    def _on_answer(self, future: Future) -> None:
        code, now = future.result().return_code, time.monotonic()
        if code != CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID:
            self._unknown_since = None
        elif self._unknown_since is None:
            self._unknown_since = now
        # A goal that is being cancelled is "terminated" in an answer: that is no end yet.
        if self._unknown_since is not None and now - self._unknown_since >= self._patience_sec:
            self._end(UNKNOWN)

    def _end(self, status: int) -> None:
        if not self._is_over:
            self._is_over = True
            self._on_end(status)
