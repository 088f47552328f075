"""The recorded states of journals at any time, for a replay page.

The state at a time is folded from the nearest earlier checkpoint: the state itself, packed, after a number of entries.
Checkpoints are created when a journal is opened, and kept in memory. The journal is only read.
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
"""Returns the cause of a mission's failure from a journal, as JSON values; None if it has not failed."""

# Robots whose clocks differ by more are unrelated, in seconds.
_APART = 24 * 3600
# The minimum number of entries between checkpoints, and the maximum number of checkpoints.
_LEAST, _CHECKPOINTS = 2000, 400


class TrackPosition(NamedTuple):
    """A position in a robot's track, which omits the time between runs.

    Attributes:
        entry: The position in the journal's stream.
        end: The time there, in seconds since the first run's beginning.
        began: The time of the mission's clock at the start of the present run.
        before: The time of that start, in seconds since the first run's start.
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
    """A saved state at a position of the track.

    Attributes:
        place: The position.
        packed: The state.
    """

    place: TrackPosition
    packed: bytes


class ReplayTrack:
    """The recorded states of one journal.

    Args:
        path: The journal.
        explain: Returns the cause of its mission's failure.

    Attributes:
        first: The time of the mission's clock at its start; None if no run has started.
        last: The position of its end.
        shift: The delay of its start after the replay's, in seconds.

    Raises:
        JournalError: If it cannot be read.
    """

    def __init__(self, path: Path, explain: Explain) -> None:
        self._path = path
        # Before all else: it releases the locks of other readers of the file in this process.
        self._is_written = is_locked(path)
        self.shift = 0.0
        self.first: float | None = None
        self._checkpoints: list[Checkpoint] = []
        self.last = TrackPosition()
        self._make()
        self.why: Mapping[str, Any] | None = None if self.first is None else explain(path)
        self._state, self._place = self._new_state(), TrackPosition()

    def _new_state(self) -> PageState:
        return PageState(journal=str(self._path))

    def _make(self) -> None:
        state, place = self._new_state(), TrackPosition()
        with JournalFile.open_snapshot(self._path) as file:
            every = max(_LEAST, file.last_number() // _CHECKPOINTS)
            for number, entry in enumerate(file.stream_after(StreamPosition())):
                if self.first is None:
                    self.first = entry.time
                if number and number % every == 0:
                    state.resend()
                    self._checkpoints.append(Checkpoint(place, _pack(state)))
                place = place.next_position(entry)
                state.apply(entry)
        self.last = place

    def state_at(self, time: float, robot: int) -> PageState:
        """Return the state at a time, in seconds since the replay's start; the next call changes it.

        The last state is advanced if it is near enough. Otherwise a checkpoint is restored.
        """
        until = min(time - self.shift, self.last.end)
        before = bisect.bisect_right(self._checkpoints, until, key=lambda each: each.place.end)
        # Playback advances the state, also over a checkpoint: the changes are smaller than the full state.
        nearest = self._checkpoints[before - 2].place if before > 1 else TrackPosition()
        if self._place.entry < nearest.entry or self._place.end > until:
            self._state, self._place = self._state_at(before)
        if until >= 0.0:
            self._advance(until)
            self._state.let_pass(until - self._place.end)
        self._state.robot = robot
        is_last = self._place.entry >= self.last.entry
        # The journal itself contains the end of a run that has ended.
        self._state.set_process(RunProcess(is_gone=is_last and not self._is_written))
        if self.why is not None and is_last:
            self._state.set_why(self.why)
        return self._state

    def _state_at(self, count: int) -> tuple[PageState, TrackPosition]:
        """Return the state of the last of the first *count* checkpoints, and its position."""
        if not count:
            return self._new_state(), TrackPosition()
        place, packed = self._checkpoints[count - 1]
        return _unpack(packed), place

    def _advance(self, until: float) -> None:
        with JournalFile.open_snapshot(self._path) as file:
            for entry in file.stream_after(self._place.entry):
                place = self._place.next_position(entry)
                # A mission may have continued in this journal since.
                if place.end > until or place.entry > self.last.entry:
                    break
                self._state.apply(entry)
                self._place = place


class Replay:
    """The recorded states of several robots side by side, a journal for each.

    Args:
        paths: The journals.
        explain: Returns the cause of a mission's failure.

    Attributes:
        end: Its length, in seconds.

    Raises:
        JournalError: If one cannot be read.
    """

    def __init__(self, paths: Sequence[Path], explain: Explain = lambda _: None) -> None:
        self._tracks = [ReplayTrack(path, explain) for path in paths]
        firsts = [track.first for track in self._tracks if track.first is not None]
        begin = min(firsts, default=0.0)
        for track in self._tracks:
            later = (track.first or begin) - begin
            track.shift = later if later < _APART else 0.0
        self.end = max((track.shift + track.last.end for track in self._tracks), default=0.0)
        self._number = 0

    def moment(self, time: float, since: int = 0) -> dict[str, Any]:
        """Return the state at a time as JSON values: its `number`, its `time`, and `changes` for each robot.

        Args:
            time: The time, in seconds since the start.
            since: The number of the client's last state. The result has the changes since then if no other state was
                requested in between, else the full state.

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
    state: PageState = pickle.loads(zlib.decompress(packed))  # noqa: S301 - of this process
    return state
