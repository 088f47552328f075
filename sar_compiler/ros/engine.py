"""The engine that ticks a tree: the project's own runner, or `py_trees_ros` if installed; and what is the same for both.

That is the limit of a tree's depth, the clean-up when its leaves cannot be set up, and stopping it so that a robot is not left
driving, whatever its leaves raise.
"""

import sys
import time
from collections.abc import Callable, Iterable
from itertools import takewhile
from typing import NoReturn, Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node

from sar_compiler.errors import SarError
from sar_compiler.ros.failure_reports import called_by_engine, described, named, places, raised_in, tell
from sar_compiler.runtime.leaf_protocol import Settling

# Python has a thousand frames; these are for the program around the tree.
_FRAMES_AROUND = 200


class TreeTooDeepError(SarError):
    """A tree is nested too deeply for Python's stack.

    Attributes:
        depth: Its number of levels.
    """

    def __init__(self, depth: int) -> None:
        self.depth = depth
        super().__init__(
            f"the tree is nested {depth} levels deep, which is more than can be ticked and stopped"
        )


def require_tickable_depth(root: Behaviour, frames_per_level: int = 1) -> None:
    """Check that py_trees can go through a tree without a stack overflow.

    Args:
        root: The root.
        frames_per_level: How many of Python's frames it needs for a level: `iterate` one, its own ticks two.

    Raises:
        TreeTooDeepError: If it is too deep.
    """
    depth, level = 0, [root]
    while level:
        depth += 1
        level = [child for behaviour in level for child in behaviour.children]
    if depth * frames_per_level > sys.getrecursionlimit() - _FRAMES_AROUND:
        raise TreeTooDeepError(depth)


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


class SetupFailedError(SarError, RuntimeError):
    """The setup of a leaf raised an exception.

    Attributes:
        behaviour: The leaf's name.
    """

    def __init__(self, behaviour: Behaviour, error: Exception) -> None:
        self.behaviour = behaviour.name
        super().__init__(f"{named(behaviour)} failed in setup: {described(error)}{places(behaviour, error)}")


def give_up(root: Behaviour, error: Exception, node: Node) -> NoReturn:
    """Stop and shut down the behaviours that are set up already, and raise the error of the setup.

    Raises:
        SetupFailedError: If it was raised by a behaviour's setup.
        Exception: The original exception, if it needs no context (a `SarError`) or was raised elsewhere.
    """
    called = called_by_engine(error)
    ready = list(takewhile(lambda behaviour: behaviour is not called, root.iterate()))
    stop_leaves(ready, node)
    shut_down(ready, node)
    behaviour = raised_in(error)
    if behaviour is None or isinstance(error, SarError):
        raise error
    raise SetupFailedError(behaviour, error) from error


class EngineError(SarError):
    """The requested engine cannot be loaded."""


class Engine(Protocol):
    """The interface between a run and the engine that ticks its tree; see `TreeRunner` for the methods.

    Attributes:
        count: The number of ticks so far.
        failure: The exception of a leaf or a handler that stopped the tree; None if there was none.
    """

    count: int
    failure: Exception | None

    def add_post_tick_handler(self, handler: Callable[[BehaviourTree], None]) -> None:
        """Register a handler to be called after every tick."""

    def add_visitor(self, visitor: VisitorBase) -> None:
        """Have every node that is ticked shown to a visitor."""

    def setup(self, node: Node) -> None:
        """Set up every behaviour of the tree on a node.

        Raises:
            SetupFailedError: If the setup of a behaviour raised an exception; the others are shut down.
        """

    def tick_tock(self, period_ms: float) -> None:
        """Start ticking, from the node's executor, and return at once."""

    def settle(self, executor: Executor, timeout_sec: float) -> list[str]:
        """Stop the tree, and wait briefly for its leaves; returns the names of those that are still active."""

    def shutdown(self) -> None:
        """Stop the tree and release its resources."""


EngineFactory = Callable[[Behaviour], Engine]


def find_engine(name: str) -> EngineFactory:
    """Return the factory that makes an engine for a tree.

    Args:
        name: `own`, or `py_trees_ros`.

    Raises:
        EngineError: If it, or a module that it needs, is not installed.
    """
    if name == "own":
        from sar_compiler.ros.runner import TreeRunner

        return TreeRunner
    try:
        from sar_compiler.ros.py_trees_ros_engine import PyTreesRosEngine
    except ImportError as error:
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if (missing or "").partition(".")[0] == "py_trees_ros":
            message = (
                f"--engine py_trees_ros: it is not installed here ({error}). On a robot: sudo apt install "
                "ros-jazzy-py-trees-ros (it is not on PyPI); or leave --engine out, to tick with the project's own"
            )
        else:
            message = (
                f"--engine py_trees_ros: it is here, and cannot be loaded: {f'{missing} is missing' if missing else error}. "
                "Mend that, or leave --engine out, to tick with the project's own"
            )
        raise EngineError(message) from error
    return PyTreesRosEngine
