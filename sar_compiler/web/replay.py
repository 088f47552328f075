"""Computes, for a replay page, the state of missions at any time from the missions' journals.

The state at a time is computed from the nearest earlier checkpoint, which contains the packed state after a number of entries.
Checkpoints are created when a journal is opened, and kept in memory. The journals are not changed.
"""

import bisect
import pickle
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sar_compiler.journal.database import JournalFile, StreamPosition, is_locked
from sar_compiler.journal.journal_entries import RUN_BEGAN, JournalEntry
from sar_compiler.journal.mission_state import RunProcess
from sar_compiler.web.page_state import PageState, all_changes

Explain = Callable[[Path], Mapping[str, Any] | None]
"""Returns the cause of a mission's failure according to its journal, or None if the mission has not failed."""

# Missions are regarded as unrelated if the clocks of their robots differ by more than this time, in seconds.
_UNRELATED_SEC = 24 * 3600
# The minimum number of entries between checkpoints, and the maximum number of checkpoints.
_MIN_ENTRIES, _MAX_CHECKPOINTS = 2000, 400


class TrackPosition(NamedTuple):
    """A position in a robot's track. The track leaves out the time between runs.

    Attributes:
        entry: The position in the journal's stream.
        end: The time of the position, in seconds since the start of the first run.
        began: The time of the mission's clock at the start of the run at this position.
        before: The start of the run at this position, in seconds since the start of the first run.
    """

    entry: StreamPosition = StreamPosition()
    end: float = 0.0
    began: float = 0.0
    before: float = 0.0

    def next_position(self, entry: JournalEntry) -> "TrackPosition":
        """Return the position after the next entry."""
        began, before = (entry.time, self.end) if entry.kind == RUN_BEGAN else (self.began, self.before)
        end = max(self.end, before + entry.time - began)
        return TrackPosition(self.entry.next_position(entry), end, began, before)


class Checkpoint(NamedTuple):
    """A stored state at a position of the track.

    Attributes:
        at: The position in the track.
        packed: The compressed state.
    """

    at: TrackPosition
    packed: bytes


class ReplayTrack:
    """The recorded states of one journal.

    Args:
        path: The journal.
        explain: Returns the cause of the mission's failure.

    Attributes:
        first: The time of the mission's clock at the start of the track; None if no run has started.
        last: The position of the end of the track.
        shift: The time between the start of the replay and the start of the track, in seconds.

    Raises:
        JournalError: If the journal cannot be read.
    """

    def __init__(self, path: Path, explain: Explain) -> None:
        self._path = path
        # The lock is checked first, because the check releases the locks of other readers of the file in this process.
        self._is_written = is_locked(path)
        self.shift = 0.0
        self.first: float | None = None
        self._checkpoints: list[Checkpoint] = []
        self.last = TrackPosition()
        self._create_checkpoints()
        self.why: Mapping[str, Any] | None = None if self.first is None else explain(path)
        self._state, self._position = self._new_state(), TrackPosition()

    def _new_state(self) -> PageState:
        return PageState(journal=str(self._path))

    def _create_checkpoints(self) -> None:
        state, position = self._new_state(), TrackPosition()
        with JournalFile.open_snapshot(self._path) as file:
            every = max(_MIN_ENTRIES, file.last_number() // _MAX_CHECKPOINTS)
            for number, entry in enumerate(file.stream_after(StreamPosition())):
                if self.first is None:
                    self.first = entry.time
                if number and number % every == 0:
                    state.resend()
                    self._checkpoints.append(Checkpoint(position, _pack(state)))
                position = position.next_position(entry)
                state.apply(entry)
        self.last = position

    def state_at(self, time: float, robot: int) -> PageState:
        """Return the state at a time in seconds since the replay's start. The next call changes the returned object.

        The state of the last call is advanced if it is near enough; otherwise a checkpoint is restored.
        """
        until = min(time - self.shift, self.last.end)
        before = bisect.bisect_right(self._checkpoints, until, key=lambda each: each.at.end)
        # Playback advances the state even over a checkpoint, because the changes are smaller than the full state.
        nearest = self._checkpoints[before - 2].at if before > 1 else TrackPosition()
        if self._position.entry < nearest.entry or self._position.end > until:
            self._state, self._position = self._restore(before)
        if until >= 0.0:
            self._advance(until)
            self._state.let_pass(until - self._position.end)
        self._state.robot = robot
        is_last = self._position.entry >= self.last.entry
        # The journal itself contains the end of a run that has ended.
        self._state.set_process(RunProcess(is_gone=is_last and not self._is_written))
        if self.why is not None and is_last:
            self._state.set_why(self.why)
        return self._state

    def _restore(self, count: int) -> tuple[PageState, TrackPosition]:
        """Return the state and position of checkpoint number *count*, or of the start if *count* is 0."""
        if not count:
            return self._new_state(), TrackPosition()
        position, packed = self._checkpoints[count - 1]
        return _unpack(packed), position

    def _advance(self, until: float) -> None:
        with JournalFile.open_snapshot(self._path) as file:
            for entry in file.stream_after(self._position.entry):
                position = self._position.next_position(entry)
                # The mission may have continued in this journal since the journal was opened.
                if position.end > until or position.entry > self.last.entry:
                    break
                self._state.apply(entry)
                self._position = position


class Replay:
    """The recorded states of several robots at the same time.

    Args:
        paths: The journals, one for each robot.
        explain: Returns the cause of a mission's failure.

    Attributes:
        end: The length of the replay, in seconds.

    Raises:
        JournalError: If a journal cannot be read.
    """

    def __init__(self, paths: Sequence[Path], explain: Explain = lambda _: None) -> None:
        self._tracks = [ReplayTrack(path, explain) for path in paths]
        firsts = [track.first for track in self._tracks if track.first is not None]
        begin = min(firsts, default=0.0)
        for track in self._tracks:
            later = (track.first or begin) - begin
            track.shift = later if later < _UNRELATED_SEC else 0.0
        self.end = max((track.shift + track.last.end for track in self._tracks), default=0.0)
        self._number = 0

    def moment(self, time: float, since: int = 0) -> dict[str, Any]:
        """Return the state at a time as JSON values: `number` and `time` of the state, and `changes` for each robot.

        Args:
            time: The time, in seconds since the start of the replay.
            since: The number of the last state that the page has received. The result contains the changes since this state if no other
                state was requested in between, otherwise the full state.

        Raises:
            JournalError: If a journal has become unreadable.
        """
        states = [track.state_at(time, robot) for robot, track in enumerate(self._tracks)]
        if since != self._number:
            for state in states:
                state.resend()
        self._number += 1
        return {"number": self._number, "time": time, "changes": all_changes(states)}


def _pack(state: PageState) -> bytes:
    return zlib.compress(pickle.dumps(state, protocol=5), 1)


def _unpack(packed: bytes) -> PageState:
    state: PageState = pickle.loads(zlib.decompress(packed))  # noqa: S301 - this process has packed it
    return state
