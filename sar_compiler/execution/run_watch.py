"""The runtime monitor of a run: violated properties and violated assumptions raise alarms."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.trees import BehaviourTree

from sar_compiler.analysis.runtime_monitor import AlarmCause, WatchAlarm
from sar_compiler.analysis.tree_analysis import watch_tree
from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.execution.leaf_listener import listen_to_leaf
from sar_compiler.execution.run_setup import RunSetup
from sar_compiler.journal.journal_entries import (
    ASSUMPTION_FAILED,
    PROPERTIES_OWED,
    PROPERTIES_WATCHED,
    PROPERTY_BROKEN,
    CommandAuthor,
)
from sar_compiler.missions.mission import CommandError, OperatorCommand
from sar_compiler.ros.clock import mission_clock
from sar_compiler.ros.engine import Engine, error_text, log_error
from sar_compiler.ros.run_extension import RunExtension, UnfitLeavesError
from sar_compiler.runtime.outcomes import DeclaredOutcomes
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.display_text import escape_to_one_line

TELL = "tell"
"""The default reaction to a violated property: the run raises an alarm and sends no command."""

_ROLES: Mapping[str, Literal["hold", "stop"]] = {"hold": "hold", "abort": "stop"}
# Maximum wait, in seconds of the steady clock, until the service of a command is discovered.
_PATIENCE_SEC = 3.0


class _DueCommand(NamedTuple):
    """A command to send because a property was violated.

    Attributes:
        about: The property's name.
        event: The event that violated the property, in words.
        verb: The command.
        since: The time of the violation, in seconds of the steady clock.
    """

    about: str
    event: str
    verb: OperatorCommand
    since: float


class _PropertyReactions:
    """Sends the mission's commands when properties are violated.

    Args:
        run: The run before its tree is compiled.
        if_broken: The reaction to a violation of each property, by property name.

    Raises:
        SarError: If the mission does not have a command that a reaction requires.
    """

    def __init__(self, run: RunSetup, if_broken: Mapping[str, str]) -> None:
        self._node, self._logger = run.node, run.node.get_logger()
        self._verbs: dict[str, OperatorCommand] = {}
        self._due: list[_DueCommand] = []
        known = {verb.role: verb for verb in run.mission.verbs()}
        for name, wanted in if_broken.items():
            if wanted == TELL:
                continue
            if _ROLES[wanted] not in known:
                raise SarError(
                    f"--properties: '{name}' has `if_broken: {wanted}`, but this mission has no such command. "
                    "Write `if_broken: tell`"
                )
            self._verbs[name] = known[_ROLES[wanted]]
        if self._verbs:
            from sar_compiler.execution.command_client import CommandClient

            used = list({verb.name: verb for verb in self._verbs.values()}.values())
            self._calls: CommandClient = CommandClient(run.node, used, run.orders.sign)

    def require(self) -> None:
        """Check that the tree has a leaf for each command that a reaction can send.

        Raises:
            UnfitLeavesError: If no leaf executes one of the commands.
        """
        node = self._node
        services = {service.service_name for service in node.services}
        for about, verb in self._verbs.items():
            if node.resolve_service_name(f"~/{verb.name}") not in services:
                raise UnfitLeavesError(
                    f"--properties: '{about}' has `if_broken: {verb.name}`, but no node of this tree executes "
                    "that command. Write `if_broken: tell`, or add such a node to the tree"
                )

    def schedule(self, about: str, event: str) -> None:
        """Schedule the command that reacts to a violated property; do nothing if the reaction is only an alarm."""
        if about in self._verbs:
            self._due.append(_DueCommand(about, event, self._verbs[about], time.monotonic()))

    def send_due(self) -> None:
        """Send each scheduled command whose service is available, and keep the other commands for a later attempt."""
        due, self._due = self._due, []
        for command in due:
            try:
                author = CommandAuthor(f"the property '{command.about}'", f"violated by {command.event}")
                response = self._calls.send(command.verb.name, {}, author)
            except CommandError as error:  # noqa: PERF203 - at most a few commands
                if time.monotonic() - command.since < _PATIENCE_SEC:
                    self._due.append(command)
                else:
                    self._report_refusal(command, str(error))
            else:
                response.add_done_callback(partial(self._on_response, command))

    def _on_response(self, command: _DueCommand, response: Future[tuple[bool, str]]) -> None:
        error = response.exception()
        accepted, message = response.result() if error is None else (False, str(error))
        if not accepted:
            self._report_refusal(command, message)

    def _report_refusal(self, command: _DueCommand, why: str) -> None:
        self._logger.error(
            escape_to_one_line(
                f"the command '{command.verb.label}' was not executed after the property '{command.about}' was violated: {why}"
            )
        )


class PropertyWatch(RunExtension):
    """Monitors a run for violated properties and assumptions, and records each alarm in the journal.

    Args:
        run: The run before its tree is compiled.
    """

    def __init__(self, run: RunSetup) -> None:
        self._run, self._logger = run, run.node.get_logger()
        self._leaves: dict[int, Behaviour] = {}
        self._declared: dict[int, DeclaredOutcomes] = {}
        self._remembered = 0
        self._added: Mapping[str, int] = {}
        self._began = 0.0
        # Whether monitoring has ended, and the error if the monitor has failed.
        self._is_over, self._failure = False, ""

    def on_compiled(self, tree: CompiledTree, engine: Engine) -> None:
        """Start monitoring the leaves of the tree.

        Raises:
            TreeError: If the properties file does not fit the tree.
            SarError: If the tree cannot be monitored, or if a reaction needs a command that the mission does not have.
        """
        options = self._run.options
        given = options.properties
        clock = mission_clock(self._run.node)
        self._now = lambda: clock.now() - self._began
        self._watch = watch_tree(
            self._run.loaded,
            tree,
            given if isinstance(given, Path) else None,
            facts={**self._run.mission.initial_facts(), **self._run.mission.limits()},
            parameters=self._run.values,
            tree_id=options.tree_id,
            clock=self._now,
        )
        # A resumed mission's initial facts already include earlier commands.
        self._added = self._run.mission.added_facts()
        approval = self._run.approval
        if approval is not None and given is not True and self._watch.file is not None:
            approval.require_properties(self._watch.file.document.source)
        self._reactions = _PropertyReactions(self._run, self._if_broken)
        declared = tree.origins.declared_outcomes()
        for number, behaviour in enumerate(pre_order(tree.root)):
            if behaviour.id in declared and not behaviour.children:
                self._leaves[number] = behaviour
                self._declared[number] = DeclaredOutcomes(declared[behaviour.id])
                listen_to_leaf(behaviour, number, self)
        engine.add_post_tick_handler(self._end_tick)

    @property
    def _if_broken(self) -> Mapping[str, str]:
        written = {} if self._watch.file is None else self._watch.file.if_broken
        return {
            name: written[name].text or TELL if name in written else TELL
            for name in self._watch.properties.names
        }

    def on_begin(self) -> None:
        """Record the monitored properties in the journal."""
        self._began = mission_clock(self._run.node).now()
        properties = [{"name": name, "if_broken": reaction} for name, reaction in self._if_broken.items()]
        left_out = [each.name for each in self._watch.properties.left_out]
        place = "" if self._watch.file is None else str(Path(self._watch.file.document.source.path).resolve())
        journal = self._run.journal
        journal.record_observation(PROPERTIES_WATCHED, file=place, properties=properties, left_out=left_out)

    def on_setup(self) -> None:
        """Check that the tree has a leaf for each command that a violated property can send."""
        self._reactions.require()

    def on_before_event(self, number: int) -> None:
        """Apply the changes that commands have made to facts, before a leaf is started, updated or halted."""
        self._call_monitor(self._apply_commands)
        self._call_monitor(self._watch.on_before_event, number)

    def _apply_commands(self) -> None:
        """Apply the changes that operator commands have made to facts since the last event."""
        added = self._run.mission.added_facts()
        for name, count in added.items():
            if count != self._added.get(name, 0):
                self._watch.raise_fact(name, count - self._added.get(name, 0))
        self._added = added

    def on_start(self, number: int) -> None:
        """Handle the start of a leaf."""
        self._call_monitor(self._watch.on_start, number)

    def on_status(self, number: int, status: str) -> None:
        """Handle the status that a leaf returned."""
        self._call_monitor(self._process_status, number, status)

    def _process_status(self, number: int, status: str) -> None:
        label = getattr(self._leaves[number], "outcome_label", "")
        self._watch.on_status(number, status, self._declared[number].label(status, label))

    def on_halt(self, number: int) -> None:
        """Handle the halt of a running leaf."""
        self._call_monitor(self._watch.on_halt, number)

    def on_last_tick(self, *, is_over: bool) -> None:
        """Evaluate the properties at the end of the run, before the tree is halted."""
        self._call_monitor(partial(self._watch.conclude, is_over=is_over))
        self._is_over = True

    def _call_monitor(self, method: "Callable[..., object]", *arguments: object) -> None:
        """Pass an event to the monitor. If the monitor fails, log the error and stop monitoring; the mission continues."""
        if self._is_over:
            return
        try:
            method(*arguments)
            self._record_alarms()
        except Exception as error:  # noqa: BLE001
            self._is_over, self._failure = True, error_text(error)
            log_error(
                self._run.node,
                f"The properties are no longer monitored, because the monitor has failed: {self._failure}",
                error,
            )

    def verdicts(self) -> dict[str, str]:
        """Return the verdict of each property by name: `kept`, `owed` (undecided), `broken` or `unknown` (monitor failed)."""
        watch = self._watch
        if self._failure:
            return {name: "broken" if name in watch.broken else "unknown" for name in watch.properties.names}
        owed = dict.fromkeys(watch.pending_properties, "owed")
        broken = dict.fromkeys(watch.broken, "broken")
        return {**dict.fromkeys(watch.properties.names, "kept"), **owed, **broken}

    def summary_text(self) -> str:
        """Return a line with the verdicts for the run's summary."""
        verdicts = self.verdicts()
        parts = []
        for word, text in (("broken", "violated"), ("owed", "undecided"), ("unknown", "unknown")):
            names = [name for name, verdict in verdicts.items() if verdict == word]
            if names:
                parts.append(f"{len(names)} {text} ({'; '.join(names)})")
        count = "1 property" if len(verdicts) == 1 else f"{len(verdicts)} properties"
        return f"Monitored {count}: {', '.join(parts) or 'none violated'}."

    def _end_tick(self, tree: BehaviourTree) -> None:
        self._call_monitor(self._process_end, "SKIPPED" if was_skipped(tree.root) else tree.root.status.value)

    def _process_end(self, root: str) -> None:
        self._watch.end_tick(root)
        if self._watch.state_number != self._remembered:
            self._remembered = self._watch.state_number
            self._run.journal.record_observation(PROPERTIES_OWED, owed=self._watch.pending_properties)
        self._reactions.send_due()

    def _record_alarms(self) -> None:
        if not self._watch.alarms:
            return
        alarms, self._watch.alarms = self._watch.alarms, []
        for alarm in alarms:
            self._logger.error(escape_to_one_line(alarm.sentence))
            self._record_alarm(alarm)
            if alarm.cause.is_broken:
                self._reactions.schedule(alarm.about, alarm.event or "the end of the run")

    def _record_alarm(self, alarm: WatchAlarm) -> None:
        run = [list(event) for event in alarm.run]
        location = {"event": alarm.event, "tick": alarm.tick, "node": alarm.number, "run": run}
        if alarm.cause.is_broken:
            owed = alarm.cause is AlarmCause.OWED
            self._run.journal.raise_alarm(
                alarm.sentence, PROPERTY_BROKEN, property=alarm.about, owed=owed, **location
            )
        else:
            self._run.journal.raise_alarm(
                alarm.sentence, ASSUMPTION_FAILED, assumption=alarm.about, **location
            )
