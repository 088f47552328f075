"""Records the events and observations of the running mission."""

import os
import re
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from sar_compiler.journal.command_objects import OBJECT, RUN, SeenObjects, describe_change, run_identity
from sar_compiler.journal.display import Alarm, Display, LandmarkKind, changes_of_event, initial_display
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import (
    CHANGED,
    GOAL_ENDED,
    GOAL_SENT,
    RUN_BEGAN,
    RUN_ENDED,
    CommandAuthor,
    Ending,
    JournalEntry,
    Row,
    end_data,
)
from sar_compiler.journal.spill_file import RunEnd, SpilledEntries, SpillFile, lost_events_row
from sar_compiler.json_values import json_text
from sar_compiler.runtime.clock import Clock, WallClock
from sar_compiler.runtime.context import mission_context

if TYPE_CHECKING:
    from sar_compiler.journal.database import JournalFile

Listener = Callable[[JournalEntry], object]

# The interval between writes of observations, in seconds: a process that is killed may lose the observations of one interval.
_BATCH_SEC = 1.0

# The maximum numbers of events and observations in memory while the file cannot be written; further entries are only counted.
_MAX_FACTS, _MAX_WATCHED = 10_000, 20_000


class FactState(Protocol):
    """A state that is computed from events, such as the state of a mission."""

    def apply(self, fact: JournalEntry) -> None:
        """Apply an event to the state. Called in the run that records the event, and in all later runs.

        Raises:
            ArithmeticError, AttributeError, LookupError, TypeError or ValueError: If the event is impossible in this state.
        """
        ...

    def display(self) -> Display:
        """Return the display that shows this state."""
        ...

    def sentence(self, fact: JournalEntry) -> str:
        """Return a sentence about an event, or an empty string to use the default sentence."""
        ...


class SentGoal(NamedTuple):
    """An action goal that a run has sent, and whose end no run has recorded.

    Attributes:
        action: The action's full name.
        goal_id: The goal's ID, as 32 hexadecimal digits.
    """

    action: str
    goal_id: str


def _sent_goal(fact: JournalEntry) -> SentGoal:
    goal = SentGoal(str(fact.data.get("action")), str(fact.data.get("goal")))
    if not (
        re.fullmatch(r"(/[A-Za-z_]\w*)+", goal.action, re.ASCII)
        and re.fullmatch("[0-9a-f]{32}", goal.goal_id)
    ):
        message = f"event {fact.number} of the journal, {fact.kind} {dict(fact.data)}, does not describe an action goal"
        raise JournalError(message)
    return goal


