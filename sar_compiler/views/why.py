"""Why a mission has failed: the chain from the root's FAILURE down to the answers that caused it."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from sar_compiler.checks.verify.counterfactual import Counterfactual, LeafAnswer, RecordedTick
from sar_compiler.journal.journal_entries import RUN_BEGAN, JournalEntry
from sar_compiler.journal.mission_state import FAILURE, SUCCESS, Instant, MissionState, NodeState
from sar_compiler.tree.showing import in_one_line, shortened
from sar_compiler.views.drawing import Shape
from sar_compiler.views.mission_report import outcome, utc

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
        message: What it has said.
        since: When it got that status.
    """

    node: int
    name: str
    place: str
    depth: int
    status: str
    message: str
    since: Instant | None


class FormerFailure(NamedTuple):
    """A leaf's failures in the course of a run that had not the last word.

    Attributes:
        first: The first of them.
        zone: The zone that was under way at the last of them, or had been before; empty if none had been yet.
        has_recovered: Whether the leaf has succeeded since.
        times: How many there were, those left out that followed each other without anything else between.
        last: When the last one was.
    """

    first: NodeStatus
    zone: str
    has_recovered: bool
    times: int
    last: Instant


class Why(NamedTuple):
    """Why a mission has failed.

    Attributes:
        chain: The nodes from the root down to the answers, parents first; empty if the root has not failed.
        answers: The answers that have caused it, the likeliest cause first.
        before: What had failed before, by time.
        outcome: What the mission has come to, in a word.
        reason: The reason that its last run has given.
        ended: When the root had failed.
        went_on: Whether the root has come to something else since.
    """

    chain: tuple[NodeStatus, ...]
    answers: tuple[NodeStatus, ...]
    before: tuple[FormerFailure, ...]
    outcome: str
    reason: str
    ended: Instant | None
    went_on: bool = False

    @property
    def first(self) -> NodeStatus | None:
        """The likeliest cause; None if nothing has failed."""
        return self.answers[0] if self.answers else None


def why(stream: Sequence[JournalEntry]) -> Why:
    """Return why the last run of a mission has failed.

    Of each node those children have caused its status that have the same; under one that turns it, the other one. Where
    nothing below explains a status, it is an answer. A condition only tells what is so: if nothing else is to be blamed, what
    has failed before comes first.

    Args:
        stream: The entries, in their order.
    """
    entries = _last_run(stream)
    looks = _conditions(entries)
    ended = MissionState.of(entries)
    explained = _Explained(entries)
    chain = explained.chain
    history = _History(entries[: explained.count])

    def is_look(answer: NodeStatus) -> bool:
        return answer.node in looks

    def blame(answer: NodeStatus) -> tuple[object, ...]:
        # Where there were several ways, those before were passed over, and the last one was what was left.
        since = answer.since.time if answer.since else 0.0
        tolerated, worked = history.was_tolerated(answer.node), history.has_worked(answer.node)
        return is_look(answer), tolerated, not worked, -since, -answer.node

    answers = sorted(explained.answers, key=blame)
    before = [each for each in history.former() if each.first.node not in {answer.node for answer in answers}]
    word, reason = outcome(ended)
    if all(map(is_look, answers)) and word != "complete":
        acted = [each for each in before if not is_look(each.first) and (not chain or _cost(ended, each))]
        acted.sort(key=lambda each: (not _cost(ended, each), each.has_recovered, -each.times))
        answers = [*(each.first for each in acted), *answers]
    since = chain[0].since if chain else None
    return Why(chain, tuple(answers), tuple(before), word, reason, since, explained.went_on)


def _last_run(stream: Sequence[JournalEntry]) -> list[JournalEntry]:
    begun = [index for index, entry in enumerate(stream) if entry.kind == RUN_BEGAN]
    entries = stream[begun[-1] :] if begun else []
    count = len(MissionState.of(entries[:1]).nodes)
    return [entry for entry in entries if entry.kind != "status" or _is_sound(entry.data, count)]


