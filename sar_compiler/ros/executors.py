"""The executor that runs the callbacks of a mission's node.

An executor with a wait set checks every entity of its nodes after every event. rclpy's `EventsExecutor` takes a fraction of this time,
because ROS reports which entity has an event. In Jazzy, the `EventsExecutor` rejects guard conditions. It also does not await a service
callback that is a coroutine, but sends the coroutine object as the response.
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
    """Schedule a method call in an executor's thread. If the method's object is deleted, the call is omitted.

    This function may be called from any thread. After a shutdown, rclpy's `EventsExecutor` keeps pending calls in C++, where Python's
    garbage collector does not see them. A pending call with a bound method would therefore keep all objects of a run in memory forever.

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
    """Create an `EventsExecutor` if *kind* is `events` and rclpy has this class; otherwise create a `SingleThreadedExecutor`."""
    if kind == "events":
        with suppress(ImportError):
            from rclpy.experimental import EventsExecutor

            return EventsExecutor(context=context)
    return SingleThreadedExecutor(context=context)


def suitable_executor(executor: Executor, node: Node) -> Executor:
    """Return an executor that supports all entities of a node: the given executor or, if necessary, another one."""
    has_coroutine = any(iscoroutinefunction(service.callback) for service in node.services)
    # rclpy's EventsExecutor is not a subclass of Executor.
    if isinstance(node.executor, Executor) or not (has_coroutine or any(node.guards)):
        return executor
    node.get_logger().info(
        f"A {'service with a coroutine' if has_coroutine else 'guard condition'} needs an executor with a wait set. So the callbacks run "
        f"in a SingleThreadedExecutor, which is slower."
    )
    if hasattr(executor, "serve_apart"):  # the executor also runs a simulated world
        executor.serve_apart(node)
        return executor
    executor.shutdown()
    other = SingleThreadedExecutor(context=node.context)
    node.context.on_shutdown(other.shutdown)
    other.add_node(node)
    return other