@mission_context
class Journal:
    """The journal of the running mission: its events and observations.

    A leaf receives the journal of its run if its constructor has a parameter of this type. With `Journal | None = None`
    the leaf also works without a journal. All methods must be called in the thread of the node's executor.

    The mission continues while the file cannot be written, because the disk is full or another process has locked the file.
    Entries then wait in memory, events also in the journal's `SpillFile`, and writing is retried with each event and every
    second. `on_failure` reports the start of this state, and `on_recovery` its end.

    Args:
        file: The file, open and locked; None for a journal without a file.
        aside: The name under which the file is kept if it contains another mission; None to continue the file.
        apply: Applies each event to a state while no mission is attached.

    Attributes:
        aside: The name under which another mission's file is or will be kept; None if there is no other mission.
        is_resumed: Whether an earlier run started the mission.
        clock: The mission's clock.
        head: The head of the file's chain, as hexadecimal digits; empty before the run has ended.
        on_failure: Called with a sentence when the file cannot be written, or a listener has raised an exception.
        on_recovery: Called with a sentence when the file can be written again.
        leaf_in_hand: Returns the `leaf` that is currently ticked, and the `tick`; returns an empty mapping
            between two ticks.
    """

    def __init__(
        self,
        file: "JournalFile | None" = None,
        aside: Path | None = None,
        *,
        apply: Callable[[JournalEntry], object] = lambda _: None,
    ) -> None:
        self.clock: Clock = WallClock()
        self._apply = apply
        self._state: FactState | None = None
        self._kinds: tuple[LandmarkKind, ...] = ()
        self._shown = Display()
        # The alarms that do not come from the mission.
        self._alarms: list[Alarm] = []
        self.on_failure: Callable[[str], object] = lambda _: None
        self.on_recovery: Callable[[str], object] = lambda _: None
        self.leaf_in_hand: Callable[[], Mapping[str, int]] = dict
        # The author of the current command, and the kinds of the events recorded during the command.
        self._author, self._caused_kinds = CommandAuthor(), list[str]()
        self._file = file
        self.aside = aside
        self.head = ""
        known = file if aside is None else None
        runs = known.runs() if known is not None else []
        self.is_resumed = bool(runs)
        self._facts = [*known.events()] if known is not None else []
        self._about = known.description() if known is not None else {}
        self._has_begun = self.is_resumed
        # The number of the last event or observation. Entries are ordered by number, because the system's clock may change.
        self._number = known.last_number() if known is not None else 0
        # The number of the run, which entries before its start have too; 1 without a file.
        self._run = runs[-1].number + 1 if runs else 1
        self._is_written = False
        self._reserve: SpillFile | None = None
        self._numbers: dict[str, int] = {}
        # The entries to write, and the time at which the oldest observation was queued or the last attempt failed.
        self._watched: list[Row] = []
        self._pending: list[Row] = []
        self._end: RunEnd | None = None
        self._pending_since = 0.0
        self._is_failing = False
        self._omitted_count = 0
        self._began = 0.0
        self._run_about: Mapping[str, object] = {}
        self._listeners: list[Listener] = []
        self._notified_count = 0

    @property
    def is_kept(self) -> bool:
        """Whether the journal has a file."""
        return self._file is not None

    @property
    def is_wanted(self) -> bool:
        """Whether a file or a listener receives the entries."""
        return self.is_kept or bool(self._listeners)

    def add_listener(self, listener: Listener) -> None:
        """Register a function to call with each entry after it is written.

        The function is called in the thread of the mission, and must return quickly. If it raises an exception, it is not called again. In
        addition to events and observations it receives the run's start and end. `JournalFile.stream` yields the same entries from a file.
        """
        self._listeners.append(listener)

    @property
    def path(self) -> Path:
        """The path of the file, or an empty path if the journal has no file."""
        return self._file.path if self._file is not None else Path()

    @property
    def description(self) -> Mapping[str, object]:
        """The mission's description. It is empty until the mission's first run writes it."""
        return self._about

    def earlier(self) -> list[JournalEntry]:
        """Return the entries of earlier runs in order. Listeners do not receive these entries."""
        return [*self._file.stream()] if self._file is not None and self.is_resumed else []

    def earlier_events(self) -> list[JournalEntry]:
        """Return the events of earlier runs in order."""
        return list(self._facts)

    def active_goals(self) -> list[SentGoal]:
        """Return the goals of earlier runs that may still be active.

        Raises:
            JournalError: If the journal contains an invalid goal.
        """
        if self._file is None or not self._facts:
            return []
        # A goal that was considered lost and was then accepted is recorded twice.
        ends = Counter(entry.data.get("goal") for entry in self._file.observations(GOAL_ENDED))
        sent = [_sent_goal(fact) for fact in self._facts if fact.kind == GOAL_SENT]
        times = Counter(goal.goal_id for goal in sent)
        return [goal for goal in dict.fromkeys(sent) if times[goal.goal_id] > ends[goal.goal_id]]

    def attach(self, state: FactState, kinds: Iterable[LandmarkKind] = ()) -> None:
        """Apply the events of earlier runs to a state. Also apply each new event when it is recorded.

        Args:
            state: The initial state of a mission.
            kinds: The kinds of the mission's landmarks.

        Raises:
            JournalError: If an event of an earlier run is impossible in the state.
        """
        for fact in self.earlier_events():
            try:
                state.apply(fact)
            except (  # noqa: PERF203 - the error names the event
                ArithmeticError,
                AttributeError,
                LookupError,
                TypeError,
                ValueError,
            ) as error:
                raise JournalError(
                    f"event {fact.number} of the journal, {fact.kind} {dict(fact.data)}, contradicts the events before it: {error}"
                ) from error
        self._state, self._apply, self._kinds = state, state.apply, tuple(kinds)

    def begin(self, about: Mapping[str, object], run_about: Mapping[str, object]) -> None:
        """Start the run. After this call, the mission can be resumed.

        Args:
            about: The mission's description, by key; ignored if an earlier run has written one.
            run_about: The description of this run, by key.

        Raises:
            JournalError: If the file cannot be created or written.
        """
        of_run = {"pid": os.getpid(), "time": self.clock.now(), **run_about}
        self._about, self._has_begun, self._run_about = self._about or dict(about), True, of_run
        if self._file is not None:
            self._begin_in(self._file, about, of_run)
        self._notify(self._entry(RUN_BEGAN, {**self._about, "run": of_run}))
        if self._state is not None:
            self._apply(self._entry(RUN_BEGAN, of_run))
            self._shown = self._display()
            self.record_observation(CHANGED, **initial_display(self._kinds, self._shown))

    def _begin_in(
        self, file: "JournalFile", about: Mapping[str, object], of_run: Mapping[str, object]
    ) -> None:
        from sqlite3 import Error

        from sar_compiler.journal.database import JournalFile

        if self.aside is not None:
            file.move(self.aside)
            self._file = file = JournalFile.create(file.path)
        try:
            self._run, self._is_written = file.begin_run(about, of_run, time.time()), True
        except Error as error:
            raise JournalError(f"the journal {self.path} cannot be written: {error}") from error
        self._began = file.runs()[0].began
        self._reserve = file.reserve()
        self._reserve.replace_content(SpilledEntries(self._began), {})

    def record_event(self, kind: str, /, **data: object) -> None:
        """Record an event.

        The event is on disk when this function returns. The caller must not act on it before.

        Args:
            kind: The kind of the event, such as `photo_taken`.
            **data: The data of the event, as JSON values.

        Raises:
            TypeError: If a value is not a JSON value.
        """
        self._apply_event(self._entry(kind, data))

    def raise_alarm(self, text: str, kind: str, /, **data: object) -> None:
        """Record an event that does not come from the mission, and show an alarm from now on.

        Args:
            text: The text of the alarm, which is also the sentence of the event.
            kind: As for `record_event`.
            **data: As for `record_event`.

        Raises:
            TypeError: If a value is not a JSON value.
        """
        self._alarms.append(Alarm(text))
        self._apply_event(self._entry(kind, data), text)

    def _apply_event(self, fact: JournalEntry, sentence: str = "") -> None:
        self._apply(fact)
        author = self._author_data(fact.kind)
        changed = {**self._display_changes(fact, sentence), **author, **self.leaf_in_hand()}
        following = [fact._replace(kind=CHANGED, data=changed)] if changed else []
        if self._is_written:
            self._pending.append(self._row(fact))
            self._watched.extend(map(self._row, following))
            self._write()
        for entry in (fact, *following):
            self._notify(entry)

    def _entry(self, kind: str, data: Mapping[str, object]) -> JournalEntry:
        return JournalEntry(self._number + 1, self._run, time.time(), self.clock.now(), kind, data)

    def _display_changes(self, fact: JournalEntry, sentence: str = "") -> dict[str, object]:
        """Return how the display has changed since the last event, and a sentence about the new event."""
        if self._state is None and not self._alarms:
            return {}
        before, self._shown = self._shown, self._display()
        if self._state is not None:
            sentence = sentence or self._state.sentence(fact)
        return changes_of_event(fact, sentence, before, self._shown)

    def describe_change(self, command: str, seen: SeenObjects) -> str:
        """Describe the first object that has changed since the sender saw it, or return an empty string."""
        now = {RUN: run_identity(self._run, self._run_about), OBJECT: self._shown.objects.get(command, "")}
        landmarks = {f"{each.kind}/{each.name}": each for each in self._shown.landmarks}
        return describe_change(seen, now, landmarks)

    def _display(self) -> Display:
        shown = self._state.display() if self._state is not None else Display()
        return shown._replace(alarms=(*shown.alarms, *self._alarms)) if self._alarms else shown

    @contextmanager
    def ordered_by(self, author: CommandAuthor) -> Iterator[list[str]]:
        """Record a command's author and reason with every event that is recorded inside the `with` block.

        Yield a list to which the kind of each of these events is appended.
        """
        self._author, self._caused_kinds = author, []
        try:
            yield self._caused_kinds
        finally:
            self._author = CommandAuthor()

    @property
    def author(self) -> CommandAuthor:
        """The author of the current command.

        The name is empty if there is no command or the author is unknown.
        """
        return self._author

    def _author_data(self, kind: str) -> Mapping[str, str]:
        if not self._author.name:
            return {}
        self._caused_kinds.append(kind)
        by, reason = self._author
        return {"by": by, "reason": reason} if reason else {"by": by}

    def store_highest_number(self, kind: str, number: int) -> None:
        """Store the highest number in use. The next run then assigns higher numbers, even if events are lost.

        Args:
            kind: The kind of the numbered objects.
            number: The number, which may be a part of a name.
        """
        self._numbers[kind] = max(number, self._numbers.get(kind, 0))

    def record_observation(self, kind: str, /, **data: object) -> None:
        """Queue an observation, which the next write stores. It may be lost if the process is killed.

        Args:
            kind: The kind of the observation, such as `pose`.
            **data: The data of the observation, as JSON values.

        Raises:
            TypeError: If a value is not a JSON value.
        """
        entry = self._entry(kind, data)
        if self._is_written:
            if not self._watched and not self._is_failing:
                self._pending_since = time.monotonic()
            row = self._row(entry)
            if len(self._watched) < _MAX_WATCHED:
                self._watched.append(row)
            else:
                self._omitted_count += 1
            self.write_when_due()
        self._notify(entry)

    def write_when_due(self) -> None:
        """Write the queued entries if the oldest observation or the last failed write is a second old."""
        if (self._watched or self._is_failing) and time.monotonic() - self._pending_since >= _BATCH_SEC:
            self._write()

    def end_run(self, ending: Ending, status: int, reason: str = "") -> None:
        """Record the end of the run.

        Args:
            ending: The kind of end.
            status: The exit status.
            reason: The reason, as a sentence.
        """
        entry = self._entry(RUN_ENDED, end_data(ending, status, reason, ""))
        self._apply(entry)
        if changed := self._display_changes(entry):
            self.record_observation(CHANGED, **changed)
        if self._is_written:
            self._end = RunEnd(self._run, time.time(), ending, status, reason)
            self._write()
        self._notify(entry._replace(data=end_data(ending, status, reason, self.head)))

    def close(self) -> None:
        """Write the queued entries and close the file.

        If no run has started in the file, remove the file instead.
        """
        self._write()
        if self._is_failing:
            self.on_failure(
                f"The missing entries of the journal {self.path} are in the reserve file beside the journal. Keep both files together."
            )
        if self._reserve is not None:
            self._reserve.close(is_needed=self._is_failing)
        if self._file is not None and (self._has_begun or self.aside is not None):
            self._file.close()
        elif self._file is not None:
            self._file.remove()
        self._file, self._reserve, self._is_written = None, None, False

    def _notify(self, entry: JournalEntry) -> None:
        """Pass an entry to the listeners. Entries are numbered in the order in which they are passed."""
        if self._listeners:
            # A value that is not JSON also raises an error if there is no file.
            if not self._is_written:
                json_text(entry.data)
            self._notified_count += 1
            entry = JournalEntry(self._notified_count, *entry[1:])
            for listener in list(self._listeners):
                try:
                    listener(entry)
                except Exception as error:  # noqa: BLE001, PERF203 - a listener must not end a mission
                    self._listeners.remove(listener)
                    self.on_failure(f"A listener of the journal has failed and was removed: {error!r}.")

    def _row(self, entry: JournalEntry) -> Row:
        """Convert an entry to a row for the file, and assign the next number to the row."""
        self._number += 1
        _, run, wall, now, kind, data = entry
        return Row(self._number, run, wall, now, kind, json_text(data))

    def _write(self) -> None:
        file = self._file if self._is_written else None
        if file is None or not (self._watched or self._pending or self._end):
            return
        from sqlite3 import Error

        try:
            file.write(self._watched, self._pending, self._end)
        except Error as error:
            self._handle_write_error(error)
        else:
            if self._end is not None:
                # No entry may follow the end of the run, which closes the chain.
                self.head, self._is_written = file.head, False
            self._watched, self._pending, self._end = [], [], None
            self._recover()

    def _handle_write_error(self, error: Exception) -> None:
        # The entries stay queued, because a full disk must not stop a search for people.
        self._pending_since = time.monotonic()
        if len(self._pending) > _MAX_FACTS:
            self._pending[_MAX_FACTS - 1 :] = [
                lost_events_row(self._pending[_MAX_FACTS - 1 :], self._numbers)
            ]
        had_reserve = self._reserve is not None
        self._spill(SpilledEntries(self._began, self._pending, self._end))
        if self._is_failing and (self._reserve is not None or not had_reserve):
            return
        self._is_failing = True
        consequence = (
            "Until then, events are stored in the reserve file beside the journal."
            if self._reserve
            else "Until then, the mission cannot be resumed from its current state."
        )
        self.on_failure(
            f"The journal {self.path} cannot be written ({error}). The mission continues, and writing is retried every "
            f"second. {consequence}"
        )

    def _spill(self, spilled: SpilledEntries) -> None:
        """Write events to the reserve file. If this fails as well, close the reserve file."""
        if self._reserve is not None:
            try:
                self._reserve.replace_content(spilled, self._numbers)
            except OSError:
                self._reserve.close(is_needed=True)
                self._reserve = None

    def _recover(self) -> None:
        if not self._is_failing:
            return
        self._is_failing = False
        self._spill(SpilledEntries(self._began))
        lost = f" {self._omitted_count} observations were lost." if self._omitted_count else ""
        self._omitted_count = 0
        self.on_recovery(
            f"The journal {self.path} can be written again, and the waiting events have been written.{lost}"
        )
