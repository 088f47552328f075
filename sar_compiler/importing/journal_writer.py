"""Write the ticks of a recorded run to a journal."""

import json
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol

from sar_compiler.importing.recorded_tree import RunNode
from sar_compiler.importing.recording import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, WORDS, Recording
from sar_compiler.importing.ticks import RecordedTick, TickFinder, TickKind
from sar_compiler.journal.journal_entries import STATUS, Ending, Row
from sar_compiler.journal.spill_file import RunEnd
from sar_compiler.nodes.nav2.log_lines import GoalEnd, LoggedLine, quote_lines
from sar_compiler.nodes.spec import Kind

_BATCH = 20_000
# A log line can belong to a failed leaf if it was logged at most this long before the leaf's start or after its end, in seconds.
_LOGGED_BEFORE_SEC, _LOGGED_AFTER_SEC = 0.1, 0.5
# Nav2 logs the end of a goal at most this long after the tree was halted, in seconds.
_REPORTED_SEC = 1.0
_LAST_TICK_MISSING = "the last tick of the last run is missing, because Nav2 publishes this tick only when the next goal starts"
_CONDITIONS = {SUCCESS: "_successIf", FAILURE: "_failureIf"}
"""For each final status, the precondition that ends a node with this status."""


class EntrySink(Protocol):
    """The receiver of runs and journal entries, such as a `JournalFile`."""

    def begin_run(self, about: Mapping[str, object], run_about: Mapping[str, object], wall: float) -> int:
        """Add a run; return the run's number."""

    def write(self, watched: Iterable[Row], facts: Sequence[Row] = (), end: RunEnd | None = None) -> None:
        """Write entries and, if given, the end of a run."""


class RunSummary(NamedTuple):
    """The end of a run.

    Attributes:
        seconds: The duration of the run.
        reason: How the run has ended.
    """

    seconds: float
    reason: str


