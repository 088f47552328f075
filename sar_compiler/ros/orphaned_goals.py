"""Cancel goals that another process has left active, and wait until these goals have ended.

The response to a cancel request does not prove that the goal has ended: it only says that the server has accepted the request. After that,
the robot has to brake, and the server may also abort or complete the goal, or ignore the request. A goal has ended when its final status
was observed.

If the process that sent a goal has just crashed, the server may receive the cancel request before the goal. Such an early request has no
effect. So the request is sent every second until the goal's end is observed.

A server that does not know a goal may not have received the goal yet. If the server still does not know the goal after some seconds, the
goal has ended: the server was restarted, or the goal was lost.

A server drops its responses until it has discovered the client's reader, and it may never discover the reader. So a client that receives no
responses is replaced. The goals of an action share their clients, because the discovery of each client takes time.
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

# Interval between two requests to cancel a goal, in seconds of the steady clock.
_PERIOD_SEC = 1.0
# If a server has not responded for this time, in seconds, the clients are replaced: the server may not have discovered their readers.
_RENEWAL_SEC = 5.0
# Time for which a server must report a goal as unknown, in seconds. The goal may still arrive if it was sent just before the client crashed.
UNKNOWN_SEC = 3.0
_TURN_SEC = 0.05


def record_goals(node: Node, journal: Journal) -> None:
    """Record every goal of a node in the journal before the goal is sent, and record the goal's end."""

    def record_goal(news: GoalEvent) -> None:
        if news.status is None:
            journal.record_event(GOAL_SENT, action=news.action, goal=news.goal_id)
        else:
            _record_end(journal, news.goal_id, news.status)

    active_goals_of(node).add_listener(record_goal)


def _record_end(journal: Journal, goal_id: str, status: int) -> None:
    journal.record_observation(GOAL_ENDED, goal=goal_id, status=status)


class OrphanedGoals(Requirement):
    """The requirement that all goals of earlier runs have ended.

    Args:
        node: The node that cancels the goals.
        journal: The journal that contains the goals. The ends of the goals are recorded in it.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._goals = [
            OrphanedGoal(
                node, GoalEvent(goal.goal_id, goal.action), on_end=partial(_record_end, journal, goal.goal_id)
            )
            for goal in journal.active_goals()
        ]

    def poll(self) -> str | None:
        """Cancel the active goals; return a description of the first goal that has not ended, or None."""
        return next((line for line in [goal.poll() for goal in self._goals] if line is not None), None)


class CancelClients:
    """The clients with which a node cancels goals of one action and requests the results of these goals.

    The clients are replaced if the server does not respond. The object is stored on the node, because all goals of an action share the
    clients.

    Args:
        node: The node.
        action: The name of the action.
    """

    def __init__(self, node: Node, action: str) -> None:
        self._node, self._action = node, action
        self._unheard_since: float | None = None
        self._connect()

    def _connect(self) -> None:
        self.canceller = cancel_client(self._node, self._action)
        self._prober: Client | None = None

    def renew_if_silent(self) -> None:
        """Replace the clients if no response has arrived for too long, because the server may not have discovered them."""
        if self._unheard_since is None or time.monotonic() - self._unheard_since < _RENEWAL_SEC:
            return
        for client in filter(None, (self.canceller, self._prober)):
            self._node.destroy_client(client)
        self._unheard_since = None
        self._connect()

    def on_response(self) -> None:
        """Store that the server has responded."""
        self._unheard_since = None

    def cancel(self, goal_id: str) -> Future:
        """Request to cancel a goal; return the future of the response."""
        self._unheard_since = self._unheard_since or time.monotonic()
        return self.canceller.call_async(cancel_request(goal_id))

    def prober(self) -> Client | None:
        """Return the client that requests results; None if the service is missing or its type is not installed."""
        if self._prober is None:
            self._prober = self._result_client()
        return self._prober if self._prober is not None and self._prober.service_is_ready() else None

    def _result_client(self) -> Client | None:
        # Only the name of the action is known. Its type is determined from the ROS graph.
        name = f"{self._action}/_action/get_result"
        types = dict(self._node.get_service_names_and_types()).get(self._node.resolve_service_name(name), [])
        for written in types:
            # If the type's package is not installed, two other sources must show the goal's end.
            with suppress(SarError):
                action_type = written.removesuffix("_GetResult")
                interface: Any = find_interface("", "action", self._action, action_type)
                return self._node.create_client(interface.Impl.GetResultService, name)
        return None


class OrphanedGoal:
    """A goal whose own process can no longer cancel it, so that another process requests the goal's end.

    The cancel requests are repeated until the goal has ended. Three sources can show the goal's end: the status topic, the response to the
    request for the result, and the response of a server that does not know the goal. Such a server was restarted, or has never received the
    goal. Each of these messages can be lost. So all sources are used, and no pending request is abandoned.

    Args:
        node: The node that cancels the goal.
        goal: The goal.
        on_end: Called with the goal's final status, which is 0 if the server does not know the goal.
        on_request: Called when the first request to cancel the goal was sent.
        patience_sec: The time for which a server must report the goal as unknown, in seconds of the steady clock.
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
        self._result_requested_by: Client | None = None

    def poll(self) -> str | None:
        """Send the next cancel request if it is due; return why the goal may be active, or None if it has ended."""
        status = self._statuses.end_of(self._id)
        if status is not None:
            self._end(status)
        if self._is_over:
            return None
        self._clients.renew_if_silent()
        if not self._clients.canceller.service_is_ready():
            return f"action {self.action}: no server is available that could cancel the orphaned goal"
        if time.monotonic() - self._asked_at >= _PERIOD_SEC:
            is_first = self._asked_at == -math.inf
            self._asked_at = time.monotonic()
            self._clients.cancel(self._id).add_done_callback(self._on_cancel_response)
            if is_first:
                self._on_request()
            self._request_result()
        return f"action {self.action}: the orphaned goal has not ended yet. The robot may be moving"

    def _request_result(self) -> None:
        """Request the goal's result, unless the current client is already waiting for this result."""
        prober = self._clients.prober()
        if prober is None or prober is self._result_requested_by:
            return
        self._result_requested_by = prober
        request = prober.srv_type.Request()
        request.goal_id = uuid_message(self._id)
        prober.call_async(request).add_done_callback(self._on_result)

    def _on_result(self, future: Future) -> None:
        status = int(future.result().status)
        if status in FINAL:
            self._end(status)
        else:
            self._result_requested_by = None

    def _on_cancel_response(self, future: Future) -> None:
        self._clients.on_response()
        code, now = future.result().return_code, time.monotonic()
        if code != CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID:
            self._unknown_since = None
        elif self._unknown_since is None:
            self._unknown_since = now
        # The response also reports a goal as terminated while the goal is still being cancelled. This does not prove the goal's end.
        if self._unknown_since is not None and now - self._unknown_since >= self._patience_sec:
            self._end(UNKNOWN)

    def _end(self, status: int) -> None:
        if not self._is_over:
            self._is_over = True
            self._on_end(status)


