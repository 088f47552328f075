"""Executors that serve all nodes of a simulation in a single thread, and a class that creates and destroys nodes."""

import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.context import Context
from rclpy.event_handler import EventHandler
from rclpy.executors import (
    ConditionReachedException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
    TimeoutObject,
)
from rclpy.node import Node

# The number of rounds between two checks of QoS events. They are half of the entities in the wait set, and only cause warnings.
_ROUNDS_PER_EVENT = 20
# The maximum length of a chain of messages between two steps. A response arrives one step after its request.
_HOPS = 2


class PacedExecutor(SingleThreadedExecutor):
    """An executor that serves callbacks until a time of the monotonic clock.

    If the time-out of `spin_once` differs from the last call, rclpy starts a new round. Each round begins with a waiting coroutine (an
    action goal being executed), so no other callback would ever be served. This class therefore passes the same time-out object in each
    call and changes its value, so that the round continues.
    """

    def __init__(self, *, context: Context, interrupted: Callable[[], bool]) -> None:
        super().__init__(context=context)
        self._remaining = TimeoutObject(0.0)
        self._interrupted = interrupted
        self._over = interrupted
        self._rounds = 0

    def can_execute(self, entity: Any) -> bool:
        """Return whether a callback of a node can be served in this round."""
        if isinstance(entity, EventHandler) and self._rounds % _ROUNDS_PER_EVENT:
            return False
        return bool(super().can_execute(entity))

    def serve_until(
        self, deadline: float, *, enough: Callable[[], bool] | None = None, to_the_end: bool = False
    ) -> None:
        """Serve callbacks until *deadline*, but for at least one round.

        Args:
            deadline: The deadline on the clock of `time.monotonic()`, seconds.
            enough: Returns whether to stop earlier; checked after each callback and on each call of `wake`.
            to_the_end: Whether to continue until the deadline even if interrupted.
        """
        self._rounds += 1
        interrupted = _never_stop if to_the_end else self._interrupted
        self._over = interrupted if enough is None else lambda: interrupted() or enough()
        while not self._over():
            self._remaining.timeout = max(0.0, deadline - time.monotonic())
            try:
                handler, _, _ = self.wait_for_ready_callbacks(self._remaining, None, self._is_over)
            except TimeoutException:
                # The time-out of a continued round was computed when the round started.
                if time.monotonic() >= deadline:
                    return
            except (ConditionReachedException, ShutdownException):
                return
            else:
                handler()
                handler.result()

    def _is_over(self) -> bool:
        # All calls pass the same condition object. A different condition would start a new round, like a different time-out.
        return self._over()


def _never_stop() -> bool:
    return False


class SteppedExecutor:
    """Serves a mission and its simulation in one thread, and completes all pending work between two steps.

    The class uses rclpy's `EventsExecutor`, which calls callbacks in the order of the events that cause them. Within a process, a message
    reaches its subscribers when it is published.

    Args:
        context: The nodes' context.

    Attributes:
        step: Makes the next step of the simulation; None before the simulation starts and after it stops.

    Raises:
        ImportError: If this version of rclpy has no `EventsExecutor`.
    """

    def __init__(self, context: Context) -> None:
        from rclpy.experimental import EventsExecutor

        self.context = context
        self.step: Callable[[], object] | None = None
        self._events = EventsExecutor(context=context)
        self._wait_set_executor = PacedExecutor(context=context, interrupted=_never_stop)
        self.add_node, self.remove_node = self._events.add_node, self._events.remove_node

    def serve_apart(self, node: Node) -> None:
        """Serve a node with a wait-set executor, because the events executor cannot serve the node's entities."""
        self.remove_node(node)
        self._wait_set_executor.add_node(node)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Make one step of the simulation, and call all pending callbacks. The time-out is ignored."""
        if self.step is not None:
            self.step()
        for _ in range(_HOPS):
            served: list[str] = []
            # The executor runs this task after all callbacks that are pending now.
            self._events.create_task(served.append, "all")
            while not served:
                self._events.spin_once(timeout_sec=timeout_sec)
            if self._wait_set_executor.get_nodes():
                self._wait_set_executor.serve_until(time.monotonic())

    def spin_until_future_complete(self, _: Any, timeout_sec: float | None = None) -> None:
        """Spin once. After each call, the caller must check whether the future is complete."""
        self.spin_once(timeout_sec)

    def shutdown(self) -> None:
        """Shut down both executors."""
        self._wait_set_executor.shutdown()
        self._events.shutdown()


class NodeHost:
    """Creates nodes in one context and namespace, all served by one executor.

    Args:
        executor: Serves the nodes.
        context: The context of the nodes.
        namespace: The namespace of the nodes; None for the namespace of the command line.
        cli_args: ROS arguments for these nodes. They override the ROS arguments of the command line.
    """

    def __init__(
        self,
        executor: "PacedExecutor | SteppedExecutor",
        context: Context,
        namespace: str | None = None,
        cli_args: Sequence[str] = (),
    ) -> None:
        self._executor, self._context, self._namespace = executor, context, namespace
        self._cli_args = list(cli_args)
        self._nodes: list[Node] = []

    def create(self, name: str) -> Node:
        """Create a node."""
        # The nodes have no parameter services, because their parameters are never set, and the services would slow down every round.
        node = Node(
            name,
            context=self._context,
            namespace=self._namespace,
            cli_args=self._cli_args,
            start_parameter_services=False,
        )
        self._nodes.append(node)
        self._executor.add_node(node)
        return node

    def destroy(self, node: Node) -> None:
        """Destroy a node that this host has created."""
        self._nodes.remove(node)
        self._executor.remove_node(node)
        node.destroy_node()

    def destroy_all(self) -> None:
        """Destroy all remaining nodes that this host has created."""
        while self._nodes:
            self.destroy(self._nodes[-1])
