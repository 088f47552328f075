"""Why a mission has failed: the chain from the root's FAILURE down to the answers that caused it."""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.journal.condition import COMPLETE, condition
from sar_compiler.journal.journal_entries import OF_ROBOT, RUN_BEGAN, JournalEntry
from sar_compiler.journal.mission_state import (
    FAILURE,
    SUCCESS,
    Instant,
    MissionState,
    NodeState,
    answer_words,
)
from sar_compiler.journal.recorded_events import is_status
from sar_compiler.journal.situation import CHANGED, Level
from sar_compiler.runtime.clock import clock_text
from sar_compiler.runtime.events import Event
from sar_compiler.tree.showing import in_one_line, shortened
from sar_compiler.views.drawing import Shape

if TYPE_CHECKING:
    from sar_compiler.checks.verify.counterfactual import Counterfactual

_OTHER = {FAILURE: SUCCESS, SUCCESS: FAILURE}
_GONE = ("IDLE", "HALTED")
# So many of what had failed before are told.
_MOST = 12
_START = Instant(1, 0.0, 0.0)


class NodeStatus(NamedTuple):
    """The status of a node.

    Attributes:
        node: Its number.
        name: Its name.
        place: `file:line`; empty if unknown.
        depth: How far it is below the first of its chain.
        status: The status.
        label: What it means: the label of a leaf's answer; empty if it has not said which, None if there is none to say.
        message: What it has said.
        since: When it got that status.
    """

    node: int
    name: str
    place: str
    depth: int
    status: str
    label: str | None
    message: str
    since: Instant | None


class FormerFailure(NamedTuple):
    """A leaf's failures during a run that were not its last outcome.

    Attributes:
        first: The first of them.
        in_hand: The place that the mission was at work at when the last of them came, or had been before; empty for none yet.
        has_recovered: Whether the leaf has succeeded since.
        times: How many there were, those left out that followed each other without anything else between.
        last: When the last one was.
    """

    first: NodeStatus
    in_hand: str
    has_recovered: bool
    times: int
    last: Instant


class Why(NamedTuple):
    """Why a mission has failed.

    Attributes:
        chain: The nodes from the root down to the answers, parents first; empty if the root has not failed.
        answers: The answers that have caused it, the likeliest cause first.
        before: What had failed before, by time.
        outcome: What the mission has come to, in a word: the word of its condition.
        reason: The reason of that.
        said: Both in a line.
        ended: When the root had failed.
        went_on: Whether the root has come to something else since.
    """

    chain: tuple[NodeStatus, ...]
    answers: tuple[NodeStatus, ...]
    before: tuple[FormerFailure, ...]
    outcome: str
    reason: str
    said: str
    ended: Instant | None
    went_on: bool = False

    @property
    def is_of_a_failure(self) -> bool:
        """Whether there is something to be told: the mission is not complete, and something has failed."""
        return self.first is not None and self.outcome != COMPLETE

    @property
    def first(self) -> NodeStatus | None:
        """The likeliest cause; None if nothing has failed."""
        return self.answers[0] if self.answers else None


