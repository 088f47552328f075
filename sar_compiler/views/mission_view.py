"""A mission that is running, for a terminal: one screen of it, or a line for each change."""

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT, RUN_BEGAN, RUN_ENDED, JournalEntry
from sar_compiler.journal.mission_state import RUNNING, MissionState, NodeState, Noted, SurvivorState
from sar_compiler.tree.showing import in_one_line, shortened
from sar_compiler.views.journals import entry_words

# So much of what a mission has written of its own has room in a line.
_MOST_NOTED = 10
_SIGNS = {RUNNING: "[*]", "SUCCESS": "[✓]", "FAILURE": "[✕]", "SKIPPED": "[>]"}

# Facts that say nothing to people.
_PASSED_OVER = (RUN_BEGAN, RUN_ENDED, GOAL_SENT)
_WATCHED = ("pose", "plan", "map", "progress", "log", GOAL_ENDED)


class Piece(NamedTuple):
    """A part of a line.

    Attributes:
        text: What stands there.
        style: What it is: a status, `title`, `quiet`, `alarm`, or empty.
    """

    text: str
    style: str = ""


Line = list[Piece]


def sign(status: str) -> str:
    """Return the sign of a status; of what has no part in what is going on, another one."""
    return _SIGNS.get(status, "[-]")


def clock_text(seconds: float) -> str:
    """Return a duration as minutes and seconds, and hours if there are any: `1:05`, `2:00:00`."""
    whole = max(0, int(seconds))
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"


def noted_words(noted: Noted) -> tuple[str, str]:
    """Return what a mission has written of its own in words: what it is, and what belongs to it (`photo: photo_1`)."""
    values = (
        f"{name}: {value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)}"
        for name, value in noted.data.items()
    )
    return noted.kind.replace("_", " "), shortened(", ".join(values))


def change_text(state: MissionState, entry: JournalEntry, before: str) -> str:
    """Return an entry as a line of a log, once the state has it; empty for what is no change to people.

    Args:
        state: The state, after the entry.
        entry: The entry.
        before: The status before, of the node that the entry is about.
    """
    if entry.kind in _PASSED_OVER or entry.kind in _WATCHED:
        return ""
    if entry.kind == "status":
        status, message = entry.data.get("status"), entry.data.get("message")
        if status in (before, "IDLE"):
            return ""
        words = f"{state.nodes[entry.data['node']].name} {status}{f', {message}' if message else ''}"
    else:
        words = f"{entry.kind} {', '.join(entry_words(entry.data))}"
    return in_one_line(f"{state.now.time:9.1f} s  {shortened(words).rstrip()}")


def screen(state: MissionState, now: float, height: int) -> list[Line]:
    """Return a mission as lines for a terminal: two of the mission, the others of its tree.

    Args:
        state: The mission.
        now: Seconds of the mission's clock since the run's beginning.
        height: The number of lines at most; 3 or more.
    """
    head = [_headline(state, now), *_found(state)]
    return [*head, *_tree(state, now, height - len(head))]


def full_height(state: MissionState) -> int:
    """Return the number of lines of a screen on which nothing is folded."""
    return 2 + len(state.nodes)


def _headline(state: MissionState, now: float) -> Line:
    root = state.nodes[0].status if state.nodes else ""
    words = [state.title, clock_text(now), _going_on(state, root), *_whereabouts(state)]
    if state.zones:
        done = sum(zone.state in ("visited", "abandoned") for zone in state.zones.values())
        words.append(f"{done}/{len(state.zones)} zones done")
    return [Piece("  ".join(map(in_one_line, filter(None, words))), "title")]


def _whereabouts(state: MissionState) -> list[str]:
    place = state.zone or ("home" if state.home else "")
    drive = state.drive
    if drive is None:
        return [place]
    left = "" if drive.time_left is None else f", {clock_text(drive.time_left)} left"
    return [place if drive.target != place else "", f"{drive.target} in {drive.distance:.1f} m{left}"]


def _going_on(state: MissionState, root: str) -> str:
    if state.runs and state.runs[-1].ending:
        return state.runs[-1].ending
    if state.alarms:
        return f"ALARM: {state.alarms[-1].text}"
    return "held" if state.held else root


def _found(state: MissionState) -> Iterator[Line]:
    """Yield a line with the survivors; of a mission that looks for none, with the latest that it has written of its own."""
    told = [_survivor(each) for each in reversed(state.survivors)]
    unplaced = [f"one at no usable position in {each.name}" for each in state.zones.values() if each.unplaced]
    if told or unplaced:
        yield [Piece(in_one_line(f"survivors: {len(told)}; {'; '.join([*unplaced, *told])}"))]
    elif state.zones:
        yield [Piece("survivors: none", "quiet")]
    elif state.noted:
        latest = (", ".join(filter(None, noted_words(each))) for each in state.noted[: -_MOST_NOTED - 1 : -1])
        yield [Piece(in_one_line(f"noted: {len(state.noted)}; {'; '.join(latest)}"))]


