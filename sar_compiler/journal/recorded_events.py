"""Converts the journal of a recorded run to events: results of leaves, and decisions of other nodes.

A journal contains an entry when a node's result differs from its result in the previous tick. A leaf that returns the same
result in consecutive ticks therefore has one event for all of these ticks. Ticks without entries have no
events. At the end of a run, the number of such ticks is unknown.
"""

from collections.abc import Iterable, Iterator, Sequence
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
from sar_compiler.runtime.events import DECIDED, HALTED, RESET, RETURNED, STARTED, TICKED, Event, FactChanges

GONE = {"HALTED": HALTED, "IDLE": RESET}
"""The kinds of events for the statuses of leaves that are no longer active."""


def is_status(entry: JournalEntry, count: int) -> bool:
    """Return whether an entry is a valid `status` entry for a tree with *count* nodes."""
    if entry.kind != STATUS:
        return False
    data = entry.data
    try:
        node = data["node"]
        return (
            isinstance(node, int)
            and isinstance(data["tick"], int)
            and 0 <= node < count
            and isinstance(data["status"], str)
        )
    except KeyError:
        return False


def recorded_events(stream: Iterable[JournalEntry]) -> Iterator[Event]:
    """Yield the events of leaves in recorded runs.

    Each tick finishes with decisions and an event for its end.

    A decision is an event of an inner node that has determined its result itself. The path of a leaf also contains the nodes that
    evaluate conditions in attributes. Journal events that a leaf recorded are attached to the leaf's next event in the same tick, or
    to the tick's end if the leaf was interrupted and has no further event. Journal events that no leaf recorded are omitted.

    Args:
        stream: The entries, as `JournalFile.stream` or `last_run` yields them; ticks and times restart with each run.
    """
    run = _RecordedRun()
    for entry in stream:
        if entry.kind == RUN_BEGAN:
            yield from run.end_tick()
            run = _RecordedRun(entry.data.get("tree"), entry.time)
        elif events := run.add_entry(entry):
            yield from events
    yield from run.end_tick()


class _RecordedRun:
    """Converts a recorded run to events. The entries of the run are added one by one.

    Args:
        tree: The tree in the journal.
        start: The start of the run, seconds of the mission's clock.
    """

    def __init__(self, tree: Any = None, start: float = 0.0) -> None:
        self._nodes = list(tree_nodes(tree))
        self._count = len(self._nodes)
        self._paths: list[tuple[str, ...]] = []
        for node in self._nodes:
            ancestors = () if node.parent is None else self._paths[node.parent]
            self._paths.append((*ancestors, node.name))
        self._start = start
        self._tick, self._time, self._root = 0, 0.0, ""
        self._running: set[int] = set()
        # The journal events that each leaf has recorded in the current tick since its last event.
        self._facts: dict[int, list[tuple[str, object]]] = {}
        self._before: JournalEntry | None = None
        self._ends = NodeEnds(self._nodes)
        self._messages: dict[int, str] = {}
        self._statuses: list[tuple[int, str]] = []
        self._events: list[Event] = []

    def add_entry(self, entry: JournalEntry) -> Sequence[Event]:
        """Process an entry. If this entry starts a new tick, return the events of the previous tick."""
        ended: Sequence[Event] = ()
        data = entry.data
        if is_status(entry, self._count):
            node, status = data["node"], data["status"]
            if data["tick"] != self._tick:
                ended = self._begin_tick(entry)
            else:
                self._time = entry.time - self._start
            self._ends.receive(data, entry.time)
            # In an imported run, another engine may have reset a node in this tick that our engine resets later.
            is_unsure = bool(data.get("is_unsure"))
            if not (is_unsure or data.get("is_reset")):
                self._statuses.append((node, status))
            if self._nodes[node].children:
                self._messages[node] = str(data.get("message") or "")
                if node == 0 and status not in GONE:
                    self._root = status
            else:
                self._add_events(node, status, str(data.get("label") or ""), is_unsure=is_unsure)
        elif entry.kind == CHANGED and self._before is not None and {"leaf", "tick"} <= data.keys():
            ended = self._begin_tick(entry)
            self._facts.setdefault(data["leaf"], []).append((self._before.kind, self._before.data))
        elif entry.kind == ASSUMPTION_FAILED and isinstance(data.get("tick"), int):
            # The tick may have no status entry, because an unchanged status can also violate an assumption.
            ended = self._begin_tick(entry)
        self._before = entry
        return ended

    def _begin_tick(self, entry: JournalEntry) -> Sequence[Event]:
        tick = entry.data["tick"]
        ended = self.end_tick() if tick != self._tick else ()
        self._tick, self._time = tick, entry.time - self._start
        return ended

    def end_tick(self) -> Sequence[Event]:
        """End the current tick, and return the events of this tick, or an empty list if no tick has started."""
        events, self._events = self._events, []
        if not self._tick:
            return events
        facts = tuple(fact for facts in self._facts.values() for fact in facts)
        self._facts.clear()
        self._add_decisions(events)
        root = "" if facts else self._root
        statuses, self._statuses = tuple(self._statuses), []
        end = self._paths[0], 0, TICKED, root, "", facts, self._tick, self._time, 0.0, statuses
        events.append(Event(*end))
        return events

    def _add_decisions(self, events: list[Event]) -> None:
        """Add the decisions that inner nodes have made in the current tick."""
        for node in self._ends.end_tick():
            if self._nodes[node].children and not self._ends.causes[node]:
                ran_sec = max(0.0, self._time + self._start - self._ends.start_sec(node))
                event = self._event(node, DECIDED, self._ends.status[node], self._messages.get(node, ""))
                events.append(event._replace(ran_sec=ran_sec))

    def _add_events(self, leaf: int, status: str, label: str, *, is_unsure: bool) -> None:
        """Add the events that a recorded status of a leaf implies."""
        what = GONE.get(status, RETURNED)
        if what != RETURNED:
            status = label = ""
            self._running.discard(leaf)
        else:
            if leaf == 0:
                self._root = status
            if leaf not in self._running:
                self._events.append(self._event(leaf, STARTED))
            if status == RUNNING:
                self._running.add(leaf)
            elif status != "SKIPPED":  # a leaf that was running when it was skipped continues to run
                self._running.discard(leaf)
        facts = tuple(self._facts.pop(leaf, ())) if self._facts else ()
        event = self._event(leaf, what, status, label, facts)
        self._events.append(event._replace(is_unsure=True) if is_unsure else event)

    def _event(
        self, node: int, what: str, status: str = "", label: str = "", facts: FactChanges = ()
    ) -> Event:
        return Event(self._paths[node], node, what, status, label, facts, self._tick, self._time)
