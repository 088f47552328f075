"""Explains why a mission failed: by the leaf results that led to the FAILURE, or by the run's end."""

import itertools
import signal
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.journal.display import EventTime, Level
from sar_compiler.journal.journal_entries import (
    CHANGED,
    LEAF_RAISED,
    OF_ROBOT,
    RUN_BEGAN,
    STATUS,
    Ending,
    JournalEntry,
)
from sar_compiler.journal.mission_state import (
    FAILURE,
    RUNNING,
    SUCCESS,
    MissionState,
    NodeState,
    outcome_words,
)
from sar_compiler.journal.node_ends import OTHER_END, NodeEnds
from sar_compiler.journal.recorded_events import is_status
from sar_compiler.journal.status_line import COMPLETE, condition
from sar_compiler.runtime.clock import clock_text
from sar_compiler.runtime.events import Event
from sar_compiler.tree.display_text import escape_to_one_line, shorten
from sar_compiler.views.drawing import Shape

if TYPE_CHECKING:
    from sar_compiler.analysis.verify.counterfactual import Counterfactual

# A leaf is stalled if it was running at the end of the run, and had been running for at least this share of the run.
_STALLED_SHARE = 0.5
_SIGNAL_STATUS = 128
# The maximum number of earlier failures, and of changed outcomes, that are listed.
_MAX_LISTED = 12
_START = EventTime(1, 0.0, 0.0)


class NodeStatus(NamedTuple):
    """The status of a node, or an entry that stands for the end of the run itself.

    Attributes:
        node: The node's number; None for the run.
        name: The node's name.
        place: `file:line`; empty if the location is unknown.
        depth: The depth below the first node of the chain.
        status: The status.
        label: The label of a leaf's outcome; empty if several labels are possible, None if the leaf declares no labels.
        message: The message of the node.
        since: The time from which the node had the status.
    """

    node: int | None
    name: str
    place: str
    depth: int
    status: str
    label: str | None
    message: str
    since: EventTime | None


class FormerFailure(NamedTuple):
    """The earlier failures of a node that did not determine the result of the mission.

    The node is a leaf, or another node that has decided its own status.

    Attributes:
        first: The first failure.
        in_hand: The location at which the mission had last worked when the last failure occurred; empty if
            there is none.
        has_recovered: Whether the node has succeeded since the last failure.
        is_alternative: Whether the node was ticked, each time it failed, only because another branch had
            failed.
        has_led_elsewhere: Whether the parent had other children with which it could continue after a failure.
        times: The number of failures.
        last: The time of the last failure.
    """

    first: NodeStatus
    in_hand: str
    has_recovered: bool
    is_alternative: bool
    has_led_elsewhere: bool
    times: int
    last: EventTime


class CauseOfFailure(NamedTuple):
    """The causes of a mission's failure.

    Attributes:
        chain: The nodes from the root to the causes, each parent before its children; empty if the root has
            not failed.
        causes: The node results that caused the failure, the likeliest cause first.
        before: The earlier failures, by time.
        outcome: The result of the mission in a word, as in the mission's status line.
        reason: The reason for the result.
        said: The status line, with the result and the reason.
        ended: The time of the root's failure; None if the root has not failed.
        went_on: Whether the root has returned another status since its failure.
    """

    chain: tuple[NodeStatus, ...]
    causes: tuple[NodeStatus, ...]
    before: tuple[FormerFailure, ...]
    outcome: str
    reason: str
    said: str
    ended: EventTime | None
    went_on: bool = False

    @property
    def has_cause(self) -> bool:
        """Whether a cause can be reported, because the mission is not complete and a cause was found."""
        return self.likeliest is not None and self.outcome != COMPLETE

    @property
    def likeliest(self) -> NodeStatus | None:
        """The likeliest cause of the failure, or None if no cause was found."""
        return self.causes[0] if self.causes else None


