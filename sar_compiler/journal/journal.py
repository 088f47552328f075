"""The journal of the running mission."""

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

# Interval between writes of observations, in seconds of the steady clock: a process that is killed may lose this much.
_BATCH_SEC = 1.0

# Limits of the memory that waits while the file cannot be written. Later entries are only counted.
_MOST_FACTS, _MOST_WATCHED = 10_000, 20_000


class FactState(Protocol):
    """A state computed from events, such as that of a mission."""

    def apply(self, fact: JournalEntry) -> None:
        """Apply an event to the state, in the run that writes it and in runs that resume.

        Raises:
            ArithmeticError, AttributeError, LookupError, TypeError or ValueError: If the event is impossible now.
        """
        ...

    def display(self) -> Display:
        """Return its display."""
        ...

    def sentence(self, fact: JournalEntry) -> str:
        """Return an event as a sentence; empty for the default words."""
        ...


class SentGoal(NamedTuple):
    """A goal that a run has sent, without an observed end.

    Attributes:
        action: The action's full name.
        goal_id: Its id, as 32 hexadecimal digits.
    """

    action: str
    goal_id: str


def _sent_goal(fact: JournalEntry) -> SentGoal:
    goal = SentGoal(str(fact.data.get("action")), str(fact.data.get("goal")))
    if not (
        re.fullmatch(r"(/[A-Za-z_]\w*)+", goal.action, re.ASCII)
        and re.fullmatch("[0-9a-f]{32}", goal.goal_id)
    ):
        message = (
            f"event {fact.number} of the journal, {fact.kind} {dict(fact.data)}, is not a goal of an action"
        )
        raise JournalError(message)
    return goal


