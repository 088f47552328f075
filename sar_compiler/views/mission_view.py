"""Views of a running mission in a terminal: a screen, or one line for each change."""

import bisect
import itertools
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

from sar_compiler.journal.display import Landmark, default_sentence, with_author
from sar_compiler.journal.journal_entries import (
    BREAKPOINT,
    CHANGED,
    GOAL_ENDED,
    GOAL_SENT,
    LACKS,
    OF_ROBOT,
    ORDERED,
    PROGRESS,
    RUN_BEGAN,
    RUN_ENDED,
    STATUS,
    CommandAuthor,
    JournalEntry,
)
from sar_compiler.journal.mission_state import RUNNING, MissionState, NodeState
from sar_compiler.journal.open_tasks import find_open_tasks
from sar_compiler.journal.status_line import DRIVING, GOOD, QUIET, StatusLine, condition
from sar_compiler.runtime.clock import clock_text
from sar_compiler.style import IN_TEXT
from sar_compiler.tree.display_text import escape_to_one_line, shorten

# The maximum number of events, or of landmarks of the same kind, in a line.
_MAX_LISTED = 10
# The maximum number of names in the line of a chain, in which each node is the only child of the previous one.
_MAX_NAMES = 4

# The kinds of journal entries that have no log line.
_NOT_SHOWN = (
    RUN_BEGAN,
    RUN_ENDED,
    GOAL_SENT,
    GOAL_ENDED,
    PROGRESS,
    LACKS,
    BREAKPOINT,
    *OF_ROBOT,
)


class Piece(NamedTuple):
    """A part of a line of text in the terminal.

    Attributes:
        text: The text.
        style: The text's style: a status, `title`, `quiet`, `alarm`, or empty.
    """

    text: str
    style: str = ""


Line = list[Piece]


def status_sign(status: str) -> str:
    """Return the sign of a status; `[-]` if the status is from an earlier activation of the node."""
    return IN_TEXT.get(status, IN_TEXT[""])


def change_text(state: MissionState, entry: JournalEntry, before: str) -> str:
    """Return the log line of a processed journal entry; empty if the entry is not shown.

    Args:
        state: The state of the mission after the entry.
        entry: The journal entry.
        before: The previous status of the entry's node.
    """
    if entry.kind in _NOT_SHOWN:
        return ""
    if entry.kind == STATUS:
        node = state.nodes[entry.data["node"]]
        if node.status in (before, "IDLE"):
            return ""
        words = f"{node.name} {node.status_text}"
    elif entry.kind == CHANGED:  # the entry after an event, with a sentence about the event
        words = with_author(str(entry.data.get("said") or ""), CommandAuthor.from_data(entry.data))
    elif entry.kind == ORDERED:
        words = "" if entry.data.get("is_told") else state.facts[-1].text
    else:
        words = "" if state.is_told else default_sentence(entry.kind, entry.data)
    return _log_line(state, words) if words else ""


def condition_change(state: MissionState, before: StatusLine) -> str:
    """Return the log line for a mission's new status line; empty if the change is not worth reporting."""
    now = condition(state)
    if (now.word, now.reason) == (before.word, before.reason) or {now.level, before.level} <= {GOOD, QUIET}:
        return ""
    return _log_line(state, now.to_line())


def _log_line(state: MissionState, words: str) -> str:
    return escape_to_one_line(f"{clock_text(state.now.time):>9}  {shorten(words)}")


def screen(state: MissionState, now: float, height: int) -> list[Line]:
    """Return the lines of a terminal screen: the mission's status, then its tree.

    Args:
        state: The state of the mission.
        now: The time since the start of the run on the mission's clock, in seconds.
        height: The maximum number of lines, at least 3.
    """
    head = [_headline(state, now), *_tasks(state), *_figures(state, now), *_detection_lines(state)]
    return [*head, *_tree(state, now, height - len(head))]


def full_height(state: MissionState) -> int:
    """Return the number of lines of a screen that shows every node of the tree."""
    found = sum(kind.is_found for kind in state.situation.kinds.values())
    return 1 + len([*_tasks(state)]) + len([*_figures(state, 0.0)]) + max(1, found) + len(state.nodes)


def _headline(state: MissionState, now: float) -> Line:
    words = [state.title, clock_text(now), condition(state).to_line(now), _drive_left(state)]
    return [Piece("  ".join(map(escape_to_one_line, filter(None, words))), "title")]