class FailureAnalysis:
    """Finds out why the last run of a mission failed. Processes the entries of the journal one by one.

    A node's status is explained by the children that returned the same status or, below an inverting node,
    the opposite status. A status that no child explains is the node's own result. Examples are the results of
    leaves, time limits, scripts and loops without items. A condition only reports a state. If all causes are
    conditions, earlier failures are listed before these conditions, unless the tree was meant to fail in
    response to a condition.

    Attributes:
        state: The state of the mission after the last run's entries, without observations of the robot.
        failed_tick: The last tick in which the root failed; 0 if the root has never failed. Valid after a
            call of `find_cause`.
    """

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self.state = MissionState()
        self.failed_tick = 0
        self._kinds = _NodeKinds()
        self._history = self._history_then = _History(self._kinds)
        self._explained = _ExplainedFailure(self.state, self._kinds)
        self._raised: NodeStatus | None = None

    @classmethod
    def from_stream(cls, stream: Iterable[JournalEntry]) -> "FailureAnalysis":
        """Process all entries of a stream, and return the analysis."""
        analysis = cls()
        for entry in stream:
            analysis.add_entry(entry)
        return analysis

    @classmethod
    def with_state(cls, stream: Iterable[JournalEntry]) -> "tuple[FailureAnalysis, MissionState]":
        """Process the entries of all runs. Return the analysis of the last run, and the state of the mission."""
        analysis, state = cls(), MissionState()
        for entry in stream:
            if _is_status(entry, len(analysis.state.nodes)):
                analysis.add_status(entry)
            else:
                analysis.add_entry(entry)
                state.apply(entry)
        state.adopt_statuses(analysis.state)
        return analysis, state

    def add_entry(self, entry: JournalEntry) -> None:
        """Process a journal entry. When a run starts, the analysis starts over."""
        kind = entry.kind
        if kind == STATUS:
            if _is_status(entry, len(self.state.nodes)):
                self.add_status(entry)
        elif kind == RUN_BEGAN:
            self._begin()
            self.state.apply(entry)
            self._kinds = _NodeKinds.from_run_start(entry)
            self._history = self._history_then = _History(self._kinds)
            self._explained = _ExplainedFailure(self.state, self._kinds)
        elif self.state.runs and kind not in OF_ROBOT:
            self.state.apply(entry)
            if kind == LEAF_RAISED:
                self._raised = self._raised_status(entry)
            elif kind == CHANGED:
                self._history.add_change(self.state)

    def add_status(self, entry: JournalEntry) -> None:
        """Process a valid `status` entry."""
        if entry.data["tick"] != self._explained.tick:
            self._end_tick()
        node = self.state.take_status(entry)
        self._explained.add_status(entry, node)
        self._history.add_status(node)

    def _raised_status(self, entry: JournalEntry) -> NodeStatus | None:
        number, text = entry.data.get("node"), str(entry.data.get("text", ""))
        if not isinstance(number, int) or not 0 <= number < len(self.state.nodes):
            return _run_status("RAISED", text, self.state.now)
        node = self.state.nodes[number]
        return NodeStatus(number, node.name, node.location, 0, "RAISED", None, text, self.state.now)

    def _end_tick(self) -> None:
        has_failed = self._explained.end_tick()
        self._history.end_tick(self._explained, self.state)
        if has_failed:
            self.failed_tick, self._history_then = self._explained.tick, self._history.copy()

    def find_cause(self) -> CauseOfFailure:
        """Return the causes of the run's failure. All entries of the run must have been processed."""
        self._end_tick()
        explained = self._explained
        chain = explained.chain
        history = self._history_then if chain else self._history
        causes = sorted(explained.causes, key=lambda cause: self._rank_cause(cause, history))
        blamed = {cause.node for cause in causes}
        before = [each for each in history.earlier_failures() if each.first.node not in blamed]
        now = condition(self.state)
        is_meant_so = bool(causes) and causes[0].node in explained.triggers
        if now.word != COMPLETE and not is_meant_so and all(map(self._only_reports, causes)):
            former = [each for each in before if self._may_be_cause(each, only_missing=bool(chain))]
            former.sort(key=self._rank_failure)
            causes = [*(each.first for each in former), *causes]
        if now.word != COMPLETE:
            causes = self._add_run_end(causes, has_failed=bool(chain) and not explained.went_on)
        since = chain[0].since if chain else None
        said = now.to_line(self.state.now.time)
        return CauseOfFailure(
            chain, tuple(causes), tuple(before), now.word, now.reason, said, since, explained.went_on
        )

    def with_decisive_leaf(self, reasons: CauseOfFailure, change: "Counterfactual") -> CauseOfFailure:
        """Rank a leaf first if the mission would have succeeded with just one success of this leaf.

        A condition only reports a state, so it does not rank above a leaf that has failed.

        Args:
            reasons: The causes, as returned by `find_cause`.
            change: The smallest change that makes the mission succeed.
        """
        leaf = change.was.number
        cause = self._explained.last_end(leaf) if self._explained.has_ended(leaf) else None
        first = reasons.likeliest
        if (
            change.unusual
            or change.instead.status != SUCCESS
            or cause is None
            or cause.status != FAILURE
            or first is None
            or first.node is None
            or (
                leaf in self._kinds.conditions
                and first.node not in self._kinds.conditions | self._kinds.constant
            )
        ):
            return reasons
        causes = (cause, *(each for each in reasons.causes if each.node != leaf))
        before = tuple(each for each in reasons.before if each.first.node != leaf)
        return reasons._replace(causes=causes, before=before)

    def _only_reports(self, cause: NodeStatus) -> bool:
        """Return whether a cause only reports a state. Examples are conditions and constant alternatives."""
        return cause.node in self._kinds.conditions or (
            cause.node in self._kinds.constant and cause.node in self._explained.alternatives
        )

    def _rank_cause(self, cause: NodeStatus, history: "_History") -> tuple[object, ...]:
        # Alternatives are tried in order, so the latest cause is the likeliest.
        since = cause.since.time if cause.since else 0.0
        is_meant_so = cause.node in self._explained.responses
        tolerated, worked = cause.node in history.tolerated, cause.node in history.worked
        number = -1 if cause.node is None else cause.node
        # A success explains a failure only below a node that inverts it.
        is_turned = cause.status != FAILURE
        return is_meant_so, is_turned, self._only_reports(cause), tolerated, not worked, -since, -number

    def _may_be_cause(self, failure: FormerFailure, *, only_missing: bool) -> bool:
        """Return whether a failure after which the mission continued may still be the cause of the result.

        The failure of a condition may be the cause if another branch was ticked instead, and the location was
        abandoned.
        """
        if failure.first.node in self._kinds.conditions:
            return failure.has_led_elsewhere and _is_abandoned(self.state, failure)
        if failure.first.node in self._kinds.constant and failure.is_alternative:
            return False
        return not only_missing or _has_missing_item(self.state, failure)

    def _rank_failure(self, failure: FormerFailure) -> tuple[object, ...]:
        is_condition = failure.first.node in self._kinds.conditions
        return (
            not _has_missing_item(self.state, failure),
            failure.is_alternative,
            is_condition,
            failure.has_recovered,
            -failure.times,
        )

    def _add_run_end(self, causes: Sequence[NodeStatus], *, has_failed: bool) -> list[NodeStatus]:
        """Return the causes. Add the end of the run as a cause if the result of the root did not end the run."""
        run = self.state.runs[-1] if self.state.runs else None
        if self._raised is not None:
            return [self._raised, *causes]
        if run is None or has_failed or not (run.ending or self.state.process.is_gone):
            return list(causes)
        if not run.ending:
            killed = "the process of the run was killed or crashed without recording the end of the run"
            return [_run_status("KILLED", killed, self.state.now), *causes]
        if run.ending == Ending.STOPPED.value:
            is_by_signal = (run.status or 0) > _SIGNAL_STATUS
            cause = f"by {_signal_name(run.status)}" if is_by_signal or not run.reason else run.reason
            return [_run_status("STOPPED", cause, run.ended), *causes]
        ended = _run_status("ENDED", run.reason, run.ended)
        if any(cause.status == FAILURE for cause in causes):
            return [*causes, ended]
        return [*self._stalled_leaf(), ended]

    def _stalled_leaf(self) -> list[NodeStatus]:
        """Return the leaves that were running for most of the run, preceded by the results that led to them."""
        run, now, ends = self.state.runs[-1], self.state.now.wall, self._explained.ends
        # A journal does not record the end of a run on the mission's clock.
        enough = _STALLED_SHARE * (now - run.began.wall)
        running = [node for node in self.state.nodes if not node.children and ends.is_running(node.number)]
        long = [node for node in running if node.status_time and now - node.status_time.wall > enough]
        earlier = [
            self._explained.last_end(number)
            for node in long
            for number in self._explained.results_leading_to(node.number)
        ]
        return [*earlier, *(_status_of(node) for node in long)]