class JournalWriter:
    """Writes the ticks of a recorded run to a journal, with the same entries as `StatusWatch`.

    Attributes:
        ticks: The number of ticks so far.
        runs: The number of runs so far.
        ends: The ends of the runs so far.
    """

    def __init__(
        self,
        file: EntrySink,
        recording: Recording,
        nodes: list[RunNode],
        about: dict[str, object],
        of_run: dict[str, object],
    ) -> None:
        self._file, self._recording, self._nodes = file, recording, nodes
        self._about, self._of_run = about, of_run
        self._finder = TickFinder(nodes, recording)
        self.ticks = self.runs = 0
        self.ends: list[RunSummary] = []
        self._number = self._run = self._tick = self._last = 0
        self._is_open, self._began = False, 0.0
        self._rows: list[Row] = []
        self._logged = bytearray(len(nodes) + 1)
        self._unsure: set[int] = set()
        self._begin()

    @property
    def inferred_boundaries(self) -> int:
        """The number of possible tick boundaries that were decided only by a pause of ambiguous length."""
        return self._finder.unsure

    @property
    def root_has_ended(self) -> bool:
        """Whether the root has ended in the last run."""
        return self._root in (SUCCESS, FAILURE)

    def _begin(self) -> None:
        # For each node, the status in the journal, and the last tick in which it had a status other than IDLE.
        self._shown = [IDLE] * (len(self._nodes) + 1)
        self._ticked = [0] * (len(self._nodes) + 1)
        self._standing: set[int] = set()
        # For each node, the time when it last started, in microseconds.
        self._begun = [0] * (len(self._nodes) + 1)
        self._tick = self._root = 0

    def write(self, last_run: int | None = None) -> None:
        """Write the runs of the recording, up to and including the run with the given number; by default, all runs."""
        for tick in self._finder.ticks():
            self._write_ticks(tick)
            if self.runs == last_run and not self._is_open:
                return
        self._end_of_recording()

    def _end_of_recording(self) -> None:
        """End the open run at the end of the recording."""
        self.end_run()
        if not self._is_open or not self._recording.messages:
            return
        end = self.reported_end()
        if end is None:
            self._end(Ending.STOPPED, 1, "the recording ends before the end of the run")
        else:
            self._recording.flaws.append(_LAST_TICK_MISSING)
            self._end(end.ending, end.status, end.reason)

    def reported_end(self) -> RunEnd | None:
        """Return the end of the open run if Nav2 has logged it, but has not yet published the tick in which the tree has ended."""
        recording = self._recording
        if not self._is_open or self._root not in (IDLE, RUNNING):
            return None
        last = recording.times[-1] / 1e6
        at, end = next((each for each in recording.goal_ends if each[0] >= last), (last, None))
        if end is None:
            return None
        quoted = (
            quote_lines(self._lines_between(last - _LOGGED_BEFORE_SEC, at)) if end is GoalEnd.FAILED else ""
        )
        reason = f"Nav2 has reported '{end.value}'{f'. {quoted}' if quoted else ''}"
        # Only a run whose last tick is known ends with `Ending.OVER`.
        ending = Ending.FAILED if end is GoalEnd.FAILED else Ending.STOPPED
        return RunEnd(self._run, recording.began + at, ending, int(end is not GoalEnd.SUCCEEDED), reason)

    def _lines_between(self, first: float, last: float) -> Sequence[LoggedLine]:
        """Return the lines that were logged between two times, in seconds since the start of the recording."""
        lines = self._recording.lines
        begin = bisect_left(lines, first, key=lambda line: line.at)
        return lines[begin : bisect_right(lines, last, lo=begin, key=lambda line: line.at)]

    def write_next(self) -> bool:
        """Write the ticks that were recorded since the last call; return whether the root has failed in one of them."""
        has_failed = False
        for tick in self._finder.next_ticks():
            self._write_ticks(tick)
            has_failed |= tick.kind is TickKind.ENDS and self._root == FAILURE
        self._flush()
        return has_failed

    def end_run(self, reason: str = "") -> None:
        """End the open run if its root has ended. If a reason is given, end the run even if its root has not ended."""
        self._flush()
        if not self._is_open:
            return
        reported = self.reported_end() if reason else None
        if self._root not in (IDLE, RUNNING):
            word = WORDS[self._root]
            self._end(Ending.OVER, int(self._root != SUCCESS), f"the tree returned {word}")
        elif reported is not None:
            self._end(reported.ending, reported.status, reported.reason)
        elif reason:
            self._end(Ending.STOPPED, 1, reason)

    def _write_ticks(self, tick: RecordedTick) -> None:
        self._last = tick.behind - 1
        if tick.kind is not TickKind.HALT:
            if not self._is_open:
                self._begin_run(tick)
            self._write_tick(tick)
        elif self._is_open:
            self._end_by_halt()
        if tick.kind is TickKind.ENDS and self._recording.messages:
            self.end_run()  # each goal of Nav2 is a run of its own

    def _end_by_halt(self) -> None:
        """End the open run, whose tree the program has halted."""
        self.end_run()
        if not self._is_open:
            return
        at = self._recording.times[self._last] / 1e6
        is_canceled = any(
            end is GoalEnd.CANCELED and abs(time - at) < _REPORTED_SEC
            for time, end in self._recording.goal_ends
        )
        reason = "the goal was canceled" if is_canceled else "the program has halted the tree"
        self._end(Ending.STOPPED, 1, reason)

    def _begin_run(self, tick: RecordedTick) -> None:
        self._begin()
        self._is_open = True
        self.runs += 1
        wall = self._recording.began + self._recording.times[tick.first] / 1e6
        of_run = {**self._of_run, "time": self._recording.times[tick.first] / 1e6}
        self._began = wall
        self._run = self._file.begin_run(self._about, of_run, wall)

    def _end(self, ending: Ending, status: int, reason: str) -> None:
        self._flush()
        self._is_open = False
        wall = self._recording.began + self._recording.times[self._last] / 1e6
        self._file.write((), end=RunEnd(self._run, wall, ending, status, reason))
        self.ends.append(RunSummary(wall - self._began, reason))

    def _flush(self) -> None:
        self._file.write(self._rows)
        self._rows = []

    def _write_tick(self, tick: RecordedTick) -> None:
        self._tick += 1
        self.ticks += 1
        recording, count = self._recording, len(self._nodes)
        resting: list[int] = []
        now = {recording.uids[index]: index for index in range(tick.first, tick.behind)}
        for index, uid, status in self._shown_in(tick):
            was = self._shown[uid]
            if was in (IDLE, SUCCESS, FAILURE) and self._nodes[uid - 1].children:
                resting.append(uid)
            self._show(uid, status)
            if status == RUNNING or was in (IDLE, SUCCESS, FAILURE):
                self._begun[uid] = self._recording.times[index]
            if uid == 1:
                self._root = status
            is_reset = status in (SUCCESS, FAILURE) and recording.statuses[now[uid]] == IDLE
            more = ', "is_reset": true' if is_reset else ""
            self._row(index, uid, WORDS[status], more, is_unsure=index in self._unsure)
        for uid, index in now.items():
            self._show_ancestors(uid, index, now)
        for uid, index in sorted(now.items()):
            # In the journal, a node keeps its status until an ancestor restarts, although the log resets it earlier. Only halts are written.
            if 1 < uid <= count and recording.statuses[index] == IDLE and self._shown[uid] == RUNNING:
                self._row(index, uid, "HALTED", f', "last": {self._ticked[uid]}')
                self._show(uid, IDLE)
                resting.append(uid)
        gone = {
            each
            for uid in resting
            for each in self._standing
            if uid < each < self._finder.end_of(uid)
            and self._ticked[each] < self._tick
            and self._logged[each] == IDLE
        }
        for uid in sorted(gone):
            self._row(tick.behind - 1, uid, "IDLE", f', "last": {self._ticked[uid]}')
            self._show(uid, IDLE)
        if len(self._rows) >= _BATCH:
            self._flush()

    def _show_ancestors(self, uid: int, index: int, now: Mapping[int, int]) -> None:
        """Write the status RUNNING, where it is missing, for the ancestors of a running node.

        The status is missing if the recording begins in the middle of a run.
        """
        is_running = 0 < uid < len(self._shown) and self._recording.statuses[index] == RUNNING
        is_running &= index not in self._finder.skipped
        parent = self._nodes[uid - 1].parent if is_running else 0
        while parent and parent not in now and self._shown[parent] != RUNNING:
            self._row(index, parent, WORDS[RUNNING], "")
            self._show(parent, RUNNING)
            parent = self._nodes[parent - 1].parent

    def _show(self, uid: int, status: int) -> None:
        self._shown[uid] = status
        if status != IDLE:
            self._ticked[uid] = self._tick
        (self._standing.add if status in (SUCCESS, FAILURE) else self._standing.discard)(uid)

    def _shown_in(self, tick: RecordedTick) -> Iterator[tuple[int, int, int]]:
        """Yield the status changes of a tick that belong in a journal, each with its index, node number and status.

        A leaf's changes are all statuses that it has returned. Another node's change is its last status in the tick.
        """
        recording, nodes, skipped = self._recording, self._nodes, self._finder.skipped
        last: dict[int, int] = {}
        left_out: set[int] = set()
        self._unsure.clear()
        for index in range(tick.first, tick.behind):
            uid, status = recording.uids[index], recording.statuses[index]
            if not 0 < uid <= len(nodes):
                continue
            self._store_unsure(index)
            if status == IDLE:
                if not nodes[uid - 1].children:
                    last.pop(uid, None)  # a leaf that is halted and starts again returns a status twice
                continue
            before = last.get(uid)
            # A leaf that is RUNNING first and ends in the same tick has returned one status.
            if before is not None and (nodes[uid - 1].children or recording.statuses[before] == RUNNING):
                left_out.add(before)
            last[uid] = index
        for index in range(tick.first, tick.behind):
            uid, status = recording.uids[index], recording.statuses[index]
            if status != IDLE and 0 < uid <= len(nodes) and index not in left_out:
                yield index, uid, WORDS.index("SKIPPED") if index in skipped else status

    def _store_unsure(self, index: int) -> None:
        """Mark a change as uncertain if a precondition, and not the node itself, may have caused the change."""
        uid, status = self._recording.uids[index], self._recording.statuses[index]
        condition = _CONDITIONS.get(status)
        is_possible = condition in self._nodes[uid - 1].bound.element.attributes
        # Unlike other leaves, a coroutine logs SKIPPED when its precondition skips it.
        is_possible |= status == SKIPPED
        if is_possible and self._logged[uid] != RUNNING:
            self._unsure.add(index)
        self._logged[uid] = status

    def _row(self, index: int, uid: int, word: str, more: str, *, is_unsure: bool = False) -> None:
        time = self._recording.times[index] / 1e6
        rows = self._nodes[uid - 1].rows
        message = '""' if word != WORDS[FAILURE] or not self._recording.lines else self._reason(uid, time)
        for node in rows:
            self._number += 1
            if is_unsure and node == rows[-1]:
                more = ', "is_unsure": true'
            data = f'{{"node": {node}, "tick": {self._tick}, "status": "{word}", "message": {message}{more}}}'
            self._rows.append(Row(self._number, self._run, self._recording.began + time, time, STATUS, data))

    def _reason(self, uid: int, time: float) -> str:
        """Return the lines that servers have logged about the failure of an action, as a JSON string."""
        if self._nodes[uid - 1].bound.spec.kind is not Kind.ACTION:
            return '""'
        begun = self._begun[uid] / 1e6
        lines = self._lines_between(begun - _LOGGED_BEFORE_SEC, time + _LOGGED_AFTER_SEC)
        return json.dumps(quote_lines(lines, begun, time))