def _drive_left(state: MissionState) -> str:
    drive = state.drive
    if drive is None or condition(state).word != DRIVING:
        return ""
    left = "" if drive.time_left is None else f", {clock_text(drive.time_left)} left"
    return f"{drive.distance:.1f} m{left}"


def _tasks(state: MissionState) -> Iterator[Line]:
    """Yield a line with the open tasks, if there are any. Alarms are left out."""
    tasks = [task for task in find_open_tasks(state) if not task.is_alarm]
    if tasks:
        yield [Piece(escape_to_one_line(f"TO DO: {'; '.join(task.text for task in tasks)}"), "alarm")]


def _figures(state: MissionState, now: float) -> Iterator[Line]:
    """Yield a line with gauges, alarms and progress, if there are any."""
    situation = state.situation
    words = [gauge.text for gauge in state.gauges]
    raised = [alarm for alarm in situation.alarms.values() if not alarm.is_over]
    words += [f"ALARM ({clock_text(now - state.since[each.text].time)}): {each.text}" for each in raised]
    words += [figure.text for figure in situation.figures.values()]
    if words:
        yield [Piece("  ".join(map(escape_to_one_line, words)), "alarm" if raised else "")]


def _detection_lines(state: MissionState) -> Iterator[Line]:
    """Yield a line for each kind of landmark that can be detected.

    If no kind can be detected, yield lines with the latest events.
    """
    situation = state.situation
    kinds = [kind for kind in situation.kinds.values() if kind.is_found]
    for kind in kinds:
        finds = situation.of_kind(kind.name)
        latest = "; ".join(map(_detection_text, finds[: -_MAX_LISTED - 1 : -1]))
        text = f"{kind.plural}: {len(finds)}; {latest}" if finds else f"{kind.plural}: none"
        yield [Piece(escape_to_one_line(text), "" if finds else "quiet")]
    if state.facts and not kinds:
        latest = "; ".join(fact.text for fact in state.facts[: -_MAX_LISTED - 1 : -1])
        yield [Piece(escape_to_one_line(f"events: {len(state.facts)}; {shorten(latest)}"))]


def _detection_text(detection: Landmark) -> str:
    words = [detection.state, *(each for each in detection.details.values() if isinstance(each, str))]
    return f"{detection.name} ({detection.x:.1f}, {detection.y:.1f}) {', '.join(filter(None, words))}"


class _TreeRow(NamedTuple):
    """A row of the tree.

    Attributes:
        nodes: A node, or a chain of nodes in which each is the only child of the previous one.
        depth: The indentation level of the row.
    """

    nodes: list[NodeState]
    depth: int

    @property
    def is_running(self) -> bool:
        return any(node.status == RUNNING for node in self.nodes)


def _tree(state: MissionState, now: float, height: int) -> Iterator[Line]:
    """Yield the lines of the tree. If there is not enough space, branches are folded or omitted."""
    rows = _rows(state, height)
    shown = _select_rows(rows, height) if len(rows) > height else list(range(len(rows)))
    at = 0
    for index in shown:
        if index > at:
            yield _omission_line(index - at, rows[at])
        yield _row(state, rows[index], now, is_folded=_is_folded(rows, index))
        at = index + 1
    if at < len(rows):
        yield _omission_line(len(rows) - at, rows[at])


def _rows(state: MissionState, height: int) -> list[_TreeRow]:
    """Return the rows of the tree: one row for each node or, if they do not fit, for each chain of nodes.

    If these do not fit either, only running branches are unfolded. If no node is running, the branches with nodes of
    the current activation are unfolded.
    """
    if len(state.nodes) <= height:
        return [_TreeRow([node], node.depth) for node in state.nodes]
    rows = _visible_rows(state, {node.number for node in state.nodes})
    if len(rows) <= height:
        return rows
    running = {node.number for node in state.nodes if node.status == RUNNING}
    return _visible_rows(state, running or {node.number for node in state.nodes if node.has_part})


def _visible_rows(state: MissionState, open_nodes: Collection[int]) -> list[_TreeRow]:
    """Return the rows that are visible if only the branches of the given open nodes are unfolded."""
    rows: list[_TreeRow] = []
    waiting = [(0, 0)] if state.nodes else []
    while waiting:
        number, depth = waiting.pop()
        row = _TreeRow([*_chain(state, number)], depth)
        rows.append(row)
        if row.nodes[-1].number in open_nodes:
            waiting += [(child, depth + 1) for child in reversed(row.nodes[-1].children)]
    return rows