def _tree_entries(stream: Iterable[JournalEntry]) -> Iterator[JournalEntry]:
    """Yield the entries of a run, except observations from the robot's topics and invalid statuses."""
    count = 0
    for entry in stream:
        if entry.kind == RUN_BEGAN:
            count = len(MissionState.from_stream([entry]).nodes)
        if _is_status(entry, count) if entry.kind == STATUS else entry.kind not in OF_ROBOT:
            yield entry


def _is_status(entry: JournalEntry, count: int) -> bool:
    """Return whether an entry is a valid and complete `status` entry for a tree with *count* nodes."""
    return is_status(entry, count) and "message" in entry.data


class _NodeKinds(NamedTuple):
    """The kinds and time limits of a tree's nodes, which the journal records at the start of a run.

    Attributes:
        conditions: The numbers of the leaves that only report a state.
        constant: The numbers of the leaves that always return the same status.
        parallel: The numbers of the controls that tick their children together.
        limits: The time limits of nodes in seconds, by node number.
    """

    conditions: frozenset[int] = frozenset()
    constant: frozenset[int] = frozenset()
    parallel: frozenset[int] = frozenset()
    limits: Mapping[int, float] = {}

    @classmethod
    def from_run_start(cls, began: JournalEntry) -> "_NodeKinds":
        """Return the kinds and limits that the entry for the start of a run contains. Ignore invalid data."""
        about = began.data.get("run")

        def value(name: str, kind: type) -> Any:
            found = about.get(name) if isinstance(about, Mapping) else None
            return found if isinstance(found, kind) else kind()

        looks = value("looks", list)

        def with_shape(shape: Shape) -> frozenset[int]:
            return frozenset(
                n for n, each in enumerate(looks) if each in ([shape.value, ""], [shape.value, "⇉"])
            )

        constant = frozenset(each for each in value("constant", list) if isinstance(each, int))
        limits = {
            int(number): float(limit)
            for number, limit in value("limits", dict).items()
            if str(number).isdecimal() and isinstance(limit, int | float)
        }
        return cls(with_shape(Shape.CONDITION), constant, with_shape(Shape.PARALLEL), limits)


