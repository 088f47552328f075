"""Stores the ticks of a recorded run compactly. Most of these ticks have equal statuses.

The events of the ticks are those of `recorded_events`, except starts, decisions and facts, because statuses
alone do not determine these.
"""

from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from sar_compiler.journal.journal_entries import ASSUMPTION_FAILED, CHANGED, RUN_BEGAN, JournalEntry
from sar_compiler.journal.mission_state import NodeState
from sar_compiler.journal.recorded_events import GONE, is_status
from sar_compiler.runtime.events import RETURNED, TICKED, Event

StatusAndLabel = tuple[str, str]
"""The status of a node, and the label of a leaf's outcome, which is empty if there is no label."""
RESET_IN_TICK = "\0reset"
"""The value stored instead of a label if the node was reset in the tick."""
UNSURE = "\0unsure"
"""The value stored instead of a label if a condition of the node may have determined the status."""
_TickContent = tuple[tuple[tuple[int, StatusAndLabel], ...], str]


def outcome_of(data: Mapping[str, Any]) -> StatusAndLabel:
    """Return the status and the label that the data of a `status` entry contain."""
    if data.get("is_unsure"):
        return str(data["status"]), UNSURE
    label = RESET_IN_TICK if data.get("is_reset") else str(data.get("label") or "")
    return str(data["status"]), label


class LoggedTick(NamedTuple):
    """A tick of a recorded run.

    Attributes:
        number: The number of the tick, from 1.
        time_sec: The time of the tick, seconds since the run's start.
        content: A value that is equal for two ticks whose events differ only in the numbers of the ticks and
            the times.
        events: Returns the events of leaves in the tick, and the tick's end.
    """

    number: int
    time_sec: float
    content: Hashable
    events: Callable[[], Sequence[Event]]


class TickSource(ABC):
    """The ticks of a recorded run."""

    @property
    def omits_ticks(self) -> bool:
        """Whether ticks in which nothing changes may be missing, as in imported runs."""
        return False

    @abstractmethod
    def read_ticks(self) -> Iterator[LoggedTick]:
        """Yield all ticks of the run, including ticks without recorded events."""


class TickLog(TickSource):
    """Stores the ticks of one run. The statuses are added one by one.

    Args:
        nodes: The nodes of the tree.
        is_alone: Whether only this log needs the statuses; if so, statuses are not converted to entries.

    Attributes:
        count: The number of nodes.
        last: The number of the last tick to yield; None to yield all ticks.
    """

    last: int | None = None

    def __init__(self, nodes: Sequence[NodeState], *, is_alone: bool = False) -> None:
        self.count, self.is_alone = len(nodes), is_alone
        self._nodes, self._start = nodes, 0.0
        self._numbers, self._times = array("q"), array("d")
        # Equal contents are stored once: the number of each tick's content, and the contents by number.
        self._contents = array("q")
        self._known: dict[_TickContent, int] = {}
        self._by_number: list[_TickContent] = []
        self._pairs: dict[tuple[int, StatusAndLabel], tuple[int, StatusAndLabel]] = {}
        self._tick, self._time, self._root = 0, 0.0, ""
        self._statuses: list[tuple[int, StatusAndLabel]] = []
        # The leaves that have recorded events in the current tick and have no later status in it.
        self._facts: set[int] = set()
        self._is_first, self._omits_ticks = True, False

    @property
    def omits_ticks(self) -> bool:
        """Whether ticks in which nothing changes may be missing, as in imported runs."""
        return self._omits_ticks

    def add_status(self, node: int, tick: int, time_sec: float, outcome: StatusAndLabel) -> None:
        """Add a status of the node with the number *node*, which must be valid."""
        if tick != self._tick:
            self.end_tick()
            self._tick = tick
        self._time, self._is_first = time_sec, False
        self._statuses.append((node, outcome))
        if self._facts and not self._nodes[node].children:
            self._facts.discard(node)

    def add_entry(self, entry: JournalEntry) -> None:
        """Add an entry of the run, of any kind."""
        data = entry.data
        if entry.kind == RUN_BEGAN:
            self._start = entry.time
            self._omits_ticks = "imported" in (entry.data.get("run") or {})
            return
        if is_status(entry, len(self._nodes)):
            self.add_status(data["node"], data["tick"], entry.time, outcome_of(data))
        elif entry.kind == CHANGED and not self._is_first and {"leaf", "tick"} <= data.keys():
            self._begin_tick(entry)
            self._facts.add(data["leaf"])
        elif entry.kind == ASSUMPTION_FAILED and isinstance(data.get("tick"), int):
            self._begin_tick(entry)
        self._is_first = False

    def _begin_tick(self, entry: JournalEntry) -> None:
        if entry.data["tick"] != self._tick:
            self.end_tick()
        self._tick, self._time = entry.data["tick"], entry.time

    def end_tick(self) -> None:
        """Store the current tick, if a tick has started."""
        if self._tick:
            for node, (status, _) in self._statuses:
                if node == 0 and status not in GONE:
                    self._root = status
            content = tuple(self._statuses), "" if self._facts else self._root
            known = self._known.get(content)
            if known is None:
                known = self._content_number(
                    (tuple(self._pairs.setdefault(each, each) for each in content[0]), content[1])
                )
            self._numbers.append(self._tick)
            self._times.append(self._time - self._start)
            self._contents.append(known)
        self._statuses.clear()
        self._facts.clear()
        self._tick = 0

    def _content_number(self, content: _TickContent) -> int:
        """Return the number of a tick's content. Store the content if it is new."""
        number = self._known.setdefault(content, len(self._known))
        if number == len(self._by_number):
            self._by_number.append(content)
        return number

    def read_ticks(self) -> Iterator[LoggedTick]:
        """Yield all ticks of the run, including ticks without recorded events."""
        self.end_tick()
        before, time_before, root = 0, 0.0, ""
        for number, time_sec, content in zip(self._numbers, self._times, self._contents, strict=True):
            if self.last is not None and number > self.last:
                return
            for missing in range(before + 1, number) if before else ():
                yield self._recorded_tick(missing, time_before, self._content_number(((), root)))
            yield self._recorded_tick(number, time_sec, content)
            before, time_before, root = number, time_sec, self._by_number[content][1]

    def _recorded_tick(self, number: int, time_sec: float, content: int) -> LoggedTick:
        return LoggedTick(number, time_sec, content, partial(self._events, number, time_sec, content))

    def _events(self, number: int, time_sec: float, content: int) -> list[Event]:
        pairs, root = self._by_number[content]
        events = []
        for node, (status, label) in pairs:
            if not self._nodes[node].children:
                what = GONE.get(status, RETURNED)
                real_label = "" if label in (RESET_IN_TICK, UNSURE) else label
                outcome = (status, real_label) if what == RETURNED else ("", "")
                path = (self._nodes[node].name,)
                event = Event(path, node, what, *outcome, tick=number, time_sec=time_sec)
                events.append(event._replace(is_unsure=True) if label == UNSURE else event)
        # In an imported run, another engine may have reset a node in this tick that our engine resets later.
        omitted = (RESET_IN_TICK, UNSURE)
        statuses = tuple((node, status) for node, (status, label) in pairs if label not in omitted)
        path = (self._nodes[0].name,)
        end = Event(path, 0, TICKED, root, tick=number, time_sec=time_sec, statuses=statuses)
        return [*events, end]
