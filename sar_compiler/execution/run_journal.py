"""The journal of a run of `sar-run`. Modules that are only needed to write a journal are imported at their first use."""

import shlex
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.compiler import CompiledTree
from sar_compiler.execution.journal_start import JournalStart, default_path, has_journal_by_default
from sar_compiler.execution.run_options import RunOptions
from sar_compiler.journal.errors import JournalPlaceError
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import FACTS_LOST
from sar_compiler.journal.refused_start import forget_refusal
from sar_compiler.json_values import json_data
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.nodes.palettes import is_palette_name
from sar_compiler.project.command_line_settings import CommandLineSettings
from sar_compiler.ros.run_extension import RunExtension

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.ros.engine import Engine


class RunJournal(RunExtension):
    """The journal of a run: written to a file, kept in memory for listeners, or switched off.

    Args:
        start: The start of the run.
        mission: The mission; None for a tree without a mission.
        node: The run's node.
        path: The tree file.

    Attributes:
        replay_hint: A sentence with the command that replays a simulation; empty for other runs.
        journal: The journal. Listeners can be added immediately; `on_begin` opens the journal's file.

    Raises:
        JournalError: If the journal exists and this run must not write to it.
    """

    def __init__(self, start: JournalStart, mission: Mission | None, node: "Node", path: Path) -> None:
        self._start, self._node, self._mission = start, node, mission
        options = start.options
        self.journal = _open(options, mission, node)
        self._about: dict[str, object] = {"mission": mission.name if mission is not None else None}
        self._about["simulated"] = options.sim is not None
        # When the process of a simulation ends, only the journal remains.
        is_simulation_kept = options.sim is not None and self.journal.is_kept
        replay = f"sar-journal replay {shlex.quote(str(self.journal.path))}"
        self.replay_hint = f"To replay it: {replay}" if is_simulation_kept else ""
        self._run_about: dict[str, object] = {
            "version": version("sar_compiler"),
            "node": node.get_fully_qualified_name(),
            "tree_file": str(path.resolve()),
            "options": _node_options(options.additions),
            "command": [*options.command],
        }
        if options.supervision.deaths:
            self._run_about["after"] = options.supervision.deaths[-1]

    def attach_mission(self, run: MissionRun, parameters: Mapping[str, object]) -> None:
        """Apply the events of earlier runs to a mission, and record the mission's events from now on.

        Raises:
            ParameterError: If the parameters identify a different mission.
            JournalError: If the journal contains events of a different mission.
        """
        if self.journal.is_wanted:
            self._identify(run, parameters)
        # The mission needs the journal even if it has no reader, because the mission may display the times of events.
        if self._mission is not None:
            run.use_journal(self.journal)

    def _identify(self, run: MissionRun, parameters: Mapping[str, object]) -> None:
        """Record the mission's identity, or check it when a mission resumes."""
        from sar_compiler.execution.resume_checks import require_same_identity

        self._run_about["parameters"] = json_data(parameters)
        self._about["identity"] = json_data(run.identity())
        if self.journal.is_resumed:
            require_same_identity(self.journal, self._about)
            facts = len(self.journal.earlier_events())
            self._node.get_logger().info(f"The mission in {self.journal.path} resumes after {facts} events.")
            self._report_lost_events()
        if self._mission is not None:
            self._run_about["facts"] = json_data({**run.initial_facts(), **run.limits()})

    def _report_lost_events(self) -> None:
        if count := sum(
            int(fact.data.get("count", 0))
            for fact in self.journal.earlier_events()
            if fact.kind == FACTS_LOST
        ):
            self._node.get_logger().warning(
                f"{count} events were lost because the journal could not be written. The mission repeats work that only these events had "
                f"recorded. Numbers that were in use are not assigned again."
            )

    def on_compiled(self, tree: CompiledTree, engine: "Engine") -> None:
        """Record the tree of the run, or compare it with the journal's tree when a mission resumes.

        Raises:
            TreeError: If the journal's tree differs.
        """
        if not self.journal.is_wanted:
            return
        from sar_compiler.execution.resume_checks import require_same_tree
        from sar_compiler.views.run_tree import describe_tree

        about, run_about = describe_tree(tree)
        self._about |= about
        self._run_about |= run_about
        if self.journal.is_resumed:
            require_same_tree(self.journal, tree, about["tree"])
        self._tree, self._engine = tree, engine

    def on_begin(self) -> None:
        """Open the journal's file.

        Raises:
            JournalError: If the file cannot be written.
        """
        from sar_compiler.ros.clock import mission_clock

        self.journal.clock = mission_clock(self._node)
        self._start.has_begun = True
        forget_refusal(self.journal.path)
        if not self.journal.is_wanted:
            self.journal.begin({}, {})
            return
        from sar_compiler.journal.status_watch import StatusWatch
        from sar_compiler.ros.orphaned_goals import record_goals
        from sar_compiler.ros.robot_observer import RobotObserver

        logger = self._node.get_logger()
        self.journal.on_failure, self.journal.on_recovery = logger.error, logger.info
        self.journal.begin(self._about, self._run_about)
        if self.journal.aside is not None:
            logger.info(f"The previous journal is kept as {self.journal.aside}.")
        record_goals(self._node, self.journal)
        outcomes = self._tree.origins.declared_outcomes()
        self._engine.add_visitor(StatusWatch(self._tree.root, self.journal, outcomes, logger.warning))
        RobotObserver(self._node, self.journal)  # the node stores a reference

    def on_end(self, *, has_begun: bool) -> None:  # noqa: ARG002 - a run that has not started leaves no file
        """Close the journal's file."""
        self.journal.close()


def _node_options(additions: CommandLineSettings) -> list[list[str]]:
    """Return the command-line options that define the available nodes, with absolute paths."""
    models = [str(each) if is_palette_name(str(each)) else str(each.resolve()) for each in additions.models]
    return [
        *(["--nodes", str(each)] for each in additions.nodes),
        *(["--model", each] for each in models),
        *(["--include-path", str(each.resolve())] for each in additions.include_path),
    ]


def _open(options: RunOptions, mission: Mission | None, node: "Node") -> Journal:
    is_requested = options.journal is not None or options.resume or options.new or options.keeps_journal
    if options.no_journal or options.check or not (is_requested or has_journal_by_default(options, mission)):
        return Journal()
    from sar_compiler.journal.journal_opening import open_journal

    place = options.journal or default_path(options, node.get_fully_qualified_name())
    is_named = options.journal is not None
    try:
        return open_journal(place, resume=options.resume, start_over=options.new, is_named=is_named)
    except JournalPlaceError as error:
        if is_requested:
            raise
        node.get_logger().warning(f"No journal is written, so this mission cannot be resumed: {error}")
        return Journal()