class _ExplainedFailure:
    """Explains the last FAILURE of the root of a tree.

    Args:
        state: The state of the mission; each entry must be applied to the state before it is passed to this
            object.
        kinds: The properties of the nodes.

    Attributes:
        ends: The explanations of all nodes that have ended.
        chain: The nodes that explain the failure, from the root down; empty if the root has never failed.
        causes: The results in `chain` that no child explains.
        alternatives: The numbers of the causes whose nodes were ticked only because another branch had
            failed.
        responses: The alternatives with a constant status, which are meant to fail.
        triggers: The numbers of the results to which `responses` respond.
    """

    def __init__(self, state: MissionState, kinds: _NodeKinds) -> None:
        self.ends = NodeEnds(state.nodes)
        self.chain: tuple[NodeStatus, ...] = ()
        self.causes: tuple[NodeStatus, ...] = ()
        self.alternatives = self.responses = self.triggers = frozenset[int]()
        self._state, self._kinds = state, kinds
        # For each node that has ended: its status, label and message, and the first entry with them.
        self._last: dict[int, tuple[str, str | None, str, JournalEntry]] = {}
        self._own: set[int] = set()  # the nodes that have decided their last end themselves

    @property
    def tick(self) -> int:
        """The number of the tick whose entries are being processed."""
        return self.ends.tick

    @property
    def went_on(self) -> bool:
        """Whether the root has had another status since its last failure."""
        return bool(self.chain) and self.ends.status.get(0) != FAILURE

    def add_status(self, entry: JournalEntry, node: NodeState) -> None:
        """Process a recorded status of a node."""
        self.ends.receive(entry.data, entry.time)
        if node.status in OTHER_END:
            self._last[node.number] = node.status, node.label, node.message, node.changed or entry
            self._own.discard(node.number)

    def end_tick(self) -> bool:
        """End a tick. Return whether the root has failed in this tick or before, and was not reset since."""
        self.ended = self.ends.end_tick()
        for number in self.ended:
            if not self.ends.causes[number] and not self._has_expired(number):
                self._own.add(number)
        if self.ends.has_failed:
            self._explain()
        return self.ends.has_failed

    def last_end(self, number: int) -> NodeStatus:
        """Return the most recent SUCCESS or FAILURE of a node.

        If no child explains it, add the node's own reason to the message.
        """
        node = self._state.nodes[number]
        status, label, message, changed = self._last[number]
        if number in self._own:
            message = self._reason(node, status, message)
        return NodeStatus(number, node.name, node.location, 0, status, label, message, node.time_of(changed))

    def has_ended(self, number: int) -> bool:
        """Return whether a node has ended at least once."""
        return number in self._last

    def _has_expired(self, number: int) -> bool:
        """Return whether a node has failed because a time limit expired.

        If so, set the node's message accordingly.
        """
        limit = self._kinds.limits.get(number)
        if limit is None or not self._state.nodes[number].children:
            return False
        status, label, _, changed = self._last[number]
        if status != FAILURE:
            return False
        names = [self._state.nodes[each].name for each in self.ends.halted if self._is_below(each, number)]
        leaves = f" while {' and '.join(names)} ran" if names else ""
        self._last[number] = status, label, f"its time limit of {limit:g} s expired{leaves}", changed
        self._own.discard(number)
        return True

    def _reason(self, node: NodeState, status: str, message: str) -> str:
        """Return a node's message.

        Add the value of an attribute that it names, or the result of a condition's code.
        """
        for name, value in node.attributes.items():
            if message.endswith(f" {name}"):
                return f"{message}: {value}"
        if not message and node.number in self._kinds.conditions and (code := node.attributes.get("code")):
            return f"'{code}' is {'true' if status == SUCCESS else 'false'}"
        return message

    def _is_below(self, number: int, ancestor: int) -> bool:
        """Return whether a node is a leaf below *ancestor*."""
        if self._state.nodes[number].children:
            return False
        above = self._state.nodes[number].parent
        while above is not None and above > ancestor:
            above = self._state.nodes[above].parent
        return above == ancestor

    def explained_ancestors(self, number: int) -> Iterator[int]:
        """Yield a node that has ended and, from the parent up, each ancestor whose FAILURE this node explains."""
        above: int | None = number
        while above is not None:
            yield above
            parent = self._state.nodes[above].parent
            is_cause = parent is not None and above in self.ends.causes.get(parent, ())
            above = parent if is_cause and self.ends.status.get(parent or 0) == FAILURE else None

    def earlier_failed_nodes(self, number: int) -> list[int]:
        """Return the nodes whose failures led to the tick of a node that has ended."""
        return [
            each
            for node in self.explained_ancestors(number)
            if self._state.nodes[node].parent not in self._kinds.parallel
            for each in self.ends.failed_before(node)
        ]

    def results_leading_to(self, number: int) -> list[int]:
        """Return the results that made the earlier siblings of a running node and of its ancestors fail."""
        found: list[int] = []
        above: int | None = number
        while above is not None:
            if self._state.nodes[above].parent not in self._kinds.parallel:
                found += [
                    cause for each in self.ends.failed_before(above) for cause in self.causes_below(each)
                ]
            above = self._state.nodes[above].parent
        return found

    def causes_below(self, number: int) -> list[int]:
        """Return the nodes below a node whose results explain why that node ended."""
        waiting, found = [number], []
        while waiting:
            node = waiting.pop()
            causes = self.ends.causes.get(node, [])
            waiting += reversed(causes)
            found += [] if causes else [node]
        return found

    def _explain(self) -> None:
        chain, found = [], []
        waiting = [(0, 0)]
        while waiting:
            number, depth = waiting.pop()
            chain.append(self.last_end(number)._replace(depth=depth))
            causes = self.ends.causes.get(number, [])
            if not causes:
                found.append(chain[-1])
            waiting += [(child, depth + 1) for child in reversed(causes)]
        self.chain, self.causes = tuple(chain), tuple(found)
        before = {
            cause.node: self.earlier_failed_nodes(cause.node) for cause in found if cause.node is not None
        }
        self.alternatives = frozenset(number for number, failed in before.items() if failed)
        self.responses = self.alternatives & self._kinds.constant
        self.triggers = frozenset(
            cause for number in self.responses for each in before[number] for cause in self.causes_below(each)
        )


