"""The engine that ticks a tree: the project's own runner, or `py_trees_ros` if installed."""

from collections.abc import Callable
from typing import Protocol

from py_trees.behaviour import Behaviour
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase
from rclpy.executors import Executor
from rclpy.node import Node

from sar_compiler.errors import SarError
from sar_compiler.ros.runner import TreeRunner


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
