"""Convert a recorded run's journal to events: results of leaves, and decisions of other nodes.

A journal has an entry when a node's result differs from the tick before. So a leaf that returns the same result tick
after tick has one event for all of them, and a tick without entries has none. The ticks at the end of a run without
entries are unknown.
"""

from collections.abc import Iterable, Iterator
from typing import Any

from sar_compiler.journal.journal_entries import (
    ASSUMPTION_FAILED,
    CHANGED,
    RUN_BEGAN,
    STATUS,
    JournalEntry,
)
from sar_compiler.journal.mission_state import RUNNING, tree_nodes
from sar_compiler.journal.node_ends import NodeEnds
from sar_compiler.runtime.events import ANSWERED, DECIDED, HALTED, RESET, STARTED, TICKED, Event

_GONE = {"HALTED": HALTED, "IDLE": RESET}


def is_status(entry: JournalEntry, count: int) -> bool:
    """Return whether an entry is a valid status of a node, for a tree with this many nodes."""
    node, tick, status = map(entry.data.get, ("node", "tick", "status"))
    if entry.kind != STATUS or not isinstance(node, int) or not isinstance(tick, int):
        return False
    return 0 <= node < count and isinstance(status, str)


def recorded_events(stream: Iterable[JournalEntry]) -> Iterator[Event]:
    """Yield the events of leaves in recorded runs, tick by tick; the last event of each tick is its end.

    Before it are the events of other nodes that decided by themselves in the tick.

    The path of a leaf also has the nodes that attributes query. Journal events that a leaf recorded belong to its next
    event in that tick. The tick's end has those of a leaf without an event, whose tick was interrupted. Journal events
    that no leaf recorded are left out.

    Args:
        stream: The entries, as `JournalFile.stream` or `last_run` yields them; ticks and times restart with each run.
    """
    run = _RecordedRun()
    for entry in stream:
        if entry.kind == RUN_BEGAN:
            yield from run.end_tick()
            run = _RecordedRun(entry.data.get("tree"), entry.time)
        else:
            yield from run.take(entry)
    yield from run.end_tick()


class _RecordedRun:
    """A recorded run, entry by entry.

    Args:
        tree: The tree in the journal.
        start: Its start, seconds of the mission's clock.
    """

    def __init__(self, tree: Any = None, start: float = 0.0) -> None:
        self._nodes = list(tree_nodes(tree))
        self._paths: list[tuple[str, ...]] = []
        for node in self._nodes:
            around = () if node.parent is None else self._paths[node.parent]
            self._paths.append((*around, node.name))
        self._start = start
        self._tick, self._time, self._root = 0, 0.0, ""
        self._running: set[int] = set()
        # In the tick: the journal events of leaves without a later event of the leaf.
        self._facts: dict[int, list[tuple[str, object]]] = {}
        self._before: JournalEntry | None = None
        self._ends = NodeEnds(self._nodes)
        self._messages: dict[int, str] = {}
        self._statuses: list[tuple[int, str]] = []

    def take(self, entry: JournalEntry) -> Iterator[Event]:
        """Yield the events of an entry."""
        if is_status(entry, len(self._nodes)):
            yield from self._begin_tick(entry)
            self._ends.receive(entry.data, entry.time)
            self._messages[entry.data["node"]] = str(entry.data.get("message") or "")
            self._statuses.append((entry.data["node"], entry.data["status"]))
            yield from self._events(
                entry.data["node"], entry.data["status"], str(entry.data.get("label") or "")
            )
        elif entry.kind == CHANGED and self._before is not None and {"leaf", "tick"} <= entry.data.keys():
            yield from self._begin_tick(entry)
            self._facts.setdefault(entry.data["leaf"], []).append((self._before.kind, self._before.data))
        elif entry.kind == ASSUMPTION_FAILED and isinstance(entry.data.get("tick"), int):
            # All nodes may be unchanged in it, which may itself be the error.
            yield from self._begin_tick(entry)
        self._before = entry

    def _begin_tick(self, entry: JournalEntry) -> Iterator[Event]:
        if entry.data["tick"] != self._tick:
            yield from self.end_tick()
        self._tick, self._time = entry.data["tick"], entry.time - self._start

    def end_tick(self) -> Iterator[Event]:
        """Yield the end of a tick, if one has started."""
        if self._tick:
            facts = [fact for facts in self._facts.values() for fact in facts]
            self._facts.clear()
            yield from self._decisions()
            end = self._event(0, TICKED, "" if facts else self._root, facts=facts)
            yield end._replace(statuses=tuple(self._statuses))
            self._statuses.clear()

    def _decisions(self) -> Iterator[Event]:
        """Yield the decisions of inner nodes in the tick."""
        for node in self._ends.end_tick():
            if self._nodes[node].children and not self._ends.causes[node]:
                ran_sec = max(0.0, self._time + self._start - self._ends.began_sec(node))
                event = self._event(node, DECIDED, self._ends.status[node], self._messages.get(node, ""))
                yield event._replace(ran_sec=ran_sec)

    def _events(self, node: int, status: str, label: str) -> Iterator[Event]:
        what = _GONE.get(status, ANSWERED)
        if node == 0 and what == ANSWERED:
            self._root = status
        if self._nodes[node].children:
            return
        if what == ANSWERED and node not in self._running:
            yield self._event(node, STARTED)
        # A skipped node continues if it was running.
        if status != "SKIPPED":
            (self._running.add if status == RUNNING else self._running.discard)(node)
        answer = (status, label) if what == ANSWERED else ("", "")
        yield self._event(node, what, *answer, facts=self._facts.pop(node, ()))

    def _event(
        self,
        node: int,
        what: str,
        status: str = "",
        label: str = "",
        facts: Iterable[tuple[str, object]] = (),
    ) -> Event:
        return Event(self._paths[node], node, what, status, label, tuple(facts), self._tick, self._time)