def _is_sound(data: Mapping[str, Any], count: int) -> bool:
    """Return whether an entry of a status is like those of this project."""
    node, tick = data.get("node"), data.get("tick")
    return isinstance(node, int) and 0 <= node < count and isinstance(tick, int) and "status" in data


def _conditions(entries: Sequence[JournalEntry]) -> set[int]:
    """Return the numbers of the leaves that are conditions, as a run says."""
    about = entries[0].data.get("run") if entries else None
    looks = about.get("looks") if isinstance(about, Mapping) else None
    condition = [Shape.CONDITION.value, ""]
    return (
        {number for number, each in enumerate(looks) if each == condition}
        if isinstance(looks, list)
        else set()
    )


class _Explained:
    """The last FAILURE of a root, explained.

    What has explained a node's end is found out in the tick in which it ended: afterwards what is below it may be reset.

    Args:
        entries: The entries of a run.

    Attributes:
        chain: The nodes from the root down; empty if it has never failed.
        answers: Those of them that nothing below explains.
        count: The number of entries up to then; of all, if it has never failed.
        went_on: Whether the root has come to something else since.
    """

    def __init__(self, entries: Sequence[JournalEntry]) -> None:
        self.chain: tuple[NodeStatus, ...] = ()
        self.answers: tuple[NodeStatus, ...] = ()
        self.count = len(entries)
        self._state = MissionState()
        self._ends: dict[int, NodeStatus] = {}
        self._causes: dict[int, list[int]] = {}
        self._came: dict[int, str] = {}
        self._began: dict[int, int] = {}
        self._gone: dict[int, int] = {}
        taken = 0
        for tick, group in itertools.groupby(entries, _tick()):
            several = list(group)
            taken += len(several)
            self._take(tick, several)
            if self._came.get(0) == FAILURE and 0 not in self._gone:
                self._explain()
                self.count = taken
        self.went_on = bool(self.chain) and self._came.get(0) != FAILURE

    def _take(self, tick: int, entries: Sequence[JournalEntry]) -> None:
        """Take what came in a tick: first what was ticked, then what was stopped or reset at its end."""
        gone = {
            entry.data["node"]: int(entry.data.get("last", tick))
            for entry in entries
            if entry.kind == "status" and entry.data["status"] in _GONE
        }
        visited: dict[int, None] = {}
        above: dict[int, None] = {}
        for entry in entries:
            self._state.take(entry)
            if entry.kind == "status" and entry.data["status"] not in _GONE:
                node = self._state.nodes[entry.data["node"]]
                self._visit(tick, node)
                visited[node.number] = None
                above[node.number if node.parent is None else node.parent] = None
        self._gone.update(gone)
        ended = [number for number in (*visited, *above) if self._came.get(number) in _OTHER]
        for number in ended:
            if number not in visited:  # it has come to the same as before, in an activation of its own
                self._began[number] = tick
            self._causes[number] = list(self._found(self._state.nodes[number]))

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


def _tick() -> Callable[[JournalEntry], int]:
    """Return a function that says of entries, one after the other, in which tick they came."""
    now = 0

    def tick(entry: JournalEntry) -> int:
        nonlocal now
        now = int(entry.data["tick"]) if entry.kind == "status" else now
        return now

    return tick


def _answer(node: NodeState) -> NodeStatus:
    place = f"{node.file}:{node.line}" if node.file else ""
    return NodeStatus(node.number, node.name, place, 0, node.status, node.message, node.since)


