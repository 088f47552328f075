"""The changes of a tree's statuses, in the messages of Nav2's log."""

import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from nav2_msgs.msg import BehaviorTreeLog, BehaviorTreeStatusChange
from py_trees.trees import BehaviourTree
from rclpy.node import Node

from sar_compiler.monitoring.numbered_tree import NumberedTree
from sar_compiler.monitoring.status_changes import StatusChange, StatusChanges
from sar_compiler.ros.engine import Engine
from sar_compiler.runtime.kernel.cells import WORDS

TOPIC = "behavior_tree_log"


class TreeLog:
    """Publishes the changes of each tick.

    Args:
        node: The node whose time the messages have.
        tree: The tree.
        tell: Called with each message, in the thread that ticks.

    Attributes:
        statuses: The status of each node, by its number.
    """

    def __init__(self, node: Node, tree: NumberedTree, tell: Callable[[BehaviorTreeLog], object]) -> None:
        self._node, self._tree, self._tell = node, tree, tell
        self._events: list[BehaviorTreeStatusChange] = []
        self._changes = StatusChanges(tree, self._note)
        self.statuses = self._changes.statuses

    def watch(self, engine: Engine) -> None:
        """Watch what ticks the tree."""
        engine.add_visitor(self._changes)
        engine.add_post_tick_handler(self._after_tick)

    def end(self) -> None:
        """Report how it has ended; nothing is ticked any more."""
        self._changes.finalise()
        self._tell_events()

    def state(self) -> BehaviorTreeLog:
        """Return a message with the status of every node."""
        events = [self._event(StatusChange(uid, now, now)) for uid, now in enumerate(self.statuses) if uid]
        return BehaviorTreeLog(timestamp=self._now(), event_log=events)

    def _note(self, change: StatusChange) -> None:
        self._events.append(self._event(change))

    def _event(self, change: StatusChange) -> BehaviorTreeStatusChange:
        seconds, nanoseconds = divmod(time.time_ns(), 10**9)
        return BehaviorTreeStatusChange(
            timestamp=Time(sec=seconds, nanosec=nanoseconds),
            node_name=self._tree.nodes[change.uid - 1].name,
            uid=change.uid,
            previous_status=WORDS[change.before] or "IDLE",
            current_status=WORDS[change.status] or "IDLE",
        )

    def _after_tick(self, _: BehaviourTree) -> None:
        self._tell_events()

    def _tell_events(self) -> None:
        if self._events:
            events, self._events = self._events, []
            self._tell(BehaviorTreeLog(timestamp=self._now(), event_log=events))

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()
