"""Cancel goals that another process left active, and wait for their ends.

Why the response to a request to cancel is not enough: it says that the server has accepted the request. The robot brakes
after that, and the server may abort, finish or ignore the goal. A goal has ended when its final status was observed.

Why requests are repeated: a server may accept a goal only after the request to cancel it, if both were sent by a process
that died in between. A request that arrived too early has no effect, so it is sent every second until the end is seen.

Why a server that does not know the goal ends it only after some seconds: it may not have received the goal yet. If it was
restarted, it never will.

Why clients are replaced: a server drops its responses while it has not discovered the client's reader, and may never
discover it. A new client has a new chance. Goals of one action share their clients, because each takes time to be discovered.
"""

import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, Protocol

import rclpy
from action_msgs.srv import CancelGoal
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from sar_compiler.errors import SarError
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT
from sar_compiler.ros.arguments import security_arguments, split_arguments
from sar_compiler.ros.leaves.goals import (
    FINAL,
    UNKNOWN,
    GoalEvent,
    active_goals_of,
    cancel_client,
    cancel_request,
    goal_statuses_of,
    uuid_message,
)
from sar_compiler.ros.leaves.leaf import find_interface, of_node
from sar_compiler.ros.readiness import Requirement

# A request to cancel that was answered without effect is repeated after this time, seconds of the steady clock.
_PERIOD_SEC = 1.0
# A server that answers neither question for this long may not have discovered these clients' readers, and then sends
# them nothing.
_RENEWAL_SEC = 5.0
# How long a server must report a goal as unknown: it may still receive one that was sent just before the client died.
UNKNOWN_SEC = 3.0
_TURN_SEC = 0.05


def record_goals(node: Node, journal: Journal) -> None:
    """Record every goal of a node in the journal before it is sent, and its end."""

    def record_goal(news: GoalEvent) -> None:
        if news.status is None:
            journal.record_event(GOAL_SENT, action=news.action, goal=news.goal_id)
        else:
            _watch_end(journal, news.goal_id, news.status)

    active_goals_of(node).add_listener(record_goal)


def _watch_end(journal: Journal, goal_id: str, status: int) -> None:
    journal.record_observation(GOAL_ENDED, goal=goal_id, status=status)