class _History:
    """What leaves have come to in the course of a run.

    Args:
        entries: The entries of the run.
    """

    def __init__(self, entries: Iterable[JournalEntry]) -> None:
        self._failures: dict[int, list[NodeStatus]] = {}
        self._zones: dict[int, str] = {}
        self._recovered: set[int] = set()
        self._worked: set[int] = set()
        self._tolerated: set[int] = set()
        state, pending = MissionState(), set[int]()
        zone = ""
        for entry in entries:
            state.take(entry)
            # What a tick has come to is told after the facts of it, by which the zone may be left already.
            zone = state.zone or zone
            if entry.kind != "status":
                continue
            node = state.nodes[entry.data["node"]]
            if node.status == FAILURE:
                pending.add(node.number)
                if not node.children:
                    self._failures.setdefault(node.number, []).append(_answer(node))
                    self._zones[node.number] = zone
                    self._recovered.discard(node.number)
            elif node.status in (SUCCESS, "RUNNING"):
                self._tolerated |= pending.intersection(node.children)
                pending.discard(node.number)
                if node.status == SUCCESS:
                    self._recovered.add(node.number)
                    self._worked.add(node.number)

    def was_tolerated(self, node: int) -> bool:
        """Return whether a failure of a node was, at some time, of no consequence to its parent."""
        return node in self._tolerated

    def has_worked(self, node: int) -> bool:
        """Return whether a leaf has succeeded at some time."""
        return node in self._worked

    def former(self) -> list[FormerFailure]:
        """Return the failures of leaves, by the time of the first."""
        former = [
            FormerFailure(
                each[0], self._zones[node], node in self._recovered, len(each), each[-1].since or _START
            )
            for node, each in self._failures.items()
        ]
        return sorted(former, key=lambda each: each.first.since or each.last)


def _cost(state: MissionState, failure: FormerFailure) -> bool:
    """Return whether a mission lacks something that has to do with a failure: a zone, a report, the way home."""
    zone = state.zones.get(failure.zone)
    if zone is None:
        return False
    unknown = any(each.zone == zone.name and each.report != "acknowledged" for each in state.survivors)
    return zone.state != "visited" or unknown or not (state.home or failure.has_recovered)


class RunDifference(NamedTuple):
    """The first thing that two runs have not in common.

    Attributes:
        step: How many changes of status they have in common.
        here: What this run came to next; None if it had ended.
        there: The same of the other run.
    """

    step: int
    here: NodeStatus | None
    there: NodeStatus | None


def first_difference(stream: Sequence[JournalEntry], other: Sequence[JournalEntry]) -> RunDifference | None:
    """Return the first difference of the last runs of two missions; None if there is none.

    What nodes come to is compared, change by change, whatever the time; messages do not count.
    """
    for step, (here, there) in enumerate(itertools.zip_longest(_changes(stream), _changes(other))):
        if (
            here is None
            or there is None
            or (here.name, here.node, here.status) != (there.name, there.node, there.status)
        ):
            return RunDifference(step, here, there)
    return None


def _changes(stream: Sequence[JournalEntry]) -> Iterator[NodeStatus]:
    state = MissionState()
    for entry in _last_run(stream):
        number = entry.data.get("node") if entry.kind == "status" else None
        before = state.nodes[number].status if isinstance(number, int) and number < len(state.nodes) else ""
        state.take(entry)
        if isinstance(number, int) and number < len(state.nodes) and state.nodes[number].status != before:
            yield _answer(state.nodes[number])


def recorded(stream: Sequence[JournalEntry]) -> list[RecordedTick]:
    """Return the last run of a mission up to the last failure of its root, tick by tick; empty if that has not failed."""
    entries = _last_run(stream)
    explained = _Explained(entries)
    if not explained.chain:
        return []
    ticks, state = [], MissionState()
    for number, group in itertools.groupby(entries[: explained.count], _tick()):
        came: dict[int, str] = {}
        gone: set[int] = set()
        for entry in group:
            state.take(entry)
            if entry.kind == "status":
                if entry.data["status"] in _GONE:
                    gone.add(entry.data["node"])
                else:
                    came[entry.data["node"]] = entry.data["status"]
        if number:
            ticks.append(RecordedTick(number, state.now.time, came, frozenset(gone)))
    return ticks


