"""Interface of the engines that tick a tree: the project's own runner, or `py_trees_ros` if installed.

The module holds the parts that both share: log lines about exceptions of behaviours, the limit of a tree's
depth, the clean-up when setup fails, and a stop that leaves no robot driving, whatever the leaves raise.
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
"""Suffix that the logger of tracebacks adds to the node's name."""


def error_text(error: BaseException) -> str:
    """Return an exception's type and text in one line, without the type for the project's own errors."""
    text = " ".join(str(error).split())
    if isinstance(error, SarError):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def raising_behaviour(error: BaseException) -> Behaviour | None:
    """Return the innermost behaviour of a tree that an exception passed through, or None."""
    passed = _behaviours_passed(error)
    return passed[-1] if passed else None


def behaviour_title(behaviour: Behaviour | None) -> str:
    """Return a behaviour's name for an error message."""
    if behaviour is None:
        return "a tick handler"
    return f"'{behaviour.name}' ({type(behaviour).__name__})"


def failure_locations(behaviour: Behaviour | None, error: BaseException) -> str:
    """Return the source locations of a behaviour's exception in brackets: in the tree file and in Python.

    The result is empty if neither is known. The Python line is the one in the behaviour's own method. The
    traceback has the called functions.
    """
    return source_locations(behaviour, reversed(list(traceback.walk_tb(error.__traceback__))))


def source_locations(behaviour: Behaviour | None, frames: Iterable[tuple[FrameType, int]]) -> str:
    """Return a behaviour's location in brackets: the lines in the tree file and of its own method.

    Args:
        behaviour: The behaviour; None for a tick handler.
        frames: The frames of the stack with their lines, the innermost first.
    """
    known = [file_and_line_of(behaviour) if behaviour is not None else None, _line_of(behaviour, frames)]
    said = "; ".join(place for place in known if place is not None)
    return f" ({said})" if said else ""


def failure_text(error: BaseException) -> str:
    """Return a text with the behaviour that raised an exception in a tick, the exception and its location."""
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
    """Log an error if there is a node to log it.

    Args:
        node: The node.
        text: What is wrong.
        error: Its cause; the traceback is logged at debug level.
    """
    if node is None:
        return
    node.get_logger().error(escape_to_one_line(text))
    if error is not None:
        _traceback_logger(node).debug(visible("".join(traceback.format_exception(error))))


def log_failure(node: Node | None, error: BaseException) -> Behaviour | None:
    """Log the exception in a tick that stops the tree.

    Returns:
        The behaviour that raised it; None if it was not a behaviour of the tree.
    """
    log_error(node, f"{failure_text(error)}. The tree is stopped.", error)
    return raising_behaviour(error)


def _behaviours_passed(error: BaseException) -> list[Behaviour]:
    owners = [frame.f_locals.get("self") for frame, _ in traceback.walk_tb(error.__traceback__)]
    # An exception that the kernel raises about a behaviour has passed through none of its methods.
    owners.append(getattr(error, "behaviour", None))
    return [owner for owner in owners if isinstance(owner, Behaviour)]


# Python allows a thousand frames. These are reserved for the program around the tree.
_FRAMES_AROUND = 200


class TreeTooDeepError(SarError):
    """A tree is nested too deeply for Python's stack.

    Attributes:
        depth: The number of levels.
    """

    def __init__(self, depth: int) -> None:
        self.depth = depth
        super().__init__(
            f"the tree is nested {depth} levels deep, which is more than can be ticked and stopped"
        )