@mission_context
class Journal:
    """The journal of the running mission: its events and observations.

    A leaf receives the journal of its run if its constructor has a parameter of this type. With `Journal | None = None`
    it also works without a journal. All calls belong in the thread of the node's executor.

    While the file cannot be written, because the disk is full or another process has locked it, the mission continues.
    Entries wait in memory, events also in the journal's `SpillFile`, and writing is tried again with each event and each
    second. `on_failure` reports the start of this state, and `on_recovery` its end.

    Args:
        file: The file, open and locked; None for a journal without a file, such as the initial one of a mission's state.
        aside: The backup name of the file if it is another mission's and a new one follows; None to continue the file.
        apply: Applies each event to a state, if no mission is attached.

    Attributes:
        aside: The name that the file has or will have, because it is another mission's.
        is_resumed: Whether an earlier run started the mission.
        clock: The mission's clock.
        head: The head of the file's chain, as hexadecimal digits; empty before the run has ended.
        on_failure: Called with a sentence when the file cannot be written, or a listener has raised.
        on_recovery: Called with a sentence when the file can be written again.
        leaf_in_hand: Returns which `leaf` records an event now, in which `tick`; nothing between two ticks.
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
        # Kinds that do not belong to a mission.
        self._alarms: list[Alarm] = []
        self.on_failure: Callable[[str], object] = lambda _: None
        self.on_recovery: Callable[[str], object] = lambda _: None
        self.leaf_in_hand: Callable[[], Mapping[str, int]] = dict
        # The author of the present command, and the kinds recorded under it.
        self._author, self._led_to = CommandAuthor(), list[str]()
        self._file = file
        self.aside = aside
        self.head = ""
        known = file if aside is None else None
        self.is_resumed = known is not None and bool(known.runs())
        self._facts = [*known.events()] if known is not None else []
        self._about = known.description() if known is not None else {}
        self._has_begun = self.is_resumed
        # The time of the last entry, of events and observations. The system's clock may change.
        self._number = known.last_number() if known is not None else 0
        # The number of the run, also without a file.
        self._run = 1
        self._is_written = False
        self._reserve: SpillFile | None = None
        self._numbers: dict[str, int] = {}
        # Pending entries, and since when the oldest observation waits, or the time of the last attempt.
        self._watched: list[Row] = []
        self._pending: list[Row] = []
        self._end: RunEnd | None = None
        self._pending_since = 0.0
        self._is_failing = False
        self._left_out = 0
        self._began = 0.0
        self._run_about: Mapping[str, object] = {}
        self._listeners: list[Listener] = []
        self._told = 0

    @property
    def is_kept(self) -> bool:
        """Whether it has a file."""
        return self._file is not None

    @property
    def is_wanted(self) -> bool:
        """Whether entries are used: there is a file or a listener."""
        return self.is_kept or bool(self._listeners)

    def add_listener(self, listener: Listener) -> None:
        """Register a function to call with each entry after it is written.

        It is called in the thread of the mission, and must return at once. A function that raises an error is not called again. In addition to
        events and observations it receives the run's start and end; `JournalFile.stream` yields the same from a file.
        """
        self._listeners.append(listener)

    @property
    def path(self) -> Path:
        """Its path."""
        return self._file.path if self._file is not None else Path()

    @property
    def description(self) -> Mapping[str, object]:
        """The mission's description, which its first run writes; empty before."""
        return self._about

    def earlier(self) -> list[JournalEntry]:
        """Return the entries of earlier runs in order, which `add_listener` does not deliver."""
        return [*self._file.stream()] if self._file is not None and self.is_resumed else []

    def earlier_events(self) -> list[JournalEntry]:
        """Return the events of earlier runs in order."""
        return list(self._facts)

    def active_goals(self) -> list[SentGoal]:
        """Return the goals of earlier runs that may still be active.

        Raises:
            JournalError: If it contains an impossible goal.
        """
        if self._file is None or not self._facts:
            return []
        # A goal that was considered lost and then accepted is in it twice.
        ends = Counter(entry.data.get("goal") for entry in self._file.observations(GOAL_ENDED))
        sent = [_sent_goal(fact) for fact in self._facts if fact.kind == GOAL_SENT]
        times = Counter(goal.goal_id for goal in sent)
        return [goal for goal in dict.fromkeys(sent) if times[goal.goal_id] > ends[goal.goal_id]]

    def attach(self, state: FactState, kinds: Iterable[LandmarkKind] = ()) -> None:
        """Apply the events of earlier runs to a state now, and each new event when it is recorded.

        Args:
            state: The state of a mission that has just started.
            kinds: The kinds of its landmarks.

        Raises:
            JournalError: If the events do not belong to such a mission.
        """
        for fact in self.earlier_events():
            try:
                state.apply(fact)
            except (  # noqa: PERF203 - which fact it is is said
                ArithmeticError,
                AttributeError,
                LookupError,
                TypeError,
                ValueError,
            ) as error:
                raise JournalError(
                    f"event {fact.number} of the journal, {fact.kind} {dict(fact.data)}, does not fit: {error}"
                ) from error
        self._state, self._apply, self._kinds = state, state.apply, tuple(kinds)

    def begin(self, about: Mapping[str, object], run_about: Mapping[str, object]) -> None:
        """Start the run; from then on it can be resumed.

        Args:
            about: The mission's description, by key; the values of an earlier run are kept.
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
        """Record an event. It is on disk when this returns; act on it only then.

        Args:
            kind: Its kind, such as `photo_taken`.
            **data: Its data, as JSON values.

        Raises:
            TypeError: If a value is no JSON value.
        """
        self._apply_event(self._entry(kind, data))

    def raise_alarm(self, text: str, kind: str, /, **data: object) -> None:
        """Record an event from outside the mission, and show an alarm from then on.

        Args:
            text: The alarm, which is also the sentence of the event.
            kind: As for `record_event`.
            **data: As for `record_event`.

        Raises:
            TypeError: If a value is no JSON value.
        """
        self._alarms.append(Alarm(text))
        self._apply_event(self._entry(kind, data), text)

    def _apply_event(self, fact: JournalEntry, sentence: str = "") -> None:
        self._apply(fact)
        order = self._order(fact.kind)
        changed = {**self._display_changes(fact, sentence), **order, **self.leaf_in_hand()}
        behind = [fact._replace(kind=CHANGED, data=changed)] if changed else []
        if self._is_written:
            self._pending.append(self._row(fact))
            self._watched.extend(map(self._row, behind))
            self._write()
        for entry in (fact, *behind):
            self._notify(entry)

    def _entry(self, kind: str, data: Mapping[str, object]) -> JournalEntry:
        return JournalEntry(self._number + 1, self._run, time.time(), self.clock.now(), kind, data)

    def _display_changes(self, fact: JournalEntry, sentence: str = "") -> dict[str, object]:
        """Return the changes of the display by an event, with the event as a sentence."""
        if self._state is None and not self._alarms:
            return {}
        before, self._shown = self._shown, self._display()
        if self._state is not None:
            sentence = sentence or self._state.sentence(fact)
        return changes_of_event(fact, sentence, before, self._shown)

    def describe_change(self, command: str, seen: SeenObjects) -> str:
        """Return the change since the sender of a command saw its objects; empty if there is none."""
        now = {RUN: run_identity(self._run, self._run_about), OBJECT: self._shown.objects.get(command, "")}
        landmarks = {f"{each.kind}/{each.name}": each for each in self._shown.landmarks}
        return describe_change(seen, now, landmarks)

    def _display(self) -> Display:
        shown = self._state.display() if self._state is not None else Display()
        return shown._replace(alarms=(*shown.alarms, *self._alarms)) if self._alarms else shown

    @contextmanager
    def ordered_by(self, author: CommandAuthor) -> Iterator[list[str]]:
        """Record a command's author and reason with the events of this block; yield the list of their kinds."""
        self._author, self._led_to = author, []
        try:
            yield self._led_to
        finally:
            self._author = CommandAuthor()

    @property
    def author(self) -> CommandAuthor:
        """The author of the current command; without a name if there is no command, or its author is unknown."""
        return self._author

    def _order(self, kind: str) -> Mapping[str, str]:
        if not self._author.name:
            return {}
        self._led_to.append(kind)
        by, reason = self._author
        return {"by": by, "reason": reason} if reason else {"by": by}

    def store_highest_number(self, kind: str, number: int) -> None:
        """Record the highest number in use, for example in names: the next run continues above it even if events are lost.

        Args:
            kind: The numbered kind.
            number: The number.
        """
        self._numbers[kind] = max(number, self._numbers.get(kind, 0))

    def record_observation(self, kind: str, /, **data: object) -> None:
        """Queue an observation for the next write; it may be lost when the process is killed.

        Args:
            kind: Its kind, such as `pose`.
            **data: Its data, as JSON values.

        Raises:
            TypeError: If a value is no JSON value.
        """
        entry = self._entry(kind, data)
        if self._is_written:
            if not self._watched and not self._is_failing:
                self._pending_since = time.monotonic()
            row = self._row(entry)
            if len(self._watched) < _MOST_WATCHED:
                self._watched.append(row)
            else:
                self._left_out += 1
            self.write_when_due()
        self._notify(entry)

    def write_when_due(self) -> None:
        """Write the queue if its oldest entry or the last failed attempt is a second old."""
        if (self._watched or self._is_failing) and time.monotonic() - self._pending_since >= _BATCH_SEC:
            self._write()

    def end_run(self, ending: Ending, status: int, reason: str = "") -> None:
        """Record the end of the run.

        Args:
            ending: The kind of end.
            status: The exit status.
            reason: The reason in a sentence.
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
        """Write the queue, and close the file; remove a file in which no run has started."""
        self._write()
        if self._is_failing:
            self.on_failure(
                f"The missing entries of the journal {self.path} are in the reserve beside it. Keep both files together."
            )
        if self._reserve is not None:
            self._reserve.close(is_needed=self._is_failing)
        if self._file is not None and (self._has_begun or self.aside is not None):
            self._file.close()
        elif self._file is not None:
            self._file.remove()
        self._file, self._reserve, self._is_written = None, None, False

    def _notify(self, entry: JournalEntry) -> None:
        """Pass an entry to the listeners, with its number in their stream."""
        if self._listeners:
            # A value that is not JSON is the caller's error even without a file.
            if not self._is_written:
                json_text(entry.data)
            self._told += 1
            entry = JournalEntry(self._told, *entry[1:])
            for listener in list(self._listeners):
                try:
                    listener(entry)
                except Exception as error:  # noqa: BLE001, PERF203 - who only watches must not end a mission
                    self._listeners.remove(listener)
                    self.on_failure(f"A listener of the journal has failed and was removed: {error!r}.")

    def _row(self, entry: JournalEntry) -> Row:
        """Return an entry to write, with the next number."""
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
            self._wait(error)
        else:
            if self._end is not None:
                # Nothing may follow the end of the run, which closes the chain.
                self.head, self._is_written = file.head, False
            self._watched, self._pending, self._end = [], [], None
            self._recover()

    def _wait(self, error: Exception) -> None:
        # A full disk must not stop a search for people.
        self._pending_since = time.monotonic()
        if len(self._pending) > _MOST_FACTS:
            self._pending[_MOST_FACTS - 1 :] = [
                lost_events_row(self._pending[_MOST_FACTS - 1 :], self._numbers)
            ]
        had_reserve = self._reserve is not None
        self._spill(SpilledEntries(self._began, self._pending, self._end))
        if self._is_failing and (self._reserve is not None or not had_reserve):
            return
        self._is_failing = True
        beside = (
            "events are stored beside it"
            if self._reserve
            else "until then the mission cannot be resumed from here"
        )
        self.on_failure(
            f"The journal {self.path} cannot be written ({error}). The mission continues, writing is retried each "
            f"second, and {beside}."
        )

    def _spill(self, kept: SpilledEntries) -> None:
        """Write events to the reserve; raise an error if that is impossible, too."""
        if self._reserve is not None:
            try:
                self._reserve.replace_content(kept, self._numbers)
            except OSError:
                self._reserve.close(is_needed=True)
                self._reserve = None

    def _recover(self) -> None:
        if not self._is_failing:
            return
        self._is_failing = False
        self._spill(SpilledEntries(self._began))
        without = f", without {self._left_out} observations" if self._left_out else ""
        self._left_out = 0
        self.on_recovery(
            f"The journal {self.path} is written again, including the events of the meantime{without}."
        )
