"""Events of a tree at the level of leaf outcomes, shared by runs, proofs and journals.

An event contains the action of a leaf and its outcome, so that its consumers need not derive outcomes from statuses. The
last event of a tick is its end.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple
from uuid import UUID

STARTED, RETURNED, HALTED, TICKED = "started", "returned", "halted", "ticked"
"""The kinds of events: a leaf starts, returns an outcome, is halted while it runs; a tick of the tree ends."""

DECIDED = "decided"
"""A node with children has ended by itself: a time limit, a script condition, a loop without items. Only in recorded runs."""

RESET = "reset"
"""A leaf that had ended was reset; only in recorded runs, because they omit outcomes that equal those of the previous tick."""


FactChanges = tuple[tuple[str, object], ...]
"""Facts by name, each with its new value."""


class Event(NamedTuple):
    """An action of a leaf, or the end of a tick.

    Attributes:
        path: The names of the leaf's ancestors from the root down, and its own; for the end of a tick, only the root's.
        number: The leaf's number, from 0 in pre-order, as journals number nodes; for the end of a tick, the root's.
        what: `STARTED`, `RETURNED`, `HALTED`, `DECIDED`, `RESET` or `TICKED`.
        status: The status of the leaf, the node or the root; empty for the root if the tick was not finished.
        label: The label of the outcome, or the reason of the node; empty if there is only the status.
        facts: The facts that the outcome has changed; in a recorded run, the recorded ones by kind, with their data.
        tick: The number of the tick in its run, from 1; 0 without a run.
        time_sec: The time since the start of the run, in seconds; None if any time may have passed.
        ran_sec: The run time of a node that has ended by itself, in seconds; 0 for other events.
        statuses: For the end of a recorded tick, the recorded statuses in their order, each with the node's number.
        is_unsure: Whether a condition of the leaf may have decided instead of the leaf; only in imported runs.
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
        """The outcome's label, or else its status; empty for other events."""
        return (self.label or self.status) if self.what == RETURNED else ""

    @property
    def action(self) -> str:
        """The action in one word: the outcome, or else the kind of event."""
        return self.outcome or self.what


def changes_in(before: Mapping[str, object], after: Mapping[str, object]) -> FactChanges:
    """Return the facts whose values have changed."""
    return tuple((name, after[name]) for name in sorted(after) if before.get(name) != after[name])


ValueChange = tuple[object, object]
"""A value before and after; None if there is none."""


def value_changes(before: Mapping[str, object], after: Mapping[str, object]) -> dict[str, ValueChange]:
    """Return the changed values, by their names."""
    names = {**before, **after}
    return {
        name: (before.get(name), after.get(name)) for name in names if before.get(name) != after.get(name)
    }


class TickRecord(NamedTuple):
    """The result of a tick.

    Attributes:
        events: The events of leaves, in order; the last one is the end of the tick.
        facts: The facts that have changed.
        keys: The keys of the blackboard that have changed.
        statuses: The status of each ticked node, by its id, if known.
        error: The error raised in it, in words; empty if there is none or it is unknown.
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
        """The time since the first tick, in seconds; 0 if any time may have passed."""
        return self.events[-1].time_sec or 0.0

    @property
    def root(self) -> str:
        """The root's status; empty if the tick was not finished."""
        return self.events[-1].status


def append_end(
    events: Iterable[Event], root: str, status: str, tick: int = 0, time_sec: float | None = None
) -> tuple[Event, ...]:
    """Return the events of a tick, with its end.

    Args:
        events: The events of leaves.
        root: The name of the root.
        status: The root's status; empty if the tick was not finished.
        tick: The number of the tick.
        time_sec: Its time.
    """
    end = Event((root,), 0, TICKED, status)
    return tuple(each._replace(tick=tick, time_sec=time_sec) for each in (*events, end))
