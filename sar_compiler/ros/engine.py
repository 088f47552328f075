"""The interface of the engines that tick a tree: the project's own runner, and `py_trees_ros` if it is installed.

This module also contains the code that both engines share: it logs exceptions of behaviours, limits the depth of trees, cleans up after a
failed setup, and ends all goals when a tree is stopped, even if leaves raise exceptions.
"""

import os
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from itertools import takewhile
from pathlib import Path
from types import FrameType
from typing import NoReturn, Protocol

import py_trees
import rclpy.logging
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node

from sar_compiler.compiler import file_and_line_of
from sar_compiler.errors import SarError
from sar_compiler.runtime.leaf_protocol import SettlingLeaf
from sar_compiler.tree.display_text import escape_to_one_line, visible

_OURS = tuple(
    f"{folder}{os.sep}" for folder in (Path(__file__).parents[1], Path(str(py_trees.__file__)).parent)
)
_TRACEBACKS = "traceback"
"""The last part of the traceback logger's name. This logger is a child of the node's logger."""


def error_text(error: BaseException) -> str:
    """Return an exception's type and message on one line; for the project's own errors, only the message."""
    text = " ".join(str(error).split())
    if isinstance(error, SarError):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def raising_behaviour(error: BaseException) -> Behaviour | None:
    """Return the innermost behaviour in an exception's traceback, or None if the traceback has no behaviour."""
    passed = _behaviours_passed(error)
    return passed[-1] if passed else None


def behaviour_title(behaviour: Behaviour | None) -> str:
    """Return a behaviour's name and class for an error message."""
    if behaviour is None:
        return "a tick handler"
    return f"'{behaviour.name}' ({type(behaviour).__name__})"


def failure_locations(behaviour: Behaviour | None, error: BaseException) -> str:
    """Return the source locations of a behaviour's exception, in parentheses.

    The locations are the line in the tree file and the line in Python code.

    The line in Python code is the line of the behaviour's own method. Functions called by this method are only shown in the traceback. The
    result is empty if neither location is known.
    """
    return source_locations(behaviour, reversed(list(traceback.walk_tb(error.__traceback__))))


def source_locations(behaviour: Behaviour | None, frames: Iterable[tuple[FrameType, int]]) -> str:
    """Return a behaviour's source locations, in parentheses: the lines in the tree file and in its own method.

    Args:
        behaviour: The behaviour; None for a tick handler.
        frames: The stack frames with their line numbers, innermost first.
    """
    known = [file_and_line_of(behaviour) if behaviour is not None else None, _line_of(behaviour, frames)]
    listed = "; ".join(location for location in known if location is not None)
    return f" ({listed})" if listed else ""


def failure_text(error: BaseException) -> str:
    """Describe an exception in a tick: the behaviour that raised it, the exception and its source locations."""
    behaviour = raising_behaviour(error)
    return f"{behaviour_title(behaviour)} failed: {error_text(error)}{failure_locations(behaviour, error)}"


def _line_of(behaviour: Behaviour | None, frames: Iterable[tuple[FrameType, int]]) -> str | None:
    for frame, line in frames:
        code = frame.f_code
        is_own = behaviour is None or frame.f_locals.get("self") is behaviour
        if is_own and not code.co_filename.startswith(_OURS):
            path = os.path.relpath(code.co_filename)
            return f"{code.co_filename if path.startswith(os.pardir) else path}:{line}, in {code.co_name}"
    return None


def show_tracebacks(node: Node) -> None:
    """Log the tracebacks of all failures, even without `--log-level debug`."""
    _traceback_logger(node).set_level(rclpy.logging.LoggingSeverity.DEBUG)


def _traceback_logger(node: Node) -> rclpy.logging.RcutilsLogger:
    return rclpy.logging.get_logger(f"{node.get_logger().name}.{_TRACEBACKS}")


def log_error(node: Node | None, text: str, error: BaseException | None = None) -> None:
    """Log an error on a node.

    Args:
        node: The node; None to log nothing.
        text: The error message.
        error: The exception that caused the error, whose traceback is logged at debug level.
    """
    if node is None:
        return
    node.get_logger().error(escape_to_one_line(text))
    if error is not None:
        _traceback_logger(node).debug(visible("".join(traceback.format_exception(error))))