def require_tickable_depth(root: Behaviour, frames_per_level: int = 1) -> None:
    """Check that py_trees can traverse a tree without a stack overflow.

    Args:
        root: The root.
        frames_per_level: The Python frames that a level needs: one for `iterate`, two for the tree's own ticks.

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
    """Stop the leaf that failed, then the root, then all behaviours that the root did not reach.

    A composite that raised in its first tick is INVALID and stops none of its children, and the leaf
    that raised is INVALID too, although it may have sent its goal.
    """
    if failed is not None and not failed.children:
        _stop_behaviour(failed, node)
    if failed is not root:
        _stop_behaviour(root, node)
    for behaviour in list(root.iterate()):
        if behaviour.status == Status.RUNNING:
            _stop_behaviour(behaviour, node)


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
    while leaves_at_work(root) and time.monotonic() < deadline:
        try:
            executor.spin_once(timeout_sec=_TURN_SEC)
        except (ExternalShutdownException, InvalidHandle):
            break
        except Exception as error:  # noqa: BLE001 - a user's callback; the goals must end all the same
            log_error(node, f"while the tree was stopping: {error_text(error)}")
        if not executor.context.ok():
            break
    return [leaf.name for leaf in leaves_at_work(root)]


def stop_leaves(behaviours: Iterable[Behaviour], node: Node | None) -> None:
    """Stop the leaves among the behaviours of a tree that was not ticked yet."""
    for behaviour in behaviours:
        if not behaviour.children:
            _stop_behaviour(behaviour, node)


def send_cancels(root: Behaviour, node: Node | None) -> None:
    """Cancel the goals of a tree's leaves from another thread, because the executor's thread is blocked.

    The requests are sent without waiting for the responses. Leaves that can have work in progress come first.
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
    except Exception as error:  # noqa: BLE001 - the others must be stopped all the same
        failed = raising_behaviour(error) or behaviour
        words = f"{error_text(error)}{failure_locations(failed, error)}"
        log_error(node, f"'{failed.name}' failed while it was stopped: {words}", error)
        # Do not stop it again, and do not treat it as running.
        failed.status = Status.INVALID


def _shut_down_behaviour(behaviour: Behaviour, node: Node | None) -> None:
    try:
        behaviour.shutdown()
    except Exception as error:  # noqa: BLE001 - the others must be shut down all the same
        words = f"{error_text(error)}{failure_locations(behaviour, error)}"
        log_error(node, f"'{behaviour.name}' could not be shut down: {words}", error)


def leaves_at_work(root: Behaviour) -> list[Behaviour]:
    """Return the stopped tree's leaves whose work has not ended."""
    return [leaf for leaf in root.iterate() if isinstance(leaf, SettlingLeaf) and not leaf.is_settled()]


class SetupFailedError(SarError, RuntimeError):
    """The setup of a leaf raised an exception.

    Attributes:
        behaviour: The leaf's name.
    """

    def __init__(self, behaviour: Behaviour, error: Exception) -> None:
        self.behaviour = behaviour.name
        super().__init__(
            f"{behaviour_title(behaviour)} failed in setup: {error_text(error)}{failure_locations(behaviour, error)}"
        )


def give_up(root: Behaviour, error: Exception, node: Node) -> NoReturn:
    """Stop and shut down the behaviours already set up, and raise the setup error.

    Raises:
        SetupFailedError: If it was raised by a behaviour's setup.
        Exception: The original exception, if it needs no context (a `SarError`) or was raised elsewhere.
    """
    # The engine has already called the outermost of them.
    called = next(iter(_behaviours_passed(error)), None)
    ready = list(takewhile(lambda behaviour: behaviour is not called, root.iterate()))
    stop_leaves(ready, node)
    shut_down(ready, node)
    behaviour = raising_behaviour(error)
    if behaviour is None or isinstance(error, SarError):
        raise error
    raise SetupFailedError(behaviour, error) from error


class EngineError(SarError):
    """The requested engine cannot be loaded."""


class Engine(Protocol):
    """Interface between a run and the engine that ticks its tree. See `TreeRunner` for the methods.

    Attributes:
        count: The number of ticks so far.
        failure: The exception of a leaf or a handler that stopped the tree; None if there was none.
    """

    count: int
    failure: Exception | None

    def add_post_tick_handler(self, handler: Callable[[BehaviourTree], None]) -> None:
        """Register a handler to be called after every tick."""

    def add_visitor(self, visitor: VisitorBase) -> None:
        """Show every ticked node to a visitor."""

    def setup(self, node: Node) -> None:
        """Set up every behaviour of the tree on a node.

        Raises:
            SetupFailedError: If the setup of a behaviour raised an exception; the others are shut down.
        """

    def tick_tock(self, period_ms: float) -> None:
        """Start ticking, from the node's executor, and return at once."""

    def settle(self, executor: Executor, timeout_sec: float) -> list[str]:
        """Stop the tree, wait briefly for its leaves, and return the names of the active ones."""

    def shutdown(self) -> None:
        """Stop the tree and release its resources."""