def _chain(state: MissionState, number: int) -> Iterator[NodeState]:
    """Yield a node and its descendants down to the first node that does not have exactly one child."""
    yield (node := state.nodes[number])
    while len(node.children) == 1:
        yield (node := state.nodes[node.children[0]])


def _select_rows(rows: Sequence[_TreeRow], height: int) -> list[int]:
    """Return the indices of the rows that fit.

    Running rows are chosen first, then the rows nearest to a running row.
    """
    running = [index for index, row in enumerate(rows) if row.is_running] or [0]
    distance = [_distance(running, index) for index in range(len(rows))]
    order = sorted(
        range(len(rows)),
        key=lambda index: (distance[index], 0 if distance[index] else -rows[index].depth, index),
    )
    for count in range(min(height, len(rows)), 0, -1):
        chosen = _fill_single_gaps(sorted(order[:count]), len(rows))
        if len(chosen) + _count_gaps(chosen, len(rows)) <= height:
            return chosen
    return []


def _fill_single_gaps(chosen: Sequence[int], count: int) -> list[int]:
    """Also choose each single omitted row between two chosen rows.

    A line about the omission would need as much space as the row.
    """
    there = {-1, *chosen, count}
    return sorted({*chosen, *(index for index in range(count) if index - 1 in there and index + 1 in there)})


def _distance(marked: Sequence[int], index: int) -> int:
    """Return the distance from an index to the nearest index in *marked*, which must be sorted."""
    at = bisect.bisect(marked, index)
    return min(abs(index - each) for each in marked[max(at - 1, 0) : at + 1])


def _count_gaps(chosen: Sequence[int], count: int) -> int:
    edges = [-1, *chosen, count]
    return sum(after - before > 1 for before, after in itertools.pairwise(edges))


def _is_folded(rows: Sequence[_TreeRow], index: int) -> bool:
    following, last = rows[index + 1] if index + 1 < len(rows) else None, rows[index].nodes[-1]
    return bool(last.children) and (following is None or following.nodes[0].parent != last.number)


def _row(state: MissionState, row: _TreeRow, now: float, *, is_folded: bool) -> Line:
    pieces = [Piece(_indent(row.depth)), *_names(row.nodes)]
    if is_folded:
        pieces.append(Piece(f" +{_count_descendants(state, row.nodes[-1])}", "quiet"))
    parts = [node for node in row.nodes if node.has_part and node.status_time is not None]
    if parts and (since := parts[-1].status_time) is not None:
        pieces.append(Piece(f"  {clock_text(now - since.time)}", "quiet"))
    for node in reversed(row.nodes):
        if words := node.message or (node.label if node.has_part else ""):
            return [
                *pieces,
                Piece(f"  {escape_to_one_line(words)}", "quiet" if node.status != "FAILURE" else ""),
            ]
    return pieces


def _names(chain: Sequence[NodeState]) -> Iterator[Piece]:
    """Yield the names in a chain of nodes, with a status sign where the sign changes.

    A long chain is shortened.
    """
    # A subtree and its root often have the same name, which is shown once.
    nodes = [
        next(same) for _, same in itertools.groupby(chain, lambda node: (node.name, status_sign(node.status)))
    ]
    left_out = max(0, len(nodes) - _MAX_NAMES)
    shown = ""
    for number, node in enumerate([nodes[0], *nodes[1 + left_out :]]):
        if number:
            yield Piece(" > … > " if number == 1 and left_out else " > ", "quiet")
        if status_sign(node.status) != shown:
            shown = status_sign(node.status)
            yield Piece(shown, node.status)
            yield Piece(" ")
        yield Piece(escape_to_one_line(node.name))


def _count_descendants(state: MissionState, node: NodeState) -> int:
    """Return the number of a node's descendants. In pre-order, they follow the node."""
    last = node
    while last.children:
        last = state.nodes[last.children[-1]]
    return last.number - node.number


def _omission_line(count: int, first: _TreeRow) -> Line:
    return [Piece(f"{_indent(first.depth)}… {count} more", "quiet")]


def _indent(depth: int) -> str:
    """Return the indentation of a row. Rows deeper than 16 levels are not indented further."""
    return "  " * min(depth, 16)
