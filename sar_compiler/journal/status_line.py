"""Determines the status line of a mission: the word, the severity, the start and the reason.

The page, the terminal, reports and `sar-journal show` display the status line.
"""

from typing import NamedTuple

from sar_compiler.journal.mission_state import MissionState, RunState
from sar_compiler.runtime.clock import clock_text

GOOD, QUIET, WARNING, ERROR = "good", "quiet", "warning", "error"
"""The severities of a status: normal operation, no activity, attention required, and error."""

NOT_BEGUN, DRIVING, WORKING, WAITING = "not begun", "driving", "working", "waiting"
PAUSED, LOST, CRASHED, POSITION_LOST = "paused", "lost", "crashed", "position lost"
COMPLETE, FAILED, STOPPED, ABORTED, ENDED_EARLY = "complete", "failed", "stopped", "aborted", "ended early"

# The words and severities of this module for phases of a mission.
_PHASES = {
    "held": (PAUSED, WARNING),
    "waiting": (WAITING, WARNING),
    "aborted": (ABORTED, WARNING),
    POSITION_LOST: (POSITION_LOST, ERROR),
}
# The words that are shown with their duration.
_WITH_DURATION = (PAUSED, WAITING, POSITION_LOST)
_LONG_SILENCE_SEC = 10.0
# The maximum number of awaited items in a list; further items are only counted.
_MAX_AWAITED = 3
_ENDS = {"over": FAILED, "stopped": STOPPED, "failed": FAILED}


class StatusLine(NamedTuple):
    """The status line of a mission.

    Attributes:
        word: A word of this module, or the mission's word for its phase.
        level: The severity: `good`, `quiet`, `warning` or `error`.
        since: The start of this status, in seconds of the mission's clock since the run's start.
        reason: The reason for this status, for operators; may be empty.
    """

    word: str = NOT_BEGUN
    level: str = QUIET
    since: float = 0.0
    reason: str = ""

    def to_line(self, now: float | None = None) -> str:
        """Return the status as one line of text, such as `PAUSED (0:19): by the operator`.

        Args:
            now: The current time, in seconds of the mission's clock since the run's start; None to omit the duration.
        """
        word = self.word.upper() if self.level in (WARNING, ERROR) else self.word
        lasts = (
            f" ({clock_text(now - self.since)})" if now is not None and self.word in _WITH_DURATION else ""
        )
        return f"{word}{lasts}{f': {self.reason}' if self.reason else ''}"


def status_line_text(state: MissionState) -> str:
    """Return the status line of a mission as text.

    The status is that at the time of the last journal entry.
    """
    return condition(state).to_line(state.now.time)


def condition(state: MissionState) -> StatusLine:
    """Return the status line of a mission."""
    if state.awaited:
        names = missing_names(state)
        return StatusLine(level=WARNING if names else QUIET, reason=f"waiting for {names}" if names else "")
    if not state.runs:
        return StatusLine(reason="the run has not started")
    run, process, now = state.runs[-1], state.process, state.now.time
    if run.ending:
        return _status_after_end(state, run)
    if process.is_gone:
        return StatusLine(CRASHED, ERROR, now, _crash_reason(state))
    # During a drive, the mission writes an entry every second of its clock.
    if process.silent_sec > _LONG_SILENCE_SEC and state.drive is not None:
        return StatusLine(LOST, ERROR, now, silence_text(process.silent_sec))
    phase = state.phase
    word, level = _PHASES.get(phase.name, (phase.name, GOOD))
    reason = phase.reason or {DRIVING: _drive(state), WORKING: phase.place}.get(word, "")
    return StatusLine(word, level, state.since_phase.time, reason)


def missing_names(state: MissionState) -> str:
    """Return the names of the items for which the next run still waits. The result may be empty."""
    names = [each.name for each in state.awaited if each.problem]
    more = f" and {len(names) - _MAX_AWAITED} more" if len(names) > _MAX_AWAITED else ""
    return f"{', '.join(names[:_MAX_AWAITED])}{more}"


def silence_text(seconds: float) -> str:
    """Return a sentence that reports for how long there was no contact with a mission."""
    return f"No contact for {clock_text(seconds)}. The robot may still be driving."


def _status_after_end(state: MissionState, run: RunState) -> StatusLine:
    since = run.ended.time if run.ended is not None else state.now.time
    if run.status == 0:
        # Without open points, the reason only repeats the word.
        return StatusLine(COMPLETE, GOOD, since, "" if run.reason == f"Mission {COMPLETE}." else run.reason)
    word = _ENDS.get(run.ending, run.ending)
    if state.situation.phase.name == ABORTED and word == FAILED:
        word = ABORTED
    # A person who ended the run by a command knows that the mission is incomplete, but not that a goal is orphaned.
    is_ordered = bool(state.order) and word in (FAILED, ABORTED)
    if is_ordered and word == FAILED:
        word = ENDED_EARLY
    level = QUIET if word == STOPPED else WARNING if is_ordered else ERROR
    if state.goals:
        level = ERROR
    # The operator's last command explains the missing items.
    by = f"{state.order[:1].upper()}{state.order[1:].rstrip('.')}. " if state.order else ""
    left = " The robot may still be driving." if state.goals else ""
    return StatusLine(word, level, since, f"{by}{run.reason}{left}".strip())


def _crash_reason(state: MissionState) -> str:
    """Describe when and where a run has crashed, and whether the robot may still be driving."""
    place = f"on the way {_drive(state)}" if state.drive is not None else state.situation.phase.place
    where = ", ".join(filter(None, (f"at {clock_text(state.now.time)}", place)))
    return f"{where}: the robot {'may still be' if state.goals else 'was not'} driving"


def _drive(state: MissionState) -> str:
    return "" if state.drive is None else f"to {state.drive.target}"
