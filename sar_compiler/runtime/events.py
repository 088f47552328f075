"""The events of a tree, such as a leaf that returns an outcome. Runs, proofs and journals share these events.

An event contains the action of a leaf and its outcome, so that the consumers of events need not derive outcomes from
statuses. The last event of a tick is the end of the tick.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple
from uuid import UUID

STARTED, RETURNED, HALTED, TICKED = "started", "returned", "halted", "ticked"
"""The kinds of events: a leaf starts, returns an outcome, or is halted while it runs, or a tick of the tree ends."""

DECIDED = "decided"
"""The kind of event for a control or decorator that ended itself, for example at a time limit. It only occurs in recorded
runs."""

RESET = "reset"
"""The kind of event for the reset of a leaf that had ended. It only occurs in recorded runs, because they omit outcomes that equal the
outcome in the previous tick."""


FactChanges = tuple[tuple[str, object], ...]
"""The changed facts. Each item is the name of a fact and its new value."""


class Event(NamedTuple):
    """An action of a leaf, or the end of a tick.

    Attributes:
        path: The names of the leaf's ancestors, from the root, and of the leaf; for the end of a tick, the root's name.
        number: The leaf's number in pre-order, from 0, as in journals. For the end of a tick, this is the root's number.
        what: The kind of event: `STARTED`, `RETURNED`, `HALTED`, `DECIDED`, `RESET` or `TICKED`.
        status: The status of the leaf, the node that has decided, or the root; empty if the tick was not finished.
        label: The label of the outcome, or the reason of the node; empty if there is only a status.
        facts: The facts that the outcome has changed. In a recorded run, they are the recorded events, by kind.
        tick: The number of the tick in its run, from 1; 0 if there is no run.
        time_sec: The time since the start of the run, in seconds; None if any time may have passed.
        ran_sec: The run time of a node that has ended by itself, in seconds; 0 for other events.
        statuses: For the end of a recorded tick, pairs of a node's number and status, in the order of the records.
        is_unsure: Whether a condition of the leaf, and not the leaf itself, may have determined the status. True only in imported runs.
    """

    path: tuple[str, ...]
    number: int
    what: str
    status: str = ""
    label: str = ""
    facts: FactChanges = ()
    tick: int = 0
    time_sec: float | None = None
    ran_sec: float = 0.0
    statuses: tuple[tuple[int, str], ...] = ()
    is_unsure: bool = False

    @property
    def leaf(self) -> str:
        """The leaf's name."""
        return self.path[-1]

    @property
    def outcome(self) -> str:
        """The label of the returned outcome, or the status if there is no label. Empty for other kinds of events."""
        return (self.label or self.status) if self.what == RETURNED else ""

    @property
    def action(self) -> str:
        """The returned outcome, or the kind of event if no outcome was returned."""
        return self.outcome or self.what


def changes_in(before: Mapping[str, object], after: Mapping[str, object]) -> FactChanges:
    """Return the names and new values of all changed facts, sorted by name."""
    return tuple((name, after[name]) for name in sorted(after) if before.get(name) != after[name])


ValueChange = tuple[object, object]
"""The values before and after a change. A missing value is None."""


def value_changes(before: Mapping[str, object], after: Mapping[str, object]) -> dict[str, ValueChange]:
    """Return the old and new value of each changed fact or key, by name."""
    names = {**before, **after}
    return {
        name: (before.get(name), after.get(name)) for name in names if before.get(name) != after.get(name)
    }


class TickRecord(NamedTuple):
    """The record of one tick: events, changes and statuses.

    Attributes:
        events: The events of leaves, in order, and the end of the tick.
        facts: The changed facts, by name.
        keys: The changed blackboard keys, by name.
        statuses: The status of each ticked node, by the id of its behaviour; empty if not known.
        error: The message of the error that the tick raised; empty if no error is known.
    """

    events: tuple[Event, ...]
    facts: Mapping[str, ValueChange]
    keys: Mapping[str, ValueChange]
    statuses: Mapping[UUID, str] = MappingProxyType({})
    error: str = ""

    @property
    def number(self) -> int:
        """The number of the tick in its run, from 1."""
        return self.events[-1].tick

    @property
    def time_sec(self) -> float:
        """The time since the first tick, in seconds; 0 if the time is not known."""
        return self.events[-1].time_sec or 0.0

    @property
    def root(self) -> str:
        """The root's status; empty if the tick was not finished."""
        return self.events[-1].status


def append_end(
    events: Iterable[Event], root: str, status: str, tick: int = 0, time_sec: float | None = None
) -> tuple[Event, ...]:
    """Append the end of a tick to its events, and set the number and time of the tick in all events.

    Args:
        events: The events of leaves.
        root: The name of the root.
        status: The root's status; empty if the tick was not finished.
        tick: The number of the tick.
        time_sec: The time of the tick since the start of the run, in seconds.
    """
    end = Event((root,), 0, TICKED, status)
    return tuple(each._replace(tick=tick, time_sec=time_sec) for each in (*events, end))
