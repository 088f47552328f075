"""Those outside who watch a run of `sar-run`; what they take is imported only where they are asked for."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.missions.mission import MissionRun

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.cli.run import Options
    from sar_compiler.cli.run_report import RunReport
    from sar_compiler.cli.run_view import RunView
    from sar_compiler.journal.georeference import Georeference
    from sar_compiler.journal.journal import Journal
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.monitoring.groot2_publisher import Groot2Publisher
    from sar_compiler.ros.engine import Engine
    from sar_compiler.ros.mission_publisher import MissionPublisher
    from sar_compiler.ros.mission_recording import MissionRecording


class RunWatchers:
    """Those who watch a run.

    Args:
        options: The options of the command line.
        node: The run's node.
        journal: The run's journal.
        stack: Ends what they have begun.
        view: What is shown on standard output, if anything is.
        place: Where the map lies on the earth, if that is known.

    Raises:
        SarError: If there can be no recording, or no report.
        ImportError: If a library of a report is not installed.
    """

    def __init__(
        self,
        options: "Options",
        node: "Node",
        journal: "Journal",
        stack: ExitStack,
        view: "RunView | None",
        place: "Georeference | None",
    ) -> None:
        self._options, self._node, self._stack = options, node, stack
        self._view = view
        if view is not None:
            view.begin(journal.earlier())
            journal.listen(view.take)
        self._report = self._asked_for(options.report, place, journal)
        self._groot2: Groot2Publisher | None = None
        self._recording: MissionRecording | None = None
        self._publisher: MissionPublisher | None = None
        if options.record is not None:
            self._recording = self._opened(options.record)
            journal.listen(self._recording.take)
        if options.publish:
            # Now, because what is done for those who listen is decided before there is a tree to publish.
            journal.listen(self._publish)

    def _asked_for(
        self, files: Sequence[Path], place: "Georeference | None", journal: "Journal"
    ) -> "RunReport | None":
        if not files:
            return None
        from sar_compiler.cli.run_report import RunReport

        report = RunReport(files, place, journal.earlier())
        journal.listen(report.take)
        return report

    def _opened(self, path: Path) -> "MissionRecording":
        from sar_compiler.ros.mission_recording import MissionRecording, RecordingError

        try:
            return self._stack.enter_context(closing(MissionRecording(self._node, path)))
        except RecordingError as error:
            message = f"--record: {error}"
            raise SarError(message) from error

    def _publish(self, entry: "JournalEntry") -> None:
        if self._publisher is not None:
            self._publisher.take(entry)

    def _told(self) -> "Iterator[MissionPublisher | MissionRecording]":
        """Yield those who follow the journal."""
        yield from filter(None, (self._recording, self._publisher))

    def show(self, tree: CompiledTree) -> None:
        """Take the tree that is to be run.

        Raises:
            SarError: If somebody cannot be shown it.
        """
        if self._options.groot2 is not None:
            self._groot2 = self._stack.enter_context(closing(self._published(tree, self._options.groot2)))
        if self._options.publish or self._recording is not None:
            from sar_compiler.monitoring.numbered_tree import NumberedTree
            from sar_compiler.ros.mission_publisher import MissionPublisher

            numbered = NumberedTree(tree)
            if self._recording is not None:
                self._recording.show(numbered)
            if self._options.publish:
                self._publisher = MissionPublisher(self._node, numbered)

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
        for each in self._told():
            each.watch(engine)

    def refresh(self, now: float) -> None:
        """Show what is due; called all the time. *now* is the time of the mission's clock, in seconds."""
        view = self._view
        if view is None:
            return
        try:
            view.refresh(now)
        except Exception as error:  # noqa: BLE001 - who only watches must not end a mission
            self._view = None
            with suppress(Exception):  # the same again
                view.close()
            self._node.get_logger().error(f"The view has failed, and shows no more: {error!r}.")

    def leave_terminal(self) -> None:
        """Draw no more: what is printed now comes below what was shown."""
        if self._view is not None:
            self._try(self._view.close, "The view could not be closed")

    def end(self) -> None:
        """Report how the run has ended, after the end of the journal."""
        for each in self._told():
            self._try(each.end, "One who watches the mission could not say how it has ended")
        if self._report is not None:
            self._try(self._report.write, "The report could not be written")

    def _try(self, do: Callable[[], object], complaint: str) -> None:
        try:
            do()
        except Exception as error:  # noqa: BLE001 - who only watches must not end a mission, nor keep others from their end
            self._node.get_logger().error(f"{complaint}: {error!r}.")


@contextmanager
def open_watchers(
    options: "Options",
    node: "Node",
    journal: "Journal",
    mission: MissionRun | None,
    view: "RunView | None",
    place: "Georeference | None",
) -> Iterator[RunWatchers]:
    """Let those watch a run who are asked for on the command line.

    Raises:
        SarError: If there can be no recording, no page or no report.
        ImportError: If a library of a report is not installed.
    """
    with ExitStack() as stack:
        if options.view == "web":
            from sar_compiler.cli.run_page import serve_run

            stack.enter_context(serve_run(options.web_port, journal, node, mission))
        yield RunWatchers(options, node, journal, stack, view, place)