class Inquiry:
    """Finds out why the last run of a mission has failed, from entries that come one by one; it keeps none of them.

    Of each node those children have caused its status that have the same; under one that turns it, the other one. Where
    nothing below explains a status, it is an answer. A condition only tells what is so: if nothing else is to be blamed, what
    has failed before comes first.

    Attributes:
        state: The state of the mission after the last run's entries, without what the robot's topics have said.
        failed_tick: The number of the last tick in which the root had failed, once `why` was asked; 0 if it has never failed.
    """

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self.state = MissionState()
        self.failed_tick = 0
        self._looks: set[int] = set()
        self._history = self._history_then = _History()
        self._explained = _Explained(self.state)

    @classmethod
    def of(cls, stream: Iterable[JournalEntry]) -> "Inquiry":
        """Return an inquiry that has taken these entries."""
        inquiry = cls()
        for entry in stream:
            inquiry.take(entry)
        return inquiry

    def take(self, entry: JournalEntry) -> None:
        """Take an entry; each new run starts the inquiry again."""
        if entry.kind == RUN_BEGAN:
            self._begin()
            self._looks = _conditions(entry)
        elif not self.state.runs or not _is_of_tree(entry, len(self.state.nodes)):
            return
        is_of_node = entry.kind == "status"
        if is_of_node and self._explained.is_next(entry):
            self._end_tick()
        self.state.take(entry)
        if is_of_node:
            self._explained.take(entry)
        self._history.take(entry, self.state)

    def _end_tick(self) -> None:
        if self._explained.end_tick():
            self.failed_tick, self._history_then = self._explained.tick, self._history.copy()

    def why(self) -> Why:
        """Return why the run has failed, once all of it was taken."""
        self._end_tick()
        chain, looks = self._explained.chain, self._looks
        history = self._history_then if chain else self._history

        def is_look(answer: NodeStatus) -> bool:
            return answer.node in looks

        def blame(answer: NodeStatus) -> tuple[object, ...]:
            # Where there were several ways, those before were passed over, and the last one was what was left.
            since = answer.since.time if answer.since else 0.0
            tolerated, worked = answer.node in history.tolerated, answer.node in history.worked
            return is_look(answer), tolerated, not worked, -since, -answer.node

        answers = sorted(self._explained.answers, key=blame)
        blamed = {answer.node for answer in answers}
        before = [each for each in history.former() if each.first.node not in blamed]
        now = condition(self.state)
        if all(map(is_look, answers)) and now.word != COMPLETE:
            acted = [each for each in before if not is_look(each.first)]
            acted = [each for each in acted if not chain or _cost(self.state, each)]
            acted.sort(key=lambda each: (not _cost(self.state, each), each.has_recovered, -each.times))
            answers = [*(each.first for each in acted), *answers]
        since = chain[0].since if chain else None
        said = now.text(self.state.now.time)
        went_on = self._explained.went_on
        return Why(chain, tuple(answers), tuple(before), now.word, now.reason, said, since, went_on)


def _of_tree(stream: Iterable[JournalEntry]) -> Iterator[JournalEntry]:
    """Yield those entries of a run that tell of its tree and its mission, and can be understood."""
    count = 0
    for entry in stream:
        if entry.kind == RUN_BEGAN:
            count = len(MissionState.of([entry]).nodes)
        if _is_of_tree(entry, count):
            yield entry


def _is_of_tree(entry: JournalEntry, count: int) -> bool:
    """Return whether an entry tells of the tree, which has so many nodes, or the mission, as those of this project do."""
    return is_status(entry, count) if entry.kind == "status" else entry.kind not in OF_ROBOT


def _conditions(began: JournalEntry) -> set[int]:
    """Return the numbers of the leaves that only tell what is so, conditions and those that always do the same, as the beginning of a run says."""
    about = began.data.get("run")

    def listed(name: str) -> list[Any]:
        value = about.get(name) if isinstance(about, Mapping) else None
        return value if isinstance(value, list) else []

    told = {number for number, each in enumerate(listed("looks")) if each == [Shape.CONDITION.value, ""]}
    return told.union(each for each in listed("constant") if isinstance(each, int))


