"""`BehaviourTree` with the signatures, the parameters and the timer that py_trees_ros 2 documents."""

from typing import Any

import rclpy
from py_trees.common import Duration
from py_trees.trees import CONTINUOUS_TICK_TOCK
from py_trees.trees import BehaviourTree as Base

PARAMETERS = {
    "default_snapshot_stream": False,
    "default_snapshot_period": 2.0,
    "default_snapshot_blackboard_data": True,
    "default_snapshot_blackboard_activity": False,
    "setup_timeout": float("inf"),
}


class BehaviourTree(Base):
    """Ticks on a timer of its node, declares its parameters there, and destroys the node on shutdown."""

    def __init__(self, root, unicode_tree_debug=False):
        super().__init__(root)
        self.node: Any = None
        self.timer: Any = None

    def setup(self, node=None, node_name="tree", timeout=Duration.INFINITE, visitor=None, **kwargs):  # type: ignore[override]
        self.node = node or rclpy.create_node(node_name)
        for name, value in PARAMETERS.items():
            self.node.declare_parameter(name, value)
        super().setup(timeout=timeout, visitor=visitor, node=self.node, **kwargs)

    def tick_tock(  # type: ignore[override]
        self,
        period_ms,
        number_of_iterations=CONTINUOUS_TICK_TOCK,
        pre_tick_handler=None,
        post_tick_handler=None,
    ):
        self.timer = self.node.create_timer(
            period_ms / 1000.0, lambda: self.tick(pre_tick_handler, post_tick_handler)
        )

    def shutdown(self):
        if self.timer is not None:
            self.timer.cancel()
            self.node.destroy_timer(self.timer)
        super().shutdown()
        self.node.destroy_node()
