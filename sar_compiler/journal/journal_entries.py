"""The entries of a journal, as they are read."""

import time
from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

GOAL_SENT, GOAL_ENDED = "goal_sent", "goal_ended"
"""Kinds that belong to the leaves that send goals; a mission has others."""

FACTS_LOST = "facts_lost"
"""The kind of a fact that stands for others, which could not be written: their `count`, and the `numbers` given until then."""

RUN_BEGAN = "run_began"
"""The kind of a run's first entry: what the mission is, with `run`, what the run has of its own."""

RUN_ENDED = "run_ended"
"""The kind of its last: `ending`, `status`, `reason`, and the `head` of the journal's chain, where there is one."""

ORDERED = "ordered"
"""The kind of an order by a service of the mission: its `verb`, its `label`, `by` whom, as far as that is known, the `reason` and the `refusal`,
empty if there is none, and `is_told`: whether facts tell of it already."""

PROPERTIES_WATCHED, PROPERTIES_OWED = "properties_watched", "properties_owed"
"""Kinds of what a run is watched for: once, the `file` and its `properties`, each with its `name` and what is done `if_broken`, and the names `left_out`;
and, whenever that changes, the names of those by which something still has to come, `owed`."""

PROPERTY_BROKEN, ASSUMPTION_FAILED = "property_broken", "assumption_failed"
"""Kinds of facts that no mission has: the `property` is broken by an `event`, or is `owed` at an end; what the `assumption` is that an answer contradicts.
Each with the `tick`, the `node` (the leaf's number, null for none) and the `run` that led there: time in seconds, tick, node and deed of the last events."""

LEAF_RAISED = "leaf_raised"
"""The kind of an entry about a leaf that has raised an exception, which ends the run: its number `node`, null if it is not known, and the `text`."""

CHANGED = "changed"
"""The kind of an entry behind a fact: the fact as a sentence, and the changes of the mission's display."""

STATUS, LACKS, BREAKPOINT = "status", "lacks", "breakpoint"
"""Kinds that are recorded of the run: a node's status, why the robot cannot drive, where a breakpoint holds the tree."""

PROGRESS = "progress"
"""The kind of an entry that says how far a drive is."""

POSE, PLAN, MAP, LOG = "pose", "plan", "map", "log"
"""Kinds that are recorded from the robot's topics, one by one."""

BATTERY = "battery"
"""The kind of an entry with the state of the robot's battery."""
OF_ROBOT = (POSE, PLAN, MAP, BATTERY, LOG)
"""All of them."""

OF_EVERY_MISSION = (RUN_BEGAN, RUN_ENDED, FACTS_LOST, GOAL_SENT, PROPERTY_BROKEN, ASSUMPTION_FAILED)
"""Kinds of events that a mission's state receives beside those that the mission declares itself."""


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
    """Check the values of an entry as it is read from a file, which may have been altered.

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
    """Return seconds since 1970 as the local date and time; as they are if there is no such day."""
    try:
        return time.strftime(form, time.localtime(wall))
    except (OSError, OverflowError, ValueError):
        return f"{wall:g}"


class CommandAuthor(NamedTuple):
    """By whom a command is given, and why.

    Attributes:
        name: A person, a program or a property, in words: `Ann (page, 127.0.0.1)`; empty if it is not known.
        reason: The reason that they have stated; empty for none.
    """

    name: str = ""
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}" if self.reason else self.name

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "CommandAuthor":
        """Return the author in the data of an entry: `by` and `reason`."""
        return cls(str(data.get("by") or ""), str(data.get("reason") or ""))


class JournalEntry(NamedTuple):
    """A fact, or something that was watched.

    Attributes:
        number: Its number in the journal, in the order in which things happened; in a stream, among all of the stream.
        run: The number of the run that has written it, from 1.
        wall: When it was written, in seconds since 1970.
        time: The time of the mission's clock, in seconds.
        kind: What it is, such as `photo_taken`.
        data: What belongs to it, as JSON values.
    """

    number: int
    run: int
    wall: float
    time: float
    kind: str
    data: Mapping[str, Any]


class Row(NamedTuple):
    """An entry that is to be written; its number is the next one after those of facts and of what was watched."""

    number: int
    run: int
    wall: float
    time: float
    kind: str
    data: str


class Ending(str, Enum):
    """How a run has ended."""

    OVER = "over"
    """By its end condition: the mission is over, complete or not."""
    STOPPED = "stopped"
    """By a signal: whoever stopped it may go on with it."""
    FAILED = "failed"
    """By a leaf that raised, or what it ran on."""


class JournalRun(NamedTuple):
    """One run of the mission, a process.

    Attributes:
        number: Its number, from 1.
        began: When its first tick was due, in seconds since 1970.
        about: What it ran with: `version`, `pid`, `parameters`, the mission's `time` at the beginning, and so on.
        ended: When it ended, in seconds since 1970; None if it broke off, or still runs.
        ending: How it ended; None if it broke off, or still runs.
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
        """Whether the mission was over with this run."""
        return self.ending is Ending.OVER


def end_data(ending: Ending, status: int | None, reason: str, head: str) -> dict[str, object]:
    """Return what belongs to the end of a run in a stream."""
    data: dict[str, object] = {"ending": ending.value, "status": status, "reason": reason}
    return {**data, "head": head} if head else data
