"""Those outside who watch a run of `sar-run`; what they take is imported only where they are asked for."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import TYPE_CHECKING

from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.missions.mission import MissionRun

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.cli.run import Options
    from sar_compiler.cli.run_journal import RunJournal
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.monitoring.groot2_publisher import Groot2Publisher
    from sar_compiler.ros.engine import Engine
    from sar_compiler.ros.mission_publisher import MissionPublisher


class RunWatchers:
    """Those who watch a run.

    Args:
        options: The options of the command line.
        node: The run's node.
        stack: Ends what they have begun.
    """

    def __init__(self, options: "Options", node: "Node", stack: ExitStack) -> None:
        self._options, self._node, self._stack = options, node, stack
        self._publisher: MissionPublisher | None = None
        self._groot2: Groot2Publisher | None = None

    def take(self, entry: "JournalEntry") -> None:
        """Take an entry of the run's journal."""
        if self._publisher is not None:
            self._publisher.take(entry)

    def show(self, tree: CompiledTree, mission: MissionRun) -> None:
        """Take the tree that is to be run, and its mission.

        Raises:
            SarError: If somebody cannot be shown it.
        """
        if self._options.publish and not self._options.check:
            from sar_compiler.monitoring.numbered_tree import NumberedTree
            from sar_compiler.ros.mission_publisher import MissionPublisher

            numbered = NumberedTree(tree)
            self._publisher = MissionPublisher(self._node, numbered, mission.landmarks, mission.figures)
        if self._options.groot2 is not None:
            self._groot2 = self._stack.enter_context(closing(self._published(tree, self._options.groot2)))

    def _published(self, tree: CompiledTree, port: int) -> "Groot2Publisher":
        from sar_compiler.monitoring.groot2_publisher import Groot2PortError, Groot2Publisher

        hooks, tell = self._options.groot2_hooks, self._node.get_logger().warning
        try:
            return Groot2Publisher(tree, port, hooks=hooks, tell=tell)
        except Groot2PortError as error:
            message = f"--groot2: {error}"
            raise SarError(message) from error

    def begin(self, engine: "Engine") -> None:
        """Watch what ticks the tree."""
        if self._groot2 is not None:
            self._groot2.watch(engine)
        if self._publisher is not None:
            self._publisher.watch(engine)

    def end(self) -> None:
        """Say how it has ended, after the end of the journal."""
        if self._publisher is not None:
            self._publisher.end()


@contextmanager
def open_watchers(options: "Options", node: "Node", journal: "RunJournal") -> Iterator[RunWatchers]:
    """Let those watch a run who are asked for on the command line."""
    with ExitStack() as stack:
        watchers = RunWatchers(options, node, stack)
        if options.publish and not options.check:
            journal.listen(watchers.take)
        yield watchers