def counterfactual_text(change: Counterfactual, stream: Sequence[JournalEntry]) -> str:
    """Return how a mission would have succeeded, in words."""
    nodes = MissionState.of(_last_run(stream)).nodes
    leaf = nodes[change.instead.node]
    said = f"{change.instead.status}{_meaning(change.instead)} instead of {change.was.status}{_meaning(change.was)}"
    place = f"  ({leaf.file}:{leaf.line})" if leaf.file else ""
    lines = ["It would have succeeded with another answer:"]
    lines.append(in_one_line(f"  {change.time_sec:.1f} s  {leaf.name} {said}{place}"))
    if change.then:
        usual = "as usual" if not change.unusual else f"{change.unusual} of them not as usual"
        told = [f"{nodes[each.node].name} {each.label or each.status}" for each in change.then[:_MOST]]
        more = f", and {len(change.then) - _MOST} more" if len(change.then) > _MOST else ""
        lines.append(in_one_line(f"  and after it, {usual}: {', '.join(told)}{more}"))
    return "\n".join(lines)


def _meaning(answer: LeafAnswer) -> str:
    return f" ({answer.label})" if answer.label else ""


def counterfactual_data(change: Counterfactual, stream: Sequence[JournalEntry]) -> dict[str, Any]:
    """Return how a mission would have succeeded as JSON values."""
    nodes = MissionState.of(_last_run(stream)).nodes

    def data(answer: LeafAnswer) -> dict[str, object]:
        return {**answer._asdict(), "name": nodes[answer.node].name}

    leaf = nodes[change.instead.node]
    return {
        "tick": change.tick,
        "time": change.time_sec,
        "place": f"{leaf.file}:{leaf.line}" if leaf.file else "",
        "was": data(change.was),
        "instead": data(change.instead),
        "then": [data(each) for each in change.then],
        "unusual": change.unusual,
    }


def why_text(reasons: Why, otherwise: str = "") -> str:
    """Return why a mission has failed, in words, with what would have succeeded."""
    said = f": {reasons.reason}" if reasons.reason else "."
    lines = [in_one_line(f"The mission is {reasons.outcome}{said}")]
    if reasons.first is not None and reasons.outcome != "complete":
        lines += ["", "First to look at:", f"  {_told(reasons.first)}"]
    if reasons.chain:
        lines += ["", "The root had failed, and went on:" if reasons.went_on else "The root has failed:"]
        lines += [f"  {'  ' * answer.depth}{_told(answer)}" for answer in reasons.chain]
    elif reasons.outcome != "complete":
        lines += ["", "The root has not failed."]
    if otherwise:
        lines += ["", otherwise]
    if reasons.before:
        lines += ["", "What had failed before, and had not the last word:"]
        lines += [f"  {_told(each.first)}{_often(each)}" for each in reasons.before[:_MOST]]
        if len(reasons.before) > _MOST:
            lines.append(f"  … {len(reasons.before) - _MOST} more nodes")
    return "\n".join(lines)


def _often(failure: FormerFailure) -> str:
    return f"; {failure.times} times, until {failure.last.time:.1f} s" if failure.times > 1 else ""


def _told(answer: NodeStatus) -> str:
    at = f"{answer.since.time:.1f} s  " if answer.since is not None else ""
    said = f", {shortened(answer.message)}" if answer.message else ""
    place = f"  ({answer.place})" if answer.place else ""
    return in_one_line(f"{at}{answer.name} {answer.status}{said}{place}")


def difference_text(difference: RunDifference | None, names: tuple[str, str]) -> str:
    """Return the first difference of two runs in words; the names are those of their journals."""
    if difference is None:
        return "In both runs all nodes had the same statuses, in the same order."
    lines = [f"The runs are alike in {difference.step} changes of status. Then:"]
    for name, answer in zip(names, (difference.here, difference.there), strict=True):
        lines.append(
            f"  {in_one_line(name)}: {_told(answer) if answer is not None else 'nothing more, it had ended'}"
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
    """Return what a node has come to as JSON values."""
    return {**answer._asdict(), "since": answer.since and _instant(answer.since)}


def _instant(instant: Instant) -> Mapping[str, object]:
    return {"time": instant.time, "utc": utc(instant)}
