"""Defines the entries of a journal and the kinds of entries."""

import time
from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

GOAL_SENT, GOAL_ENDED = "goal_sent", "goal_ended"
"""The kinds of entries about the action goals that leaves send. Missions define further kinds of entries."""

FACTS_LOST = "facts_lost"
"""The kind of an event that replaces events that could not be written. Its data are the `count` of lost events, and
the highest `numbers` in use (`Journal.store_highest_number`)."""

RUN_BEGAN = "run_began"
"""The kind of a run's first entry. Its data are the mission's description and, in `run`, the description of the run itself."""

RUN_ENDED = "run_ended"
"""The kind of a run's last entry. Its data are the `ending`, `status` and `reason` and, if there is a chain, the
`head` of the journal's chain."""

ORDERED = "ordered"
"""The kind of an observation of a command to the mission. Its data are the command's `verb` and `label`, the author
`by` if known, the `reason`, the `refusal` (empty if the command was accepted), and `is_told` (whether other
events already show the command)."""

PROPERTIES_WATCHED, PROPERTIES_OWED = "properties_watched", "properties_owed"
"""The kinds of observations about the monitored properties. `properties_watched` is written once. It contains the
`file`, the `properties` of the file (each with `name` and the reaction `if_broken`), and the names `left_out`.
`properties_owed` is written after every change. It contains the names `owed` of the properties that have a pending
obligation."""

PROPERTY_BROKEN, ASSUMPTION_FAILED = "property_broken", "assumption_failed"
"""The kinds of events that the runtime monitor records. `property_broken` names the violated `property`, and the
`event` that violated it or the obligation that is still `owed` at the end. `assumption_failed` names the `assumption`
that an outcome contradicts. Both contain the `tick`, the `node` (the leaf's number, or null) and the `run`, which
lists the preceding events, each with time in seconds, tick, node and event."""

LEAF_RAISED = "leaf_raised"
"""The kind of an entry about a leaf's exception, which ends the run. Its data are the `node`, which is the leaf's
number or null, and the `text`."""

CHANGED = "changed"
"""The kind of the entry that follows an event. It contains a sentence about the event, and the changes of the display."""

STATUS, LACKS, BREAKPOINT = "status", "lacks", "breakpoint"
"""The kinds of observations about a node's status, the reason why the robot cannot drive, and the breakpoint that pauses the tree."""

PROGRESS = "progress"
"""The kind of observations about the progress of a drive."""

POSE, PLAN, MAP, LOG = "pose", "plan", "map", "log"
"""The kinds of observations about the robot's pose, planned path, map and log."""

BATTERY = "battery"
"""The kind of observations about the robot's battery."""
OF_ROBOT = (POSE, PLAN, MAP, BATTERY, LOG)
"""All kinds of observations from the robot's topics."""

OF_EVERY_MISSION = (RUN_BEGAN, RUN_ENDED, FACTS_LOST, GOAL_SENT, PROPERTY_BROKEN, ASSUMPTION_FAILED)
"""The kinds of events that every mission's state receives in addition to the kinds that the mission declares."""


_NUMBERS: dict[str, type] = dict.fromkeys(("node", "leaf", "tick", "last"), int)
_TEXTS: dict[str, type] = dict.fromkeys(("status", "message", "label"), str)
_VALUE_TYPES: dict[str, dict[str, type]] = {
    STATUS: {**_NUMBERS, **_TEXTS},
    CHANGED: _NUMBERS,
    PROPERTY_BROKEN: _NUMBERS,
    ASSUMPTION_FAILED: _NUMBERS,
    RUN_BEGAN: dict.fromkeys(("tree_id", "tree_file"), str),
}
"""The required types of values, by kind of entry and name of the value. Values may be missing. Except in `status` entries,
they may also be null."""


def check_value_types(kind: str, data: Mapping[str, Any]) -> None:
    """Check the types of the values in an entry. The file of the entry may have been altered.

    Raises:
        TypeError: If a value has a type that the project never writes.
    """
    types = _VALUE_TYPES.get(kind, {})
    for name, value in data.items() if types else ():
        wanted = types.get(name)
        # `isinstance` would accept a bool as an integer.
        if wanted is not None and type(value) is not wanted and (value is not None or kind == STATUS):
            expected = "an integer" if wanted is int else "a string"
            raise TypeError(f"'{name}' of an entry '{kind}' is {value!r:.40} instead of {expected}")


def day_and_time(wall: float, form: str = "%Y-%m-%d %H:%M:%S") -> str:
    """Format seconds since 1970 as local date and time.

    If the time is out of range, return it as a number.
    """
    try:
        return time.strftime(form, time.localtime(wall))
    except (OSError, OverflowError, ValueError):
        return f"{wall:g}"


class CommandAuthor(NamedTuple):
    """The author of a command, and the reason for the command.

    Attributes:
        name: A person, a program or a property, in words, such as `Ann (page, 127.0.0.1)`; empty if the
            author is unknown.
        reason: The reason that the author has stated; empty if there is none.
    """

    name: str = ""
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}" if self.reason else self.name

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> "CommandAuthor":
        """Return the author that the values `by` and `reason` of an entry describe."""
        return cls(str(data.get("by") or ""), str(data.get("reason") or ""))


class JournalEntry(NamedTuple):
    """An entry of a journal: an event or an observation.

    Attributes:
        number: The entry's number in the journal, in chronological order. In a stream, entries are numbered
            from the start of the stream.
        run: The number of the run that wrote the entry, from 1.
        wall: The time of writing, in seconds since 1970.
        time: The time of the mission's clock, in seconds.
        kind: The entry's kind, such as `photo_taken`.
        data: The entry's data, as JSON values.
    """

    number: int
    run: int
    wall: float
    time: float
    kind: str
    data: Mapping[str, Any]


class Row(NamedTuple):
    """An entry that is to be written. Events and observations share one sequence of numbers."""

    number: int
    run: int
    wall: float
    time: float
    kind: str
    data: str


class Ending(str, Enum):
    """The kind of a run's end."""

    OVER = "over"
    """The end condition was met. The mission is over, even if it is not complete."""
    STOPPED = "stopped"
    """A signal has stopped the run. The mission can be resumed."""
    FAILED = "failed"
    """An exception in a leaf or in the engine has ended the run."""


class JournalRun(NamedTuple):
    """One run of the mission, executed by one process.

    Attributes:
        number: The number of the run, from 1.
        began: The start, in seconds since 1970.
        about: The description of the run: `version`, `pid`, `parameters`, the `time` of the mission's clock at the start, and so on.
        ended: The end, in seconds since 1970; None if the run has crashed or still continues.
        ending: The kind of end; None if the run has crashed or still continues.
        status: The exit status.
        reason: The reason for the end, as a sentence; may be empty.
        head: The head of the journal's chain after the run's end, as hexadecimal digits; empty if there is none.
    """

    number: int
    began: float
    about: Mapping[str, Any]
    ended: float | None
    ending: Ending | None
    status: int | None
    reason: str
    head: str = ""

    @property
    def is_over(self) -> bool:
        """Whether the mission ended with this run."""
        return self.ending is Ending.OVER


def end_data(ending: Ending, status: int | None, reason: str, head: str) -> dict[str, object]:
    """Return the data of a `run_ended` entry."""
    data: dict[str, object] = {"ending": ending.value, "status": status, "reason": reason}
    return {**data, "head": head} if head else data
