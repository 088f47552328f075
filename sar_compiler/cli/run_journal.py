"""The journal of a run of `sar-run`; what it takes is imported only where somebody has a use for it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.compiler import CompiledTree
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import FACTS_LOST, Ending
from sar_compiler.missions.mission import Mission, MissionRun

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.cli.run import Options
    from sar_compiler.ros.engine import Engine
    from sar_compiler.ros.readiness import Requirement


class RunJournal:
    """The journal of a run: kept in a file, listened to, or neither.

    Args:
        node: The run's node.
        journal: The journal.
        about: What the mission is, as far as the tree and the parameters do not say it.

    Attributes:
        journal: The journal. Who listens to it begins at once: what the run does only for those is decided as it goes on.
        context: The journal for the leaves that ask for it, by its type.
    """

    def __init__(self, node: "Node", journal: Journal, about: Mapping[str, object]) -> None:
        self._node = node
        self.journal = journal
        self._about = dict(about)
        self._run_about: dict[str, object] = {}
        self.context: dict[type, object] = {Journal: journal}

    def supervised_after(self, death: str) -> None:
        """Take how the run before has died, of which its supervisor knows."""
        self._run_about["after"] = death

    def keep_facts(self, run: MissionRun | None, parameters: Mapping[str, object]) -> None:
        """Let a mission take over the facts of earlier runs, and keep its own from now on.

        Raises:
            ParameterError: If the journal is of another mission by its parameters.
            JournalError: If the facts are not the mission's.
        """
        if not self.journal.is_wanted:
            return
        from sar_compiler.missions.resuming import as_data, require_same_identity

        self._run_about["parameters"] = as_data(parameters)
        self._about["identity"] = as_data(run.identity()) if run is not None else {}
        if self.journal.is_resumed:
            require_same_identity(self.journal, self._about)
            facts = len(self.journal.facts())
            self._node.get_logger().info(f"The mission in {self.journal.place} goes on after {facts} facts.")
            self._tell_lost()
        if run is not None:
            self._run_about["facts"] = as_data(run.facts())
            run.keep_in(self.journal)

    def _tell_lost(self) -> None:
        if count := sum(
            int(fact.data.get("count", 0)) for fact in self.journal.facts() if fact.kind == FACTS_LOST
        ):
            self._node.get_logger().warning(
                f"{count} facts could not be written and are lost: what they tell of is done again, and the numbers that were "
                "given until then are not given again."
            )

    def describe(self, tree: CompiledTree, path: Path) -> None:
        """Take the tree that is run, and its file.

        Raises:
            TreeError: If the journal is of another tree.
        """
        if not self.journal.is_wanted:
            return
        from sar_compiler.missions.resuming import as_data, require_same_tree
        from sar_compiler.views.drawing import drawn_nodes
        from sar_compiler.views.outline import outline

        self._about["tree"] = nodes = as_data(outline(tree))
        self._run_about |= {
            "tree_file": str(path.resolve()),
            "tree_id": tree.instance.tree.name,
            "looks": [[each.shape.value, each.sign] for each in drawn_nodes(tree)],
        }
        if self.journal.is_resumed:
            require_same_tree(self.journal, tree, nodes)

    def left_goals(self) -> "list[Requirement]":
        """Return what must be so before the mission goes on: no goal of an earlier run is active; the caller closes it."""
        if not self.journal.is_resumed:
            return []
        from sar_compiler.ros.left_goals import LeftGoals

        return [LeftGoals(self._node, self.journal)]

    def begin(self, engine: "Engine", tree: CompiledTree) -> None:
        """Begin to write.

        Raises:
            JournalError: If the file cannot be written.
        """
        if not self.journal.is_wanted:
            return
        from importlib.metadata import version

        from sar_compiler.journal.status_watch import StatusWatch
        from sar_compiler.ros.clock import mission_clock
        from sar_compiler.ros.left_goals import note_goals
        from sar_compiler.ros.robot_observer import RobotObserver

        self.journal.clock = mission_clock(self._node)
        self.journal.on_failure = self._node.get_logger().error
        self.journal.on_recovery = self._node.get_logger().info
        run_about = {"version": version("sar_compiler"), "node": self._node.get_fully_qualified_name()}
        self.journal.begin(self._about, {**run_about, **self._run_about})
        if self.journal.aside is not None:
            self._node.get_logger().info(f"The journal that was there is kept as {self.journal.aside}.")
        note_goals(self._node, self.journal)
        warn, answers = self._node.get_logger().warning, tree.origins.declared_answers()
        engine.add_visitor(StatusWatch(tree.root, self.journal, answers, warn))
        RobotObserver(self._node, self.journal)  # the node keeps it

    def end(self, status: int, reason: str, *, is_over: bool = False, is_stopped: bool = False) -> None:
        """Write how the run has ended.

        Args:
            status: The exit status.
            reason: The reason in a sentence.
            is_over: Whether the mission has come to its end.
            is_stopped: Whether it was stopped by a signal; then it has not failed.
        """
        if self.journal.is_wanted:
            ending = Ending.OVER if is_over else Ending.STOPPED if is_stopped else Ending.FAILED
            self.journal.end(ending, status, reason)


@contextmanager
def open_run_journal(options: "Options", mission: Mission | None, node: "Node") -> Iterator[RunJournal]:
    """Open the journal that the command line asks for; it is closed at the end.

    Raises:
        JournalError: If there is one that this run must not write to.
    """
    journal = _opened(options, mission, node)
    about = {"mission": mission.name if mission is not None else None, "simulated": options.sim is not None}
    run_journal = RunJournal(node, journal, about)
    if options.supervision is not None and options.supervision.deaths:
        run_journal.supervised_after(options.supervision.deaths[-1])
    try:
        yield run_journal
    finally:
        journal.close()


def _opened(options: "Options", mission: Mission | None, node: "Node") -> Journal:
    asked = options.journal is not None or options.resume or options.new or options.supervise is not None
    by_itself = mission is not None and mission.is_resumable and options.sim is None
    if options.no_journal or options.check or not (asked or by_itself):
        return Journal()
    from sar_compiler.journal.errors import JournalPlaceError
    from sar_compiler.journal.opening import default_place, open_journal

    place = options.journal or default_place(node.get_fully_qualified_name())
    is_named = options.journal is not None
    try:
        return open_journal(place, resume=options.resume, anew=options.new, is_named=is_named)
    except JournalPlaceError as error:
        if asked:
            raise
        node.get_logger().warning(f"No journal is kept, so this mission cannot be resumed: {error}")
        return Journal()
