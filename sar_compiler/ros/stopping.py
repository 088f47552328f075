"""Stopping a tree so that a robot is not left driving, whatever its leaves raise."""

import time
from collections.abc import Iterable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node

from sar_compiler.ros.failure_reports import described, places, raised_in, tell
from sar_compiler.runtime.leaf_protocol import Settling

# How long one turn of the executor may take while stopped leaves settle.
_TURN_SEC = 0.02


def stop_behaviours(root: Behaviour, failed: Behaviour | None, node: Node | None) -> None:
    """Stop the leaf that failed, the root, and then all behaviours not reached from there.

    A composite that raised in its first tick is INVALID and stops none of its children, and the leaf
    that raised is INVALID too, although it may have sent its goal.
    """
    if failed is not None and not failed.children:
        _stop_one(failed, node)
    if failed is not root:
        _stop_one(root, node)
    for behaviour in list(root.iterate()):
        if behaviour.status == Status.RUNNING:
            _stop_one(behaviour, node)


def settle(root: Behaviour, executor: Executor, timeout_sec: float, node: Node | None) -> list[str]:
    """Spin until none of a stopped tree's leaves has work in progress.

    Args:
        root: The tree.
        executor: The executor of its node.
        timeout_sec: The longest time to spin, in seconds of the steady clock.
        node: Logs exceptions of callbacks.

    Returns:
        The names of the leaves that still had work in progress at the end.
    """
    deadline = time.monotonic() + timeout_sec
    while _unsettled(root) and time.monotonic() < deadline:
        try:
            executor.spin_once(timeout_sec=_TURN_SEC)
        except (ExternalShutdownException, InvalidHandle):
            break
        except Exception as error:  # noqa: BLE001 - somebody's callback; the goals still count
            tell(node, f"while the tree was stopping: {described(error)}")
        if not executor.context.ok():
            break
    return [leaf.name for leaf in _unsettled(root)]


def stop_leaves(behaviours: Iterable[Behaviour], node: Node | None) -> None:
    """Stop the leaves among the behaviours of a tree that was not ticked yet."""
    for behaviour in behaviours:
        if not behaviour.children:
            _stop_one(behaviour, node)


def send_cancels(root: Behaviour, node: Node | None) -> None:
    """Have the leaves of a tree cancel their goals, from another thread: that of the executor is blocked.

    The requests are sent; nobody will see their answers. Leaves that can have work in progress come first.
    """
    leaves = [each for each in root.iterate() if not each.children]
    for leaf in sorted(leaves, key=lambda each: not isinstance(each, Settling)):
        if isinstance(leaf, Settling) or leaf.status == Status.RUNNING:
            _stop_one(leaf, node)


def shut_down(behaviours: Iterable[Behaviour], node: Node | None) -> None:
    """Shut down all behaviours, even if some of them raise."""
    for behaviour in behaviours:
        _shut_one_down(behaviour, node)


def _stop_one(behaviour: Behaviour, node: Node | None) -> None:
    try:
        behaviour.stop(Status.INVALID)
    except Exception as error:  # noqa: BLE001 - the others must be stopped all the same
        failed = raised_in(error) or behaviour
        words = f"{described(error)}{places(failed, error)}"
        tell(node, f"'{failed.name}' failed while it was stopped: {words}", error)
        # Not again, and not as one that is still running.
        failed.status = Status.INVALID


def _shut_one_down(behaviour: Behaviour, node: Node | None) -> None:
    try:
        behaviour.shutdown()
    except Exception as error:  # noqa: BLE001 - the others must be shut down all the same
        words = f"{described(error)}{places(behaviour, error)}"
        tell(node, f"'{behaviour.name}' could not be shut down: {words}", error)


def _unsettled(root: Behaviour) -> list[Behaviour]:
    return [leaf for leaf in root.iterate() if isinstance(leaf, Settling) and not leaf.settled()]