class OrphanedGoals(Requirement):
    """The goals that earlier runs sent, all of which must have ended.

    Args:
        node: The node to cancel them from.
        journal: Has the goals, and records their ends.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._goals = [
            OrphanedGoal(
                node, GoalEvent(goal.goal_id, goal.action), on_end=partial(_watch_end, journal, goal.goal_id)
            )
            for goal in journal.active_goals()
        ]

    def poll(self) -> str | None:
        """Cancel the active goals; describe the first one that has not ended, or return None."""
        return next((line for line in [goal.poll() for goal in self._goals] if line is not None), None)


class CancelClients:
    """A node's clients that cancel goals of one action and request results, replaced if the server does not answer.

    Use `of_node`: the goals of one action share them.

    Args:
        node: The node.
        action: The action's name.
    """

    def __init__(self, node: Node, action: str) -> None:
        self._node, self._action = node, action
        self._unheard_since: float | None = None
        self._connect()

    def _connect(self) -> None:
        self.canceller = cancel_client(self._node, self._action)
        self._prober: Client | None = None

    def renew_if_silent(self) -> None:
        """Replace the clients after a long silence, because a server drops responses to undiscovered readers."""
        if self._unheard_since is None or time.monotonic() - self._unheard_since < _RENEWAL_SEC:
            return
        for client in filter(None, (self.canceller, self._prober)):
            self._node.destroy_client(client)
        self._unheard_since = None
        self._connect()

    def on_answer(self) -> None:
        """Record a response of the server."""
        self._unheard_since = None

    def cancel(self, goal_id: str) -> Future:
        """Request to cancel a goal; return the future of the response."""
        self._unheard_since = self._unheard_since or time.monotonic()
        return self.canceller.call_async(cancel_request(goal_id))

    def prober(self) -> Client | None:
        """Return the client that requests results; None if there is no such service, or its type is not installed."""
        if self._prober is None:
            self._prober = self._result_client()
        return self._prober if self._prober is not None and self._prober.service_is_ready() else None

    def _result_client(self) -> Client | None:
        # If only the name of an action is left, its type is known from the graph alone.
        name = f"{self._action}/_action/get_result"
        types = dict(self._node.get_service_names_and_types()).get(self._node.resolve_service_name(name), [])
        for written in types:
            with suppress(SarError):  # its package is not installed: two other sources remain
                action_type = written.removesuffix("_GetResult")
                interface: Any = find_interface("", "action", self._action, action_type)
                return self._node.create_client(interface.Impl.GetResultService, name)
        return None


class OrphanedGoal:
    """A goal that its own process cannot cancel; canceled from this process until it has ended.

    Three sources show its end: the status topic, the answer to the request for its result, and a server that does not
    know the goal (because it was restarted, or never received the goal). Each can fail to arrive, so all three are
    used, and no pending answer is dropped.

    Args:
        node: The node to cancel it from.
        goal: The goal.
        on_end: Called with its final status; 0 if the server no longer knows the goal or its result.
        on_request: Called when the first request to cancel it was sent.
        patience_sec: How long a server must deny knowing the goal, steady seconds.
    """

    def __init__(
        self,
        node: Node,
        goal: GoalEvent,
        *,
        on_end: Callable[[int], None] = lambda _: None,
        on_request: Callable[[], None] = lambda: None,
        patience_sec: float = 0.0,
    ) -> None:
        self._id, self.action = goal.goal_id, goal.action
        self._clients = of_node(node, (CancelClients, self.action), lambda: CancelClients(node, self.action))
        self._statuses = goal_statuses_of(node, self.action)
        self._on_end, self._on_request, self._patience_sec = on_end, on_request, patience_sec
        self._is_over = False
        self._asked_at = -math.inf
        self._unknown_since: float | None = None
        self._questioned: Client | None = None

    def poll(self) -> str | None:
        """Cancel the goal if due; return why it may be active, None once it has ended."""
        status = self._statuses.end_of(self._id)
        if status is not None:
            self._end(status)
        if self._is_over:
            return None
        self._clients.renew_if_silent()
        if not self._clients.canceller.service_is_ready():
            return f"action {self.action}: no server that could cancel the orphaned goal"
        if time.monotonic() - self._asked_at >= _PERIOD_SEC:
            is_first = self._asked_at == -math.inf
            self._asked_at = time.monotonic()
            self._clients.cancel(self._id).add_done_callback(self._on_cancel_answer)
            if is_first:
                self._on_request()
            self._ask_for_result()
        return f"action {self.action}: the orphaned goal has not ended. The robot may be moving"

    def _ask_for_result(self) -> None:
        """Request the result, once by each client."""
        prober = self._clients.prober()
        if prober is None or prober is self._questioned:
            return
        self._questioned = prober
        request = prober.srv_type.Request()
        request.goal_id = uuid_message(self._id)
        prober.call_async(request).add_done_callback(self._on_result)

    def _on_result(self, future: Future) -> None:
        status = int(future.result().status)
        if status in FINAL:
            self._end(status)
        else:
            self._questioned = None

    def _on_cancel_answer(self, future: Future) -> None:
        self._clients.on_answer()
        code, now = future.result().return_code, time.monotonic()
        if code != CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID:
            self._unknown_since = None
        elif self._unknown_since is None:
            self._unknown_since = now
        # The response reports a goal as terminated while it is still being cancelled, which is not its end.
        if self._unknown_since is not None and now - self._unknown_since >= self._patience_sec:
            self._end(UNKNOWN)

    def _end(self, status: int) -> None:
        if not self._is_over:
            self._is_over = True
            self._on_end(status)


def cancel_goals(goals: Sequence[OrphanedGoal], node: Node, limit_sec: float) -> list[OrphanedGoal]:
    """Cancel goals until they have ended; return those that may still be active.

    Args:
        goals: The goals.
        node: Their node, which no other code spins.
        limit_sec: How long to try, steady seconds.
    """
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + limit_sec
    while (active := [goal for goal in goals if goal.poll()]) and time.monotonic() < deadline:
        executor.spin_once(_TURN_SEC)
    executor.shutdown()
    return active


class Canceller:
    """Cancels goals in a separate ROS context, if the run's executor is blocked or its context shut down.

    Args:
        name: The name of the node.
        security: The ROS arguments that a second participant of this run needs (`--enclave`).
        domain_id: The ROS domain; by default that of the environment.
    """

    def __init__(self, name: str, security: Sequence[str] = (), domain_id: int | None = None) -> None:
        self.context = Context()
        arguments = ["--ros-args", *security] if security else []
        rclpy.init(
            args=arguments,
            context=self.context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = Node(name, context=self.context, start_parameter_services=False, enable_rosout=False)

    def cancel(
        self, goals: Iterable[GoalEvent], limit_sec: float, on_request: Callable[[GoalEvent], None]
    ) -> list[str]:
        """Cancel goals until they have ended; return the actions of those that may still be active.

        Args:
            goals: The goals.
            limit_sec: How long to try, steady seconds.
            on_request: Called with each goal once the first request to cancel it was sent.
        """
        left = [
            OrphanedGoal(self.node, goal, on_request=partial(on_request, goal), patience_sec=UNKNOWN_SEC)
            for goal in goals
        ]
        return [goal.action for goal in cancel_goals(left, self.node, limit_sec)]

    def close(self) -> None:
        """Shut down the context."""
        self.node.destroy_node()
        self.context.try_shutdown()


class CancelFunction(Protocol):
    """Cancels the goals of a node from a thread other than its executor's."""

    def __call__(self, limit_sec: float) -> Sequence[str]:
        """Cancel the goals; return the actions of those that have not ended within a limit, in seconds."""


def make_separate_canceller(node: Node) -> CancelFunction:
    """Return a function that cancels a node's goals in a separate ROS context.

    Args:
        node: The node, whose context is still up.
    """
    domain, security = node.context.get_domain_id(), security_arguments(split_arguments(sys.argv[1:]).ros)
    logger, name = node.get_logger(), node.get_name()

    def report_goal(goal: GoalEvent) -> None:
        logger.info(f"Canceling the goal of '{goal.action}'.")

    def cancel(limit_sec: float) -> Sequence[str]:
        goals = active_goals_of(node).active()
        if not goals:
            return []
        canceller = Canceller(f"{name}_canceller_{os.getpid()}", security, domain)
        try:
            return canceller.cancel(goals, limit_sec, report_goal)
        finally:
            canceller.close()

    return cancel