def _survivor(survivor: SurvivorState) -> str:
    """Return a survivor in few words; the latest ones come first."""
    x, y = survivor.place
    standing = (
        survivor.report if survivor.standing == "candidate" else f"{survivor.standing}, {survivor.report}"
    )
    return f"{survivor.name or 'somebody'} ({x:.1f}, {y:.1f}) {standing}"


def _tree(state: MissionState, now: float, height: int) -> Iterator[Line]:
    """Yield the tree as far as it fits: the way to what is running and its siblings, the rest folded."""
    rows = state.nodes
    if len(rows) > height:
        rows = _unfolded(state)
    shown = _nearest(rows, height) if len(rows) > height else list(range(len(rows)))
    at = 0
    for index in shown:
        if index > at:
            yield _more(index - at, rows[at])
        yield _row(state, rows[index], now, is_folded=_is_folded(rows, index))
        at = index + 1
    if at < len(rows):
        yield _more(len(rows) - at, rows[at])


def _unfolded(state: MissionState) -> list[NodeState]:
    """Return the nodes of which each ancestor is running; of a tree that has ended, those of which each had a part."""
    open_nodes = {node.number for node in state.nodes if node.status == RUNNING}
    if not open_nodes:
        open_nodes = {node.number for node in state.nodes if node.has_part}
    rows: list[NodeState] = []
    waiting = [0] if state.nodes else []
    while waiting:
        node = state.nodes[waiting.pop()]
        rows.append(node)
        if node.number in open_nodes:
            waiting += reversed(node.children)
    return rows


def _nearest(rows: Sequence[NodeState], height: int) -> list[int]:
    """Return the rows to show where not all have room: what runs, deep ones first, then what is near to it."""
    running = [index for index, node in enumerate(rows) if node.status == RUNNING] or [0]
    distance = _distances(len(rows), running)
    order = sorted(
        range(len(rows)),
        key=lambda index: (distance[index], -rows[index].depth if not distance[index] else 0, index),
    )
    for count in range(min(height, len(rows)), 0, -1):
        chosen = _filled(sorted(order[:count]), len(rows))
        if len(chosen) + _gaps(chosen, len(rows)) <= height:
            return chosen
    return []


def _filled(chosen: Sequence[int], count: int) -> list[int]:
    """Add the rows that stand alone between others: to say that one is left out takes as much room."""
    there = {-1, *chosen, count}
    return sorted({*chosen, *(index for index in range(count) if index - 1 in there and index + 1 in there)})


def _distances(count: int, marked: Iterable[int]) -> list[int]:
    """Return how far each index is from the nearest marked one."""
    distance = [count] * count
    for index in marked:
        distance[index] = 0
    for index in range(1, count):
        distance[index] = min(distance[index], distance[index - 1] + 1)
    for index in reversed(range(count - 1)):
        distance[index] = min(distance[index], distance[index + 1] + 1)
    return distance


def _gaps(chosen: Sequence[int], count: int) -> int:
    edges = [-1, *chosen, count]
    return sum(after - before > 1 for before, after in itertools.pairwise(edges))


def _is_folded(rows: Sequence[NodeState], index: int) -> bool:
    following = rows[index + 1] if index + 1 < len(rows) else None
    return bool(rows[index].children) and (following is None or following.parent != rows[index].number)


def _row(state: MissionState, node: NodeState, now: float, *, is_folded: bool) -> Line:
    pieces = [
        Piece(_indent(node.depth)),
        Piece(sign(node.status), node.status),
        Piece(f" {in_one_line(node.name)}"),
    ]
    if is_folded:
        pieces.append(Piece(f" +{_below(state, node)}", "quiet"))
    if node.has_part and node.since is not None:
        pieces.append(Piece(f"  {clock_text(now - node.since.time)}", "quiet"))
    if node.message:
        pieces.append(Piece(f"  {in_one_line(node.message)}", "quiet" if node.status != "FAILURE" else ""))
    return pieces


def _below(state: MissionState, node: NodeState) -> int:
    """Return the number of a node's descendants: in pre-order they follow it."""
    last = node
    while last.children:
        last = state.nodes[last.children[-1]]
    return last.number - node.number


def _more(count: int, first: NodeState) -> Line:
    return [Piece(f"{_indent(first.depth)}… {count} more", "quiet")]


def _indent(depth: int) -> str:
    """Return the space before a node; very deep ones stand no further to the right."""
    return "  " * min(depth, 16)
