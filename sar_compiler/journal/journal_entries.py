"""The entries of a journal, as they are read."""

import time
from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

GOAL_SENT, GOAL_ENDED = "goal_sent", "goal_ended"
"""Kinds of the events of leaves that send goals. A mission defines further kinds."""

FACTS_LOST = "facts_lost"
"""The kind of an event that replaces others that could not be written: their `count`, and the `numbers` that were used until then."""

RUN_BEGAN = "run_began"
"""The kind of a run's first entry: the mission's description, with `run`, the run's own description."""

RUN_ENDED = "run_ended"
"""The kind of its last entry: `ending`, `status`, `reason`, and the `head` of the journal's chain, if any."""

ORDERED = "ordered"
"""The kind of a command to the mission: its `verb` and `label`, its author `by` if known, its `reason`, the `refusal` (empty if
it was accepted), and `is_told`: whether other events already show it."""

PROPERTIES_WATCHED, PROPERTIES_OWED = "properties_watched", "properties_owed"
"""Kinds of entries about the monitored properties. The first is written once: the `file`, its `properties`, each with its `name`
and the reaction `if_broken`, and the names `left_out`. The second is written after every change: the names `owed` of
the properties with a pending obligation."""

PROPERTY_BROKEN, ASSUMPTION_FAILED = "property_broken", "assumption_failed"
"""Kinds of events that no mission defines. A `property` is violated by an `event`, or at the end by an obligation that is still
`owed`; an outcome contradicts an `assumption`. Each has the `tick`, the `node` (the leaf's number, null for none) and
the `run`, the last events before: the time in seconds, the tick, the node and the event of each."""

LEAF_RAISED = "leaf_raised"
"""The kind of an entry about a leaf that has raised an exception, which ends the run: its number `node`, null if
unknown, and the `text`."""

CHANGED = "changed"
"""The kind of an entry after an event: the event as a sentence, and the changes of the mission's display."""

STATUS, LACKS, BREAKPOINT = "status", "lacks", "breakpoint"
"""Kinds that are recorded of the run: a node's status, why the robot cannot drive, the breakpoint that pauses the tree."""

PROGRESS = "progress"
"""The kind of an entry with the progress of a drive."""

POSE, PLAN, MAP, LOG = "pose", "plan", "map", "log"
"""Kinds that are recorded from the robot's topics, one by one."""

BATTERY = "battery"
"""The kind of an entry with the state of the robot's battery."""
OF_ROBOT = (POSE, PLAN, MAP, BATTERY, LOG)
"""All kinds that are recorded from the robot's topics."""

OF_EVERY_MISSION = (RUN_BEGAN, RUN_ENDED, FACTS_LOST, GOAL_SENT, PROPERTY_BROKEN, ASSUMPTION_FAILED)
"""Kinds of events that a mission's state receives in addition to those that the mission declares itself."""


_NUMBERS: dict[str, type] = dict.fromkeys(("node", "leaf", "tick", "last"), int)
_TEXTS: dict[str, type] = dict.fromkeys(("status", "message", "label"), str)
_VALUE_TYPES: dict[str, dict[str, type]] = {
    STATUS: {**_NUMBERS, **_TEXTS},
    CHANGED: _NUMBERS,
    PROPERTY_BROKEN: _NUMBERS,
    ASSUMPTION_FAILED: _NUMBERS,
    RUN_BEGAN: dict.fromkeys(("tree_id", "tree_file"), str),
}
"""The types of values by kind and name, for every reader of a journal; a value may be missing, and null except in a status."""


def check_value_types(kind: str, data: Mapping[str, Any]) -> None:
    """Check the values of an entry from a file, which may have been altered.

    Raises:
        TypeError: If the project never writes such a value.
    """
    types = _VALUE_TYPES.get(kind, {})
    for name, value in data.items() if types else ():
        wanted = types.get(name)
        # Not `isinstance`: a bool would be an integer, and values of JSON have no classes of their own.
        if wanted is not None and type(value) is not wanted and (value is not None or kind == STATUS):
            what = "an integer" if wanted is int else "a string"
            raise TypeError(f"'{name}' of an entry '{kind}' is {value!r:.40} instead of {what}")


def day_and_time(wall: float, form: str = "%Y-%m-%d %H:%M:%S") -> str:
    """Return seconds since 1970 as the local date and time, or unchanged if there is no such day."""
    try:
        return time.strftime(form, time.localtime(wall))
    except (OSError, OverflowError, ValueError):
        return f"{wall:g}"


class CommandAuthor(NamedTuple):
    """The author of a command, and the reason.

    Attributes:
        name: A person, a program or a property, in words: `Ann (page, 127.0.0.1)`; empty if unknown.
        reason: The stated reason; empty for none.
    """

    name: str = ""
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}" if self.reason else self.name

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> "CommandAuthor":
        """Return the author in the data of an entry: `by` and `reason`."""
        return cls(str(data.get("by") or ""), str(data.get("reason") or ""))


class JournalEntry(NamedTuple):
    """An event or an observation.

    Attributes:
        number: Its number in the journal, in chronological order; in a stream, its number in the stream.
        run: The number of the run that wrote it, from 1.
        wall: The time of writing, in seconds since 1970.
        time: The time of the mission's clock, in seconds.
        kind: Its kind, such as `photo_taken`.
        data: Its data, as JSON values.
    """

    number: int
    run: int
    wall: float
    time: float
    kind: str
    data: Mapping[str, Any]


class Row(NamedTuple):
    """An entry to be written; its number follows those of events and observations."""

    number: int
    run: int
    wall: float
    time: float
    kind: str
    data: str


class Ending(str, Enum):
    """The kind of a run's end."""

    OVER = "over"
    """By its end condition: the mission is over, complete or not."""
    STOPPED = "stopped"
    """By a signal: the run may be resumed."""
    FAILED = "failed"
    """By an exception of a leaf or the engine."""


class JournalRun(NamedTuple):
    """One run of the mission, executed by one process.

    Attributes:
        number: Its number, from 1.
        began: The time of the first tick, in seconds since 1970.
        about: Its description: `version`, `pid`, `parameters`, the mission's `time` at the start, and so on.
        ended: Its end, in seconds since 1970; None if it crashed, or still runs.
        ending: The kind of end; None if it crashed, or still runs.
        status: The exit status.
        reason: A sentence with the reason of the end; may be empty.
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
    """Return the data of the run's end in a stream."""
    data: dict[str, object] = {"ending": ending.value, "status": status, "reason": reason}
    return {**data, "head": head} if head else data
