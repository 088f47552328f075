"""The executor that runs the callbacks of a mission's node.

One with a wait set looks at all that its nodes have whenever anything happens. rclpy's `EventsExecutor` is told what has happened, which takes
a fraction of the time. In Jazzy it refuses guard conditions, and sends the coroutine of a service's callback in the place of an answer.
"""

from collections.abc import Callable
from contextlib import suppress
from inspect import iscoroutinefunction
from typing import Any
from weakref import WeakMethod

from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node


def call_soon(executor: Any, method: Callable[[], object]) -> None:
    """Have a method called in the thread of an executor, unless its object is gone by then; may be called from any thread.

    The executor of events keeps what it has not called yet when it is shut down, in C++, where Python's garbage collector does not
    see it. A method of what a run is made of would keep the whole run for good.

    Args:
        executor: The executor.
        method: A bound method, which is referred to weakly.
    """
    reference = WeakMethod(method)

    def call() -> None:
        if (found := reference()) is not None:
            found()

    executor.create_task(call)


def make_executor(context: Context, kind: str) -> Executor:
    """Return an executor: that of `events` if that is wanted, and if this rclpy has it; else one with a wait set."""
    if kind == "events":
        with suppress(ImportError):
            from rclpy.experimental import EventsExecutor

            return EventsExecutor(context=context)
    return SingleThreadedExecutor(context=context)


def suited(executor: Executor, node: Node) -> Executor:
    """Return the executor of a node, or one with a wait set that has taken its place, if the node has what needs one."""
    has_coroutine = any(iscoroutinefunction(service.callback) for service in node.services)
    # rclpy's EventsExecutor is no Executor.
    if isinstance(node.executor, Executor) or not (has_coroutine or any(node.guards)):
        return executor
    node.get_logger().info(
        f"A {'service has a coroutine' if has_coroutine else 'guard condition is there'}: callbacks are run by a "
        "SingleThreadedExecutor, for which each turn takes longer."
    )
    if hasattr(executor, "serve_apart"):  # which serves a simulated world as well
        executor.serve_apart(node)
        return executor
    executor.shutdown()
    other = SingleThreadedExecutor(context=node.context)
    node.context.on_shutdown(other.shutdown)
    other.add_node(node)
    return other