def log_failure(node: Node | None, error: BaseException) -> Behaviour | None:
    """Log an exception that was raised in a tick and stops the tree.

    Returns:
        The behaviour that raised the exception; None if other code did.
    """
    log_error(node, f"{failure_text(error)}. The tree is stopped.", error)
    return raising_behaviour(error)


def _behaviours_passed(error: BaseException) -> list[Behaviour]:
    owners = [frame.f_locals.get("self") for frame, _ in traceback.walk_tb(error.__traceback__)]
    # An exception that the kernel raises about a behaviour has not passed through a method of the behaviour.
    owners.append(getattr(error, "behaviour", None))
    return [owner for owner in owners if isinstance(owner, Behaviour)]


# The number of Python's stack frames (a thousand by default) that are reserved for the code that calls the tree.
_RESERVED_FRAMES = 200


class TreeTooDeepError(SarError):
    """Raised if a tree is nested too deeply for Python's stack.

    Attributes:
        depth: The number of levels.
    """

    def __init__(self, depth: int) -> None:
        self.depth = depth
        super().__init__(
            f"the tree has {depth} nested levels, too many to tick and stop it. Reduce the depth of the tree"
        )


def require_tickable_depth(root: Behaviour, frames_per_level: int = 1) -> None:
    """Check that a tree can be traversed without exceeding Python's recursion limit.

    Args:
        root: The root of the tree.
        frames_per_level: The number of stack frames for each level of the tree: one for `iterate`, two for ticks in Python.

    Raises:
        TreeTooDeepError: If the tree is too deep.
    """
    depth, level = 0, [root]
    while level:
        depth += 1
        level = [child for behaviour in level for child in behaviour.children]
    if depth * frames_per_level > sys.getrecursionlimit() - _RESERVED_FRAMES:
        raise TreeTooDeepError(depth)


# Maximum duration of one turn of the executor while it waits for stopped leaves, in seconds.
_TURN_SEC = 0.02


def stop_behaviours(root: Behaviour, failed: Behaviour | None, node: Node | None) -> None:
    """Stop the failed leaf, then the root, then all behaviours that the root has not stopped.

    After an exception in its first tick, a composite is INVALID and does not stop its children. The leaf that raised the exception is INVALID,
    too, although it may have sent a goal.
    """
    if failed is not None and not failed.children:
        _stop_behaviour(failed, node)
    if failed is not root:
        _stop_behaviour(root, node)
    for behaviour in list(root.iterate()):
        if behaviour.status == Status.RUNNING:
            _stop_behaviour(behaviour, node)


def settle(root: Behaviour, executor: Executor, timeout_sec: float, node: Node | None) -> list[str]:
    """Spin until no leaf of a stopped tree has work in progress.

    Args:
        root: The root of the tree.
        executor: The executor of the tree's node.
        timeout_sec: The maximum time to spin, in seconds of the steady clock.
        node: The node that logs exceptions of callbacks.

    Returns:
        The names of the leaves that still have work in progress.
    """
    deadline = time.monotonic() + timeout_sec
    while leaves_at_work(root) and time.monotonic() < deadline:
        try:
            executor.spin_once(timeout_sec=_TURN_SEC)
        except (ExternalShutdownException, InvalidHandle):
            break
        except Exception as error:  # noqa: BLE001 - raised by a user's callback, after which the goals must still end
            log_error(node, f"A callback failed while the tree was stopped: {error_text(error)}")
        if not executor.context.ok():
            break
    return [leaf.name for leaf in leaves_at_work(root)]


def stop_leaves(behaviours: Iterable[Behaviour], node: Node | None) -> None:
    """Stop all leaves among the given behaviours. Their tree has not been ticked yet."""
    for behaviour in behaviours:
        if not behaviour.children:
            _stop_behaviour(behaviour, node)