def _status_of(node: NodeState) -> NodeStatus:
    return NodeStatus(
        node.number, node.name, node.location, 0, node.status, node.label, node.message, node.status_time
    )


def _run_status(status: str, message: str, since: EventTime | None) -> NodeStatus:
    """Represent the end of a run as the status of a node."""
    return NodeStatus(None, "run", "", 0, status, None, message, since)


def _signal_name(status: int | None) -> str:
    """Return the name of the signal that the exit status of a run contains."""
    try:
        name = signal.Signals((status or 0) - _SIGNAL_STATUS).name
    except ValueError:
        return "a signal"
    return f"{name} (Ctrl-C)" if name == "SIGINT" else name


class _History:
    """Records the successes and failures of nodes during a run.

    Args:
        kinds: The properties of the nodes.

    Attributes:
        worked: The numbers of the nodes that have succeeded at least once.
        tolerated: The numbers of the nodes whose parents have succeeded or continued after the node's
            failure.
    """

    def __init__(self, kinds: _NodeKinds) -> None:
        self._kinds = kinds
        self._failures: dict[int, FormerFailure] = {}
        self._recovered: set[int] = set()
        self.worked: set[int] = set()
        self.tolerated: set[int] = set()
        self._pending: set[int] = set()
        self._in_hand = self._in_hand_then = ""

    def copy(self) -> "_History":
        """Return a copy that does not change when later entries are processed."""
        copied = _History(self._kinds)
        vars(copied).update({name: copy(each) for name, each in vars(self).items()})
        return copied

    def add_change(self, state: MissionState) -> None:
        """Process a change of the mission's state. *state* is the state after the change."""
        # The statuses of a tick are written after its events. The mission may then already have left the location.
        landmarks, place = state.situation.landmarks.values(), state.situation.phase.place
        if any(each.name == place and each.level == Level.IN_HAND for each in landmarks):
            self._in_hand = place

    def add_status(self, node: NodeState) -> None:
        """Process a new status of a node."""
        self._in_hand_then = self._in_hand
        number = node.number
        if node.status == FAILURE:
            self._pending.add(number)
            self._recovered.discard(number)
        elif node.status in (SUCCESS, RUNNING):
            if self._pending:
                self.tolerated |= self._pending.intersection(node.children)
                self._pending.discard(number)
            if node.status == SUCCESS:
                self._recovered.add(number)
                self.worked.add(number)

    def end_tick(self, explained: _ExplainedFailure, state: MissionState) -> None:
        """Record the causes of failures in this tick, except failures that made the parent of the node fail."""
        ends = explained.ends
        for top in explained.ended:
            if ends.status[top] != FAILURE:
                continue
            parent = state.nodes[top].parent
            if (
                parent is not None
                and top in ends.causes.get(parent, ())
                and ends.status.get(parent) == FAILURE
            ):
                continue
            has_led_elsewhere = parent is not None and len(state.nodes[parent].children) > 1
            for number in explained.causes_below(top):
                self._record_failure(number, explained, has_led_elsewhere=has_led_elsewhere)

    def _record_failure(self, number: int, explained: _ExplainedFailure, *, has_led_elsewhere: bool) -> None:
        cause = explained.last_end(number)
        if cause.status != FAILURE:
            return
        # A condition before an action is not an alternative: it only checks whether the action is needed.
        is_alternative = not self._kinds.conditions.issuperset(explained.earlier_failed_nodes(number))
        known = self._failures.get(number) or FormerFailure(
            cause,
            in_hand="",
            has_recovered=False,
            is_alternative=True,
            has_led_elsewhere=False,
            times=0,
            last=_START,
        )
        self._failures[number] = known._replace(
            in_hand=self._in_hand_then,
            is_alternative=known.is_alternative and is_alternative,
            has_led_elsewhere=known.has_led_elsewhere or has_led_elsewhere,
            times=known.times + 1,
            last=cause.since or _START,
        )

    def earlier_failures(self) -> list[FormerFailure]:
        """Return the failures that did not make the parent fail, sorted by the first failure of each node."""
        former = [
            each._replace(has_recovered=node in self._recovered) for node, each in self._failures.items()
        ]
        return sorted(former, key=lambda each: each.first.since or each.last)