def cancel_goals(goals: Sequence[OrphanedGoal], node: Node, limit_sec: float) -> list[OrphanedGoal]:
    """Cancel goals until they have ended; return the goals that may still be active.

    Args:
        goals: The goals.
        node: The node that cancels the goals. No other code may spin this node.
        limit_sec: The maximum time, in seconds of the steady clock.
    """
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + limit_sec
    while (active := [goal for goal in goals if goal.poll()]) and time.monotonic() < deadline:
        executor.spin_once(_TURN_SEC)
    executor.shutdown()
    return active


class Canceller:
    """Cancels goals in a separate ROS context, for runs whose executor is blocked or whose context is shut down.

    Args:
        name: The name of the node in this context.
        security: The ROS arguments for SROS 2 (`--enclave`), which the node also needs.
        domain_id: The ROS domain; by default the domain of the environment.
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
        """Cancel goals until they have ended; return the actions of the goals that may still be active.

        Args:
            goals: The goals.
            limit_sec: The maximum time, in seconds of the steady clock.
            on_request: Called with each goal when the first request to cancel the goal was sent.
        """
        orphaned_goals = [
            OrphanedGoal(self.node, goal, on_request=partial(on_request, goal), patience_sec=UNKNOWN_SEC)
            for goal in goals
        ]
        return [goal.action for goal in cancel_goals(orphaned_goals, self.node, limit_sec)]

    def close(self) -> None:
        """Destroy the node and shut down the context."""
        self.node.destroy_node()
        self.context.try_shutdown()


class CancelFunction(Protocol):
    """Cancels the goals of a node. Any thread may call this function."""

    def __call__(self, limit_sec: float) -> Sequence[str]:
        """Cancel the goals within a time limit in seconds; return the actions of the goals that have not ended."""


def make_separate_canceller(node: Node) -> CancelFunction:
    """Return a function that cancels a node's goals in a separate ROS context.

    Args:
        node: The node, whose context is not shut down yet.
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