class _Explained:
    """The last FAILURE of a root, explained.

    What has explained a node's end is found out in the tick in which it ended: afterwards what is below it may be reset.

    Args:
        state: The state of the mission, which has taken each entry before this does.

    Attributes:
        chain: The nodes from the root down; empty if it has never failed.
        answers: Those of them that nothing below explains.
        tick: The number of the tick whose entries are taken.
    """

    def __init__(self, state: MissionState) -> None:
        self.chain: tuple[NodeStatus, ...] = ()
        self.answers: tuple[NodeStatus, ...] = ()
        self._state = state
        self._ends: dict[int, NodeStatus] = {}
        self._causes: dict[int, list[int]] = {}
        self._came: dict[int, str] = {}
        self._began: dict[int, int] = {}
        self._gone: dict[int, int] = {}
        # Of the tick that is being taken: the nodes that were ticked, those above them, those stopped or reset at its end.
        self.tick = 0
        self._visited: dict[int, None] = {}
        self._above: dict[int, None] = {}
        self._going: dict[int, int] = {}

    @property
    def went_on(self) -> bool:
        """Whether the root has had another status since."""
        return bool(self.chain) and self._came.get(0) != FAILURE

    def is_next(self, entry: JournalEntry) -> bool:
        """Return whether a node's status belongs to another tick than the entries before."""
        return int(entry.data["tick"]) != self.tick

    def take(self, entry: JournalEntry) -> None:
        """Take the status of a node."""
        self.tick = int(entry.data["tick"])
        node = self._state.nodes[entry.data["node"]]
        if entry.data["status"] in _GONE:
            self._going[node.number] = int(entry.data.get("last", self.tick))
            return
        self._visit(self.tick, node)
        self._visited[node.number] = None
        self._above[node.number if node.parent is None else node.parent] = None

    def end_tick(self) -> bool:
        """End a tick; return whether the root has failed in it, or had failed and was not reset."""
        self._gone.update(self._going)
        for number in (*self._visited, *self._above):
            if self._came.get(number) in _OTHER:
                if (
                    number not in self._visited
                ):  # it has come to the same as before, in an activation of its own
                    self._began[number] = self.tick
                self._causes[number] = list(self._found(self._state.nodes[number]))
        self._visited, self._above, self._going = {}, {}, {}
        has_failed = self._came.get(0) == FAILURE and 0 not in self._gone
        if has_failed:
            self._explain()
        return has_failed

    def _visit(self, tick: int, node: NodeState) -> None:
        """Note what a node has come to."""
        number = node.number
        if self._came.get(number) != "RUNNING" or number in self._gone:
            self._began[number] = tick
        self._gone.pop(number, None)
        self._came[number] = node.status
        if node.status in _OTHER:
            self._ends[number] = _answer(node)

    def _found(self, node: NodeState) -> Iterator[int]:
        """Yield the children that explain the end of a node."""
        # One that was reset, and was ticked last before the node began, had no part in it.
        began, status = self._began[node.number], self._came[node.number]
        part = [each for each in node.children if self._gone.get(each, began) >= began]
        same = [each for each in part if self._came.get(each) == status]
        # A decorator may turn what its child says; a control passes on what it has.
        turned = [each for each in part if self._came.get(each) == _OTHER[status]]
        yield from same or (turned if len(node.children) == 1 else [])

    def _explain(self) -> None:
        chain, answers = [], []
        waiting = [(0, 0)]
        while waiting:
            number, depth = waiting.pop()
            chain.append(self._ends[number]._replace(depth=depth))
            causes = self._causes.get(number, [])
            if not causes:
                answers.append(chain[-1])
            waiting += [(child, depth + 1) for child in reversed(causes)]
        self.chain, self.answers = tuple(chain), tuple(answers)


def _answer(node: NodeState) -> NodeStatus:
    return NodeStatus(
        node.number, node.name, node.place, 0, node.status, node.label, node.message, node.since
    )