def _is_abandoned(state: MissionState, failure: FormerFailure) -> bool:
    """Return whether the mission has abandoned the location at which a failure occurred."""
    landmarks = state.situation.landmarks.values()
    return any(each.name == failure.in_hand and each.level == Level.GIVEN_UP for each in landmarks)


def _has_missing_item(state: MissionState, failure: FormerFailure) -> bool:
    """Return whether a failure may be the reason why a part of the mission is unfinished."""
    landmarks = state.situation.landmarks.values()
    place = [each for each in landmarks if each.name == failure.in_hand]
    if not place:
        return False
    is_open = any(
        each.within == failure.in_hand and each.level in (Level.TO_COME, Level.IN_HAND) for each in landmarks
    )
    is_to_come = any(each.level == Level.TO_COME and (each.state or not each.corners) for each in landmarks)
    return (
        is_open
        or any(each.level != Level.DONE for each in place)
        or (is_to_come and not failure.has_recovered)
    )


class RunDifference(NamedTuple):
    """The first difference between two runs.

    Attributes:
        step: The number of status changes before the difference.
        here: The next status change of the first run; None if the run had ended.
        there: The next status change of the second run; None if the run had ended.
    """

    step: int
    here: NodeStatus | None
    there: NodeStatus | None


def first_difference(stream: Iterable[JournalEntry], other: Iterable[JournalEntry]) -> RunDifference | None:
    """Return the first difference between two runs, or None if the runs are equal.

    The status changes of nodes and their labels are compared one by one. Times and messages are ignored.
    """
    for step, (here, there) in enumerate(itertools.zip_longest(_changes(stream), _changes(other))):
        if (
            here is None
            or there is None
            or (here.name, here.node, here.status) != (there.name, there.node, there.status)
            or (here.label != there.label and None not in (here.label, there.label))
        ):
            return RunDifference(step, here, there)
    return None


