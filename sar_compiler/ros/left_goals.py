"""The goals of a mission in its journal: what a run has left behind is cancelled before the mission goes on."""

import time
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from sar_compiler.journal.journal import Journal, SentGoal
from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT
from sar_compiler.ros.leaves.goal_statuses import FINAL
from sar_compiler.ros.leaves.goals_under_way import GoalNews, goals_under_way
from sar_compiler.ros.requirements import Requirement

# A cancel that is not answered, or not followed, is repeated after so many seconds of the steady clock.
_PERIOD_SEC = 1.0


def note_goals(node: Node, journal: Journal) -> None:
    """Have a journal told of every goal that a node sends, before it is sent, and of its end."""

    def note(news: GoalNews) -> None:
        if news.status is None:
            journal.note(GOAL_SENT, action=news.action, goal=news.goal_id)
        else:
            journal.watch(GOAL_ENDED, goal=news.goal_id, status=news.status)

    goals_under_way(node).listen(note)


class LeftGoals(Requirement):
    """The goals that earlier runs have sent, each of which must have ended.

    A goal counts as ended when its server says so, or does not know it: it has been restarted, or the goal never came.

    Args:
        node: The node to cancel them from.
        journal: Has the goals, and is told of their ends.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._goals = [_LeftGoal(node, goal, journal) for goal in journal.goals_left()]

    def missing(self) -> str | None:
        """Cancel what is still to be cancelled; describe the first goal that has not ended, None if all have."""
        return next((line for line in [goal.missing() for goal in self._goals] if line is not None), None)

    def close(self) -> None:
        """Destroy the clients and subscriptions."""
        for goal in self._goals:
            goal.close()


class _LeftGoal:
    def __init__(self, node: Node, goal: SentGoal, journal: Journal) -> None:
        self._node, self._goal, self._journal = node, goal, journal
        self._id = bytes.fromhex(goal.goal_id)
        self._is_over = False
        self._asked_at: float | None = None
        self._future: Future | None = None
        self._client = node.create_client(CancelGoal, f"{goal.action}/_action/cancel_goal")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._subscription = node.create_subscription(
            GoalStatusArray, f"{goal.action}/_action/status", self._on_statuses, latched
        )

    def missing(self) -> str | None:
        if self._is_over:
            return None
        if not self._client.service_is_ready():
            return f"action {self._goal.action}: no server, to cancel the goal that was left active"
        now = time.monotonic()
        if self._asked_at is None or now - self._asked_at >= _PERIOD_SEC:
            self._asked_at = now
            self._ask()
        return f"action {self._goal.action}: the goal that was left active has not ended; the robot may be moving"

    def _ask(self) -> None:
        if self._future is not None:
            self._client.remove_pending_request(self._future)
        request = CancelGoal.Request()
        request.goal_info.goal_id = UUID(uuid=list(self._id))
        self._future = self._client.call_async(request)
        self._future.add_done_callback(self._on_answer)

    def _on_answer(self, future: Future) -> None:
        code = future.result().return_code
        if code in (CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID, CancelGoal.Response.ERROR_GOAL_TERMINATED):
            self._end(0)

    def _on_statuses(self, message: Any) -> None:
        for each in message.status_list:
            if bytes(each.goal_info.goal_id.uuid) == self._id and each.status in FINAL:
                self._end(each.status)

    def _end(self, status: int) -> None:
        if not self._is_over:
            self._is_over = True
            self._journal.watch(GOAL_ENDED, goal=self._goal.goal_id, status=status)

    def close(self) -> None:
        self._node.destroy_client(self._client)
        self._node.destroy_subscription(self._subscription)
