"""The executor that runs the callbacks of a mission's node.

An executor with a wait set checks every entity of its nodes after every event. rclpy's `EventsExecutor` is notified of
the entity that has an event, which takes a fraction of the time. In Jazzy, it rejects guard conditions, and does not
await service callbacks that are coroutines: it sends the coroutine object as the response.
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
    """Schedule a method in an executor's thread, from any thread. The method is not called if its object has been deleted.

    After its shutdown, rclpy's `EventsExecutor` keeps its pending calls in C++, where Python's garbage collector does not see
    them. A bound method of an object of a run would keep the whole run in memory forever.

    Args:
        executor: The executor.
        method: A bound method, to which only a weak reference is stored.
    """
    reference = WeakMethod(method)

    def call() -> None:
        if (found := reference()) is not None:
            found()

    executor.create_task(call)


def make_executor(context: Context, kind: str) -> Executor:
    """Create an `EventsExecutor` if *kind* is `events` and rclpy has this class, otherwise an executor with a wait set."""
    if kind == "events":
        with suppress(ImportError):
            from rclpy.experimental import EventsExecutor

            return EventsExecutor(context=context)
    return SingleThreadedExecutor(context=context)


def suitable_executor(executor: Executor, node: Node) -> Executor:
    """Return an executor that supports all entities of a node: the given executor, or its replacement."""
    has_coroutine = any(iscoroutinefunction(service.callback) for service in node.services)
    # rclpy's EventsExecutor is not a subclass of Executor.
    if isinstance(node.executor, Executor) or not (has_coroutine or any(node.guards)):
        return executor
    node.get_logger().info(
        f"A {'service with a coroutine' if has_coroutine else 'guard condition'} needs a wait set. "
        "Callbacks run in a SingleThreadedExecutor, which is slower."
    )
    if hasattr(executor, "serve_apart"):  # the executor also runs a simulated world
        executor.serve_apart(node)
        return executor
    executor.shutdown()
    other = SingleThreadedExecutor(context=node.context)
    node.context.on_shutdown(other.shutdown)
    other.add_node(node)
    return other