def _changes(stream: Iterable[JournalEntry]) -> Iterator[NodeStatus]:
    state = MissionState()
    for entry in _tree_entries(stream):
        node = state.nodes[entry.data["node"]] if entry.kind == STATUS else None
        before = (node.status, node.label) if node is not None else None
        state.apply(entry)
        if node is not None and (node.status, node.label) != before:
            yield _status_of(node)


def counterfactual_text(change: "Counterfactual", nodes: Sequence[NodeState]) -> str:
    """Describe a change with which the mission would have succeeded. *nodes* are the nodes of the tree."""
    leaf = nodes[change.instead.number]
    words = f"{change.instead.status}{_label_text(change.instead)} instead of {change.was.status}{_label_text(change.was)}"
    place = f"  ({leaf.location})" if leaf.location else ""
    lines = ["The mission would have succeeded with another outcome:"]
    lines.append(escape_to_one_line(f"  {clock_text(change.time_sec)}  {leaf.name} {words}{place}"))
    if change.then:
        unusual = f", {change.unusual} of them unusual" if change.unusual else ""
        then = [f"{nodes[each.number].name} {each.outcome}" for each in change.then[:_MAX_LISTED]]
        more = f", and {len(change.then) - _MAX_LISTED} more" if len(change.then) > _MAX_LISTED else ""
        lines.append(escape_to_one_line(f"  followed by these outcomes{unusual}: {', '.join(then)}{more}"))
    return "\n".join(lines)


def _label_text(cause: Event) -> str:
    return f" ({cause.label})" if cause.label else ""