class _History:
    """The outcomes of leaves during a run.

    Attributes:
        worked: The leaves that have succeeded at some time.
        tolerated: The nodes that had failed when their parent did not.
    """

    def __init__(self) -> None:
        self._failures: dict[int, FormerFailure] = {}
        self._recovered: set[int] = set()
        self.worked: set[int] = set()
        self.tolerated: set[int] = set()
        self._pending: set[int] = set()
        self._in_hand = ""

    def copy(self) -> "_History":
        """Return a copy that later entries do not change."""
        copied = _History()
        vars(copied).update({name: copy(each) for name, each in vars(self).items()})
        return copied

    def take(self, entry: JournalEntry, state: MissionState) -> None:
        """Take an entry of the run, after which the mission has a state."""
        # What a tick has come to is told after the facts of it, by which the place may be left already.
        if entry.kind == CHANGED:
            landmarks, place = state.situation.landmarks.values(), state.situation.phase.place
            if any(each.name == place and each.level == Level.IN_HAND for each in landmarks):
                self._in_hand = place
        if entry.kind != "status":
            return
        node = state.nodes[entry.data["node"]]
        number = node.number
        if node.status == FAILURE:
            self._pending.add(number)
            if not node.children:
                answer = _answer(node)
                known = self._failures.get(number) or FormerFailure(
                    answer, in_hand="", has_recovered=False, times=0, last=_START
                )
                last = answer.since or _START
                self._failures[number] = known._replace(
                    in_hand=self._in_hand, times=known.times + 1, last=last
                )
                self._recovered.discard(number)
        elif node.status in (SUCCESS, "RUNNING"):
            if self._pending:
                self.tolerated |= self._pending.intersection(node.children)
                self._pending.discard(number)
            if node.status == SUCCESS:
                self._recovered.add(number)
                self.worked.add(number)

    def former(self) -> list[FormerFailure]:
        """Return the failures of leaves that were not their last outcome, by the time of the first."""
        former = [
            each._replace(has_recovered=node in self._recovered) for node, each in self._failures.items()
        ]
        return sorted(former, key=lambda each: each.first.since or each.last)


def _cost(state: MissionState, failure: FormerFailure) -> bool:
    """Return whether a mission lacks something that has to do with a failure: the place in hand, a find there, or what was to come."""
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
    """The first difference of two runs.

    Attributes:
        step: How many changes of status they have in common.
        here: What this run came to next; None if it had ended.
        there: The same of the other run.
    """

    step: int
    here: NodeStatus | None
    there: NodeStatus | None


