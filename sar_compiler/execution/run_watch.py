"""The properties for which a run of `sar-run` is watched: what breaks one, or contradicts what its proof assumes, is an alarm."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.trees import BehaviourTree

from sar_compiler.analysis.property_watch import AlarmCause, WatchAlarm
from sar_compiler.analysis.tree_analysis import watch_tree
from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError
from sar_compiler.execution.run_setup import RunSetup
from sar_compiler.journal.journal_entries import (
    ASSUMPTION_FAILED,
    PROPERTIES_OWED,
    PROPERTIES_WATCHED,
    PROPERTY_BROKEN,
    CommandAuthor,
)
from sar_compiler.missions.mission import Verb, VerbError
from sar_compiler.ros.clock import mission_clock
from sar_compiler.ros.engine import Engine, error_text, tell
from sar_compiler.ros.run_extension import RunExtension, UnfitLeavesError
from sar_compiler.runtime.answers import DeclaredAnswers
from sar_compiler.runtime.leaf_ear import hear
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.showing import in_one_line

TELL = "tell"
"""What is done in any case where a property is broken."""

_ROLES: Mapping[str, Literal["hold", "stop"]] = {"hold": "hold", "abort": "stop"}
# How long an order may wait for its service, which may not have been found yet; seconds of the steady clock.
_PATIENCE_SEC = 3.0


class _DueOrder(NamedTuple):
    """An order that a broken property gives.

    Attributes:
        about: The property.
        event: What has broken it, in words.
        verb: What is ordered.
        since: When it was to be given, seconds of the steady clock.
    """

    about: str
    event: str
    verb: Verb
    since: float


class _PropertyOrders:
    """What is ordered where a property is broken, by the mission's own verbs.

    Args:
        run: The run.
        if_broken: What is done, by the property.

    Raises:
        SarError: If the mission has no such order.
    """

    def __init__(self, run: RunSetup, if_broken: Mapping[str, str]) -> None:
        self._node, self._logger = run.node, run.node.get_logger()
        self._verbs: dict[str, Verb] = {}
        self._due: list[_DueOrder] = []
        known = {verb.role: verb for verb in run.mission.verbs()}
        for name, wanted in if_broken.items():
            if wanted == TELL:
                continue
            if _ROLES[wanted] not in known:
                raise SarError(
                    f"--properties: '{name}' says if_broken: {wanted}, and this mission has no such order; write tell"
                )
            self._verbs[name] = known[_ROLES[wanted]]
        if self._verbs:
            from sar_compiler.execution.verb_calls import VerbCalls

            used = list({verb.name: verb for verb in self._verbs.values()}.values())
            self._calls: VerbCalls = VerbCalls(run.node, used, run.orders.sign)

    def require(self) -> None:
        """Check that leaves of the tree heed what may be ordered.

        Raises:
            UnfitLeavesError: If one is missing.
        """
        node = self._node
        services = {service.service_name for service in node.services}
        for about, verb in self._verbs.items():
            if node.resolve_service_name(f"~/{verb.name}") not in services:
                raise UnfitLeavesError(
                    f"--properties: if '{about}' is broken, '{verb.name}' is to be ordered, and no node of this tree heeds that: "
                    "write if_broken: tell, or run a tree that does"
                )

    def order(self, about: str, event: str) -> None:
        """Order what is done where a property is broken by an event, if that is anything."""
        if about in self._verbs:
            self._due.append(_DueOrder(about, event, self._verbs[about], time.monotonic()))

    def give_due(self) -> None:
        """Give the orders that are due; a service that is not found yet is waited for."""
        due, self._due = self._due, []
        for order in due:
            try:
                author = CommandAuthor(f"the property '{order.about}'", f"violated by {order.event}")
                answer = self._calls.give(order.verb.name, {}, author)
            except VerbError as error:  # noqa: PERF203 - one of a few
                if time.monotonic() - order.since < _PATIENCE_SEC:
                    self._due.append(order)
                else:
                    self._say_refused(order, str(error))
            else:
                answer.add_done_callback(partial(self._take_answer, order))

    def _take_answer(self, order: _DueOrder, answer: Future[tuple[bool, str]]) -> None:
        error = answer.exception()
        accepted, said = answer.result() if error is None else (False, str(error))
        if not accepted:
            self._say_refused(order, said)

    def _say_refused(self, order: _DueOrder, why: str) -> None:
        self._logger.error(
            in_one_line(
                f"'{order.verb.label}', because '{order.about}' is broken, was not carried out: {why}"
            )
        )


class RunWatch(RunExtension):
    """Watches a run, and raises the alarms in its journal, from which everybody has them who shows the run.

    Args:
        run: The run.
    """

    def __init__(self, run: RunSetup) -> None:
        self._run, self._logger = run, run.node.get_logger()
        self._leaves: dict[int, Behaviour] = {}
        self._answers: dict[int, DeclaredAnswers] = {}
        self._remembered = 0
        self._added: Mapping[str, int] = {}
        self._began = 0.0
        # Whether nothing is heard any more, and why, if that is a failure.
        self._is_over, self._failure = False, ""

    def on_compiled(self, tree: CompiledTree, engine: Engine) -> None:
        """Hear the leaves of the tree from now on.

        Raises:
            TreeError: If the file makes no sense for the tree.
            SarError: If the tree cannot be watched, or the mission has no such order as a property gives.
        """
        options = self._run.options
        given = options.properties
        clock = mission_clock(self._run.node)
        self._now = lambda: clock.now() - self._began
        self._watch = watch_tree(
            self._run.loaded,
            tree,
            given if isinstance(given, Path) else None,
            facts={**self._run.mission.facts(), **self._run.mission.limits()},
            parameters=self._run.values,
            tree_id=options.tree_id,
            clock=self._now,
        )
        # Of a mission that goes on, the facts at the start have them already.
        self._added = self._run.mission.facts_added()
        approval = self._run.approval
        if approval is not None and given is not True and self._watch.file is not None:
            approval.require_properties(self._watch.file.document.source)
        self._orders = _PropertyOrders(self._run, self._if_broken)
        declared = tree.origins.declared_answers()
        for number, behaviour in enumerate(pre_order(tree.root)):
            if behaviour.id in declared and not behaviour.children:
                self._leaves[number] = behaviour
                self._answers[number] = DeclaredAnswers(declared[behaviour.id])
                hear(behaviour, number, self)
        engine.add_post_tick_handler(self._end_tick)

    @property
    def _if_broken(self) -> Mapping[str, str]:
        said = {} if self._watch.file is None else self._watch.file.if_broken
        return {
            name: said[name].text or TELL if name in said else TELL for name in self._watch.properties.names
        }

    def on_begin(self) -> None:
        """Say in the journal for what the run is watched."""
        self._began = mission_clock(self._run.node).now()
        properties = [{"name": name, "if_broken": done} for name, done in self._if_broken.items()]
        left_out = [each.name for each in self._watch.properties.left_out]
        place = "" if self._watch.file is None else str(Path(self._watch.file.document.source.path).resolve())
        journal = self._run.journal
        journal.watch(PROPERTIES_WATCHED, file=place, properties=properties, left_out=left_out)

    def on_setup(self) -> None:
        """Check that the leaves heed what may be ordered."""
        self._orders.require()

    def looks(self, number: int) -> None:
        """Be told that a leaf is about to do something."""
        self._hear(self._take_commands)
        self._hear(self._watch.looks, number)

    def _take_commands(self) -> None:
        """Take what commands have added to the facts since the last event."""
        added = self._run.mission.facts_added()
        for name, count in added.items():
            if count != self._added.get(name, 0):
                self._watch.raise_fact(name, count - self._added.get(name, 0))
        self._added = added

    def starts(self, number: int) -> None:
        """Be told that a leaf starts."""
        self._hear(self._watch.starts, number)

    def answers(self, number: int, status: str) -> None:
        """Be told what a leaf has answered."""
        self._hear(self._take_answer, number, status)

    def _take_answer(self, number: int, status: str) -> None:
        said = getattr(self._leaves[number], "answer_label", "")
        self._watch.answers(number, status, self._answers[number].label(status, said))

    def halts(self, number: int) -> None:
        """Be told that a leaf was halted."""
        self._hear(self._watch.halts, number)

    def on_last_tick(self, *, is_over: bool) -> None:
        """Judge the end of the run; that the tree is stopped then is none of its events."""
        self._hear(partial(self._watch.conclude, is_over=is_over))
        self._is_over = True

    def _hear(self, take: "Callable[..., object]", *what: object) -> None:
        """Have something taken, and tell what is wrong; who only watches ends no mission."""
        if self._is_over:
            return
        try:
            take(*what)
            self._tell()
        except Exception as error:  # noqa: BLE001
            self._is_over, self._failure = True, error_text(error)
            tell(self._run.node, f"The run is watched for properties no more: {self._failure}", error)

    def verdicts(self) -> dict[str, str]:
        """Return what became of each property: `kept`, `owed` (nobody can say yet) or `broken`; `unknown` where the watch has failed."""
        watch = self._watch
        if self._failure:
            return {name: "broken" if name in watch.broken else "unknown" for name in watch.properties.names}
        owed = dict.fromkeys(watch.owed, "owed")
        broken = dict.fromkeys(watch.broken, "broken")
        return {**dict.fromkeys(watch.properties.names, "kept"), **owed, **broken}

    def in_words(self) -> str:
        """Return what became of the properties, as a line of a summary."""
        verdicts = self.verdicts()
        parts = []
        for word, text in (("broken", "broken"), ("owed", "still owed"), ("unknown", "unknown")):
            names = [name for name, verdict in verdicts.items() if verdict == word]
            if names:
                parts.append(f"{len(names)} {text} ({'; '.join(names)})")
        count = "1 property" if len(verdicts) == 1 else f"{len(verdicts)} properties"
        return f"Watched for {count}: {', '.join(parts) or 'none was broken'}."

    def _end_tick(self, tree: BehaviourTree) -> None:
        self._hear(self._take_end, "SKIPPED" if was_skipped(tree.root) else tree.root.status.value)

    def _take_end(self, root: str) -> None:
        self._watch.end_tick(root)
        if self._watch.remembered != self._remembered:
            self._remembered = self._watch.remembered
            self._run.journal.watch(PROPERTIES_OWED, owed=self._watch.owed)
        self._orders.give_due()

    def _tell(self) -> None:
        if not self._watch.alarms:
            return
        alarms, self._watch.alarms = self._watch.alarms, []
        for alarm in alarms:
            self._logger.error(in_one_line(alarm.text))
            self._note(alarm)
            if alarm.cause.is_broken:
                self._orders.order(alarm.about, alarm.event or "the end of the run")

    def _note(self, alarm: WatchAlarm) -> None:
        run = [list(event) for event in alarm.run]
        place = {"event": alarm.event, "tick": alarm.tick, "node": alarm.number, "run": run}
        if alarm.cause.is_broken:
            owed = alarm.cause is AlarmCause.OWED
            self._run.journal.raise_alarm(
                alarm.text, PROPERTY_BROKEN, property=alarm.about, owed=owed, **place
            )
        else:
            self._run.journal.raise_alarm(alarm.text, ASSUMPTION_FAILED, assumption=alarm.about, **place)
