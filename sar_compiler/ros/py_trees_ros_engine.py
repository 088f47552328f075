"""Tick a tree with `py_trees_ros`, if this package is installed (it is not on PyPI).

Compared to `runner.TreeRunner`, this engine also provides snapshot streams for `py-trees-tree-watcher` and viewers, blackboard streams and
statistics. But a leaf with a new result does not trigger a tick. If the node's clock stops, the ticks stop, too, and the leaves' deadlines
are no longer checked.
"""

from typing import Any

import py_trees_ros.trees
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from rclpy.executors import Executor
from rclpy.node import Node

from sar_compiler.missions.parameter_reader import SETTLE_SEC
from sar_compiler.ros.engine import (
    give_up,
    log_failure,
    require_tickable_depth,
    settle,
    shut_down,
    stop_behaviours,
)
from sar_compiler.runtime.kernel.leaf_nodes import insist_on_status

# The parameters that the base class declares on the node, even if they are already declared.
_ITS_PARAMETERS = (
    "default_snapshot_stream",
    "default_snapshot_period",
    "default_snapshot_blackboard_data",
    "default_snapshot_blackboard_activity",
    "setup_timeout",
)


class PyTreesRosEngine(py_trees_ros.trees.BehaviourTree):
    """A `py_trees_ros.trees.BehaviourTree` that always stops its tree, even after an exception.

    Attributes:
        failure: The exception of a leaf or tick handler that stopped the tree; None if no exception has stopped the tree.
    """

    root: Behaviour

    def __init__(self, root: Behaviour) -> None:
        super().__init__(root)
        self.failure: Exception | None = None
        self._stopped = self._shut_down = False

    def setup(self, node: Node, **kwargs: Any) -> None:
        """Set up every behaviour of the tree on a node.

        Args:
            node: The node whose executor ticks the tree.
            kwargs: See `py_trees_ros.trees.BehaviourTree.setup`.

        Raises:
            TreeTooDeepError: If the tree is nested too deeply to be ticked.
            SetupFailedError: If the setup of a behaviour raised an exception. In this case, the behaviours whose setup succeeded are shut
                down.
        """
        require_tickable_depth(self.root, frames_per_level=2)
        given = [name for name in _ITS_PARAMETERS if node.has_parameter(name)]
        for name in given:
            # The base class declares the parameter again, with the value from the command line.
            node.undeclare_parameter(name)
        try:
            super().setup(node=node, **kwargs)
        except Exception as error:  # noqa: BLE001 - `give_up` raises it again, with its context
            self._stopped = self._shut_down = True
            give_up(self.root, error, node)
        # If `update` returns no status, py_trees would only log an error and continue as if the node were reset. A `Timeout` would start over.
        for behaviour in self.root.iterate():
            insist_on_status(behaviour)

    def tick(self, *args: Any, **kwargs: Any) -> None:
        """Tick once; after an exception, store the exception in `failure` and stop the tree."""
        if self._stopped:
            return
        try:
            super().tick(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - stored and logged, because it would not be caught in a timer
            self._fail(error)

    def settle(self, executor: Executor, timeout_sec: float = SETTLE_SEC) -> list[str]:
        """Stop the tree, then spin until no leaf has work in progress.

        Returns:
            The names of the leaves that still have work in progress.
        """
        self._stop(None)
        return settle(self.root, executor, timeout_sec, self.node)

    def shutdown(self) -> None:
        """Stop the tree, and release the resources of its behaviours and of the base class."""
        self._stop(None)
        if not self._shut_down:
            self._shut_down = True
            shut_down(list(self.root.iterate()), self.node)
        if self.node is None:
            return
        # The base class's method would shut down the tree again, and stop at the first behaviour that raises an exception.
        root, self.root = self.root, Dummy("nothing is left to shut down")
        try:
            super().shutdown()
        finally:
            self.root = root

    def _fail(self, error: Exception) -> None:
        self.failure = error
        self._stop(log_failure(self.node, error))

    def _stop(self, failed: Behaviour | None) -> None:
        if self._stopped:
            return
        self._stopped = True
        if self.timer is not None:
            self.timer.cancel()
        stop_behaviours(self.root, failed, self.node)
