"""A mission in a file: its topics, its tree's log, and its own."""

from collections.abc import Mapping
from pathlib import Path

from rcl_interfaces.msg import Log
from rclpy.node import Node
from std_msgs.msg import String

from sar_compiler.journal.journal_entries import OF_ROBOT, RUN_BEGAN, JournalEntry
from sar_compiler.journal.json_values import json_text
from sar_compiler.monitoring.numbered_tree import NumberedTree
from sar_compiler.monitoring.tree_xml import tree_xml
from sar_compiler.ros.engine import Engine
from sar_compiler.ros.failure_reports import described
from sar_compiler.ros.mcap_recorder import McapRecorder
from sar_compiler.ros.tree_log import TOPIC, TreeLog

# What is in other topics of the recording.
_ELSEWHERE = ("status", *OF_ROBOT)


class MissionRecording:
    """Records a mission in an MCAP file, whether or not anything of it is published.

    Beside the topics of `ros.mcap_recorder.RECORDED`: `behavior_tree_log`, `~/tree` as `ros.mission_publisher` has them, and
    `mission_log` (`rcl_interfaces/msg/Log`), what the run's journal is told, but for what other topics have.

    Args:
        node: The mission's node.
        path: The file, which is made.

    Raises:
        RecordingError: If there is such a file, or it cannot be made.
    """

    def __init__(self, node: Node, path: Path) -> None:
        self._node = node
        self._recorder = McapRecorder.create(path, node.get_logger().error)
        self._tree_log: TreeLog | None = None
        self._has_begun = False

    def show(self, tree: NumberedTree) -> None:
        """Take the tree, and begin to record."""
        self._write("~/tree", String(data=tree_xml(tree)), latched=True)
        self._tree_log = TreeLog(self._node, tree, lambda message: self._write(TOPIC, message))
        self._recorder.listen(self._node)

    def watch(self, engine: Engine) -> None:
        """Watch what ticks the tree."""
        self._has_begun = True
        if self._tree_log is not None:
            self._tree_log.watch(engine)

    def take(self, entry: JournalEntry) -> None:
        """Take an entry of the run's journal."""
        if entry.kind in _ELSEWHERE:
            return
        data: Mapping[str, object] = entry.data
        if entry.kind == RUN_BEGAN:
            data = {key: value for key, value in data.items() if key != "tree"}
        message = Log(
            level=Log.INFO, name=self._node.get_logger().name, msg=f"{entry.kind} {json_text(data)}"
        )
        message.stamp.sec, message.stamp.nanosec = divmod(int(entry.wall * 1e9), 10**9)
        self._write("mission_log", message)

    def end(self) -> None:
        """Record how it has ended; nothing is ticked any more."""
        if self._tree_log is not None:
            self._tree_log.end()

    def close(self) -> None:
        """Close the file; that of a run that never began is removed, so that the next try finds none."""
        self._recorder.close(keep=self._has_begun)

    def _write(self, name: str, message: object, *, latched: bool = False) -> None:
        try:
            self._recorder.write(self._node.resolve_topic_name(name), message, latched=latched)
        except Exception as error:  # noqa: BLE001 - what cannot be written is no reason to stop the mission
            self._node.get_logger().error(f"A message of {name} is not recorded: {described(error)}")