def send_cancels(root: Behaviour, node: Node | None) -> None:
    """Stop a tree's leaves while the executor's thread is blocked, so that the leaves cancel their goals.

    Call this function from another thread. It does not wait for the responses. It first stops the leaves whose work may continue after a
    stop.
    """
    leaves = [each for each in root.iterate() if not each.children]
    for leaf in sorted(leaves, key=lambda each: not isinstance(each, SettlingLeaf)):
        if isinstance(leaf, SettlingLeaf) or leaf.status == Status.RUNNING:
            _stop_behaviour(leaf, node)


def shut_down(behaviours: Iterable[Behaviour], node: Node | None) -> None:
    """Shut down all behaviours, even if some of them raise exceptions."""
    for behaviour in behaviours:
        _shut_down_behaviour(behaviour, node)


def _stop_behaviour(behaviour: Behaviour, node: Node | None) -> None:
    try:
        behaviour.stop(Status.INVALID)
    except Exception as error:  # noqa: BLE001 - the remaining behaviours must still be stopped
        failed = raising_behaviour(error) or behaviour
        words = f"{error_text(error)}{failure_locations(failed, error)}"
        log_error(node, f"'{failed.name}' failed while it was stopped: {words}", error)
        # The behaviour is not stopped again, and does not count as running.
        failed.status = Status.INVALID


def _shut_down_behaviour(behaviour: Behaviour, node: Node | None) -> None:
    try:
        behaviour.shutdown()
    except Exception as error:  # noqa: BLE001 - the remaining behaviours must still be shut down
        words = f"{error_text(error)}{failure_locations(behaviour, error)}"
        log_error(node, f"'{behaviour.name}' could not be shut down: {words}", error)


def leaves_at_work(root: Behaviour) -> list[Behaviour]:
    """Return the leaves that still have work in progress after the tree was stopped."""
    return [leaf for leaf in root.iterate() if isinstance(leaf, SettlingLeaf) and not leaf.is_settled()]


class SetupFailedError(SarError, RuntimeError):
    """Raised if the setup of a leaf raises an exception.

    Attributes:
        behaviour: The leaf's name.
    """

    def __init__(self, behaviour: Behaviour, error: Exception) -> None:
        self.behaviour = behaviour.name
        super().__init__(
            f"{behaviour_title(behaviour)} failed in setup: {error_text(error)}{failure_locations(behaviour, error)}"
        )


def give_up(root: Behaviour, error: Exception, node: Node) -> NoReturn:
    """Stop and shut down the behaviours whose setup succeeded, and raise the error of the failed setup.

    Raises:
        SetupFailedError: If a behaviour's setup raised the exception.
        Exception: The original exception, if it is a `SarError` or was not raised by a behaviour.
    """
    # The engine has called the setup of the first behaviour in the traceback. All behaviours before it are set up.
    called = next(iter(_behaviours_passed(error)), None)
    ready = list(takewhile(lambda behaviour: behaviour is not called, root.iterate()))
    stop_leaves(ready, node)
    shut_down(ready, node)
    behaviour = raising_behaviour(error)
    if behaviour is None or isinstance(error, SarError):
        raise error
    raise SetupFailedError(behaviour, error) from error


class EngineError(SarError):
    """Raised if the requested engine cannot be loaded."""


class Engine(Protocol):
    """The interface between a run and the engine that ticks its tree. `TreeRunner` documents the methods.

    Attributes:
        count: The number of ticks so far.
        failure: The exception of a leaf or tick handler that stopped the tree; None if no exception has stopped the tree.
    """

    count: int
    failure: Exception | None

    def add_post_tick_handler(self, handler: Callable[[BehaviourTree], None]) -> None:
        """Add a handler that is called after every tick."""

    def add_visitor(self, visitor: VisitorBase) -> None:
        """Add a visitor that is called for every ticked node."""

    def setup(self, node: Node) -> None:
        """Set up every behaviour of the tree on a node.

        Raises:
            SetupFailedError: If the setup of a behaviour raised an exception. In this case, the behaviours whose setup succeeded are shut
                down.
        """

    def tick_tock(self, period_ms: float) -> None:
        """Start ticking in the node's executor, and return at once."""

    def settle(self, executor: Executor, timeout_sec: float) -> list[str]:
        """Stop the tree, wait until its leaves finish, and return the names of leaves that did not finish in time."""

    def shutdown(self) -> None:
        """Stop the tree and release its resources."""