def first_difference(stream: Iterable[JournalEntry], other: Iterable[JournalEntry]) -> RunDifference | None:
    """Return the first difference of two runs; None if there is none.

    What nodes come to is compared, and what they mean by it, change by change, whatever the time; messages do not count.
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
    for entry in _of_tree(stream):
        node = state.nodes[entry.data["node"]] if entry.kind == "status" else None
        before = (node.status, node.label) if node is not None else None
        state.take(entry)
        if node is not None and (node.status, node.label) != before:
            yield _answer(node)


def counterfactual_text(change: "Counterfactual", nodes: Sequence[NodeState]) -> str:
    """Return how a mission whose tree has these nodes would have succeeded, in words."""
    leaf = nodes[change.instead.number]
    said = f"{change.instead.status}{_meaning(change.instead)} instead of {change.was.status}{_meaning(change.was)}"
    place = f"  ({leaf.place})" if leaf.place else ""
    lines = ["It would have succeeded with another answer:"]
    lines.append(in_one_line(f"  {clock_text(change.time_sec)}  {leaf.name} {said}{place}"))
    if change.then:
        usual = "as usual" if not change.unusual else f"{change.unusual} of them not as usual"
        told = [f"{nodes[each.number].name} {each.answer}" for each in change.then[:_MOST]]
        more = f", and {len(change.then) - _MOST} more" if len(change.then) > _MOST else ""
        lines.append(in_one_line(f"  and after it, {usual}: {', '.join(told)}{more}"))
    return "\n".join(lines)


def _meaning(answer: Event) -> str:
    return f" ({answer.label})" if answer.label else ""


def counterfactual_data(change: "Counterfactual", nodes: Sequence[NodeState]) -> dict[str, Any]:
    """Return how a mission whose tree has these nodes would have succeeded as JSON values."""

    def data(answer: Event) -> dict[str, object]:
        said = {"node": answer.number, "status": answer.status, "label": answer.label}
        return {**said, "name": nodes[answer.number].name}

    return {
        "tick": change.tick,
        "time": change.time_sec,
        "place": nodes[change.instead.number].place,
        "was": data(change.was),
        "instead": data(change.instead),
        "then": [data(each) for each in change.then],
        "unusual": change.unusual,
    }


def why_text(reasons: Why, otherwise: str = "") -> str:
    """Return why a mission has failed, in words, with what would have succeeded."""
    lines = [in_one_line(reasons.said)]
    if reasons.first is not None and reasons.is_of_a_failure:
        lines += ["", "First to look at:", f"  {_status_line(reasons.first)}"]
    if reasons.chain:
        lines += ["", "The root had failed, and went on:" if reasons.went_on else "The root has failed:"]
        lines += [f"  {'  ' * answer.depth}{_status_line(answer)}" for answer in reasons.chain]
    elif reasons.outcome != COMPLETE:
        lines += ["", "The root has not failed."]
    if otherwise:
        lines += ["", otherwise]
    if reasons.before:
        lines += ["", "What had failed before, and had not the last word:"]
        lines += [f"  {_status_line(each.first)}{_repetition(each)}" for each in reasons.before[:_MOST]]
        if len(reasons.before) > _MOST:
            lines.append(f"  … {len(reasons.before) - _MOST} more nodes")
    return "\n".join(lines)


def first_to_look_at(reasons: Why) -> str:
    """Return the likeliest cause of a failure in a line; empty if there is none to be told."""
    if reasons.first is None or not reasons.is_of_a_failure:
        return ""
    return f"first to look at: {_status_line(reasons.first)}"


def _repetition(failure: FormerFailure) -> str:
    return f"; {failure.times} times, until {clock_text(failure.last.time)}" if failure.times > 1 else ""


def _status_line(answer: NodeStatus) -> str:
    at = f"{clock_text(answer.since.time)}  " if answer.since is not None else ""
    said = f", {shortened(answer.message)}" if answer.message else ""
    place = f"  ({answer.place})" if answer.place else ""
    return in_one_line(f"{at}{answer.name} {answer_words(answer.status, answer.label)}{said}{place}")


def difference_text(difference: RunDifference | None, names: tuple[str, str]) -> str:
    """Return the first difference of two runs in words; the names are those of their journals."""
    if difference is None:
        return "In both runs all nodes had the same statuses, in the same order."
    lines = [f"The runs are alike in {difference.step} changes of status. Then:"]
    for name, answer in zip(names, (difference.here, difference.there), strict=True):
        lines.append(
            f"  {in_one_line(name)}: {_status_line(answer) if answer is not None else 'nothing more, it had ended'}"
        )
    return "\n".join(lines)


def why_data(reasons: Why) -> dict[str, Any]:
    """Return why a mission has failed as JSON values."""
    return {
        "outcome": reasons.outcome,
        "reason": reasons.reason,
        "failed": reasons.ended and _instant(reasons.ended),
        "went_on": reasons.went_on,
        "answers": [answer_data(each) for each in reasons.answers],
        "chain": [answer_data(each) for each in reasons.chain],
        "before": [
            {**answer_data(each.first), "count": each.times, "last": _instant(each.last)}
            for each in reasons.before
        ],
    }


def difference_data(difference: RunDifference | None) -> dict[str, Any] | None:
    """Return the first difference of two runs as JSON values."""
    if difference is None:
        return None
    sides = ("here", difference.here), ("there", difference.there)
    return {"alike": difference.step, **{name: each and answer_data(each) for name, each in sides}}


def answer_data(answer: NodeStatus) -> dict[str, Any]:
    """Return the outcome of a node as JSON values."""
    return {**answer._asdict(), "since": answer.since and _instant(answer.since)}


def _instant(instant: Instant) -> Mapping[str, object]:
    return {"time": instant.time, "utc": instant.utc}