def counterfactual_data(change: "Counterfactual", nodes: Sequence[NodeState]) -> dict[str, Any]:
    """Return a change with which the mission would have succeeded as a JSON object."""

    def data(cause: Event) -> dict[str, object]:
        outcome = {"node": cause.number, "status": cause.status, "label": cause.label}
        return {**outcome, "name": nodes[cause.number].name}

    return {
        "tick": change.tick,
        "time": change.time_sec,
        "place": nodes[change.instead.number].location,
        "was": data(change.was),
        "instead": data(change.instead),
        "then": [data(each) for each in change.then],
        "unusual": change.unusual,
    }


def cause_text(reasons: CauseOfFailure, otherwise: str = "") -> str:
    """Describe the causes of a mission's failure.

    *otherwise* is the text about changes that lead to success.
    """
    lines = [escape_to_one_line(reasons.said)]
    if reasons.likeliest is not None and reasons.has_cause:
        lines += ["", "Likeliest cause:", f"  {_status_line(reasons.likeliest)}"]
    if reasons.chain:
        lines += ["", "The root failed, and then continued:" if reasons.went_on else "The root has failed:"]
        lines += [f"  {'  ' * cause.depth}{_status_line(cause)}" for cause in reasons.chain]
    elif reasons.outcome != COMPLETE:
        lines += ["", "The root has not failed."]
    if otherwise:
        lines += ["", otherwise]
    if reasons.before:
        lines += ["", "Earlier failures that did not determine the result:"]
        lines += [f"  {_status_line(each.first)}{_repetition(each)}" for each in reasons.before[:_MAX_LISTED]]
        if len(reasons.before) > _MAX_LISTED:
            lines.append(f"  … {len(reasons.before) - _MAX_LISTED} more nodes")
    return "\n".join(lines)


def likeliest_cause(reasons: CauseOfFailure) -> str:
    """Return a line with the likeliest cause of a failure, or an empty string if no node is the cause."""
    if reasons.likeliest is None or reasons.likeliest.node is None or not reasons.has_cause:
        return ""
    return f"likeliest cause: {_status_line(reasons.likeliest)}"


def _repetition(failure: FormerFailure) -> str:
    return f", {failure.times} times until {clock_text(failure.last.time)}" if failure.times > 1 else ""


def _status_line(cause: NodeStatus) -> str:
    at = f"{clock_text(cause.since.time)}  " if cause.since is not None else ""
    message = f", {shorten(cause.message)}" if cause.message else ""
    place = f"  ({cause.place})" if cause.place else ""
    return escape_to_one_line(f"{at}{cause.name} {outcome_words(cause.status, cause.label)}{message}{place}")


def difference_text(difference: RunDifference | None, names: tuple[str, str]) -> str:
    """Describe the first difference between two runs. *names* are the names of the two journals."""
    if difference is None:
        return "In both runs, all nodes had the same statuses in the same order."
    lines = [f"The runs differ after {difference.step} equal status changes:"]
    for name, cause in zip(names, (difference.here, difference.there), strict=True):
        lines.append(
            f"  {escape_to_one_line(name)}: {_status_line(cause) if cause is not None else 'no further change, because the run had ended'}"
        )
    return "\n".join(lines)


def cause_data(reasons: CauseOfFailure) -> dict[str, Any]:
    """Return the causes of a mission's failure as a JSON object."""
    return {
        "outcome": reasons.outcome,
        "reason": reasons.reason,
        "failed": reasons.ended and _instant(reasons.ended),
        "went_on": reasons.went_on,
        "causes": [status_data(each) for each in reasons.causes],
        "chain": [status_data(each) for each in reasons.chain],
        "before": [
            {**status_data(each.first), "count": each.times, "last": _instant(each.last)}
            for each in reasons.before
        ],
    }


def difference_data(difference: RunDifference | None) -> dict[str, Any] | None:
    """Return the first difference between two runs as a JSON object."""
    if difference is None:
        return None
    sides = ("here", difference.here), ("there", difference.there)
    return {"alike": difference.step, **{name: each and status_data(each) for name, each in sides}}


def status_data(cause: NodeStatus) -> dict[str, Any]:
    """Return the status of a node as a JSON object."""
    return {**cause._asdict(), "since": cause.since and _instant(cause.since)}


def _instant(instant: EventTime) -> Mapping[str, object]:
    return {"time": instant.time, "utc": instant.utc}
