"""What happens in a tree, answer by answer: of the same event speak runs, proofs and journals.

An event says what a leaf did, and which of its answers it was: nobody downstream concludes an answer from a status. The last event of a tick
is its end.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple
from uuid import UUID

STARTED, ANSWERED, HALTED, TICKED = "started", "answered", "halted", "ticked"
"""What an event is: a leaf starts, answers, is stopped while it runs; a tick of the tree is over."""

DECIDED = "decided"
"""A node with children has ended by itself: a time limit, a condition by script, a loop over nothing. Recorded runs alone have it."""

RESET = "reset"
"""A leaf that had ended is at rest again; recorded runs alone tell that, because they leave out answers as in the tick before."""


FactChanges = tuple[tuple[str, object], ...]
"""Facts by name, each with its new value."""


class Event(NamedTuple):
    """Something that a leaf did, or the end of a tick.

    Attributes:
        path: The names of the nodes around the leaf, from the root down, and its own; of the end of a tick, the root's alone.
        number: The leaf's number, from 0 in pre-order, as journals number nodes; of the end of a tick, the root's.
        what: `STARTED`, `ANSWERED`, `HALTED`, `DECIDED`, `RESET` or `TICKED`.
        status: What the leaf answered, or the node decided; what the root came to, empty if the tick was not finished.
        label: What the leaf means by it, or the node says; empty for nothing more than the status.
        facts: The facts that the answer has changed; of a recorded run, those that were noted, by kind, with their data.
        tick: The number of the tick in its run, from 1; 0 where there is no run.
        time_sec: When it was, seconds from the run's beginning; None where any time may have passed.
        ran_sec: How long a node had run that has decided by itself, seconds; 0 for any other event.
        statuses: Of the end of a recorded tick, the statuses that nodes were recorded with in it, in their order, each with the node's number.
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

    @property
    def leaf(self) -> str:
        """The leaf's name."""
        return self.path[-1]

    @property
    def answer(self) -> str:
        """The answer's label, or else its status; empty if it is no answer."""
        return (self.label or self.status) if self.what == ANSWERED else ""

    @property
    def deed(self) -> str:
        """What the leaf did, in a word: its answer, or else what the event is."""
        return self.answer or self.what


def changes_in(before: Mapping[str, object], after: Mapping[str, object]) -> FactChanges:
    """Return the facts that have another value than before."""
    return tuple((name, after[name]) for name in sorted(after) if before.get(name) != after[name])


ValueChange = tuple[object, object]
"""A value before and after; None where there is none."""


def value_changes(before: Mapping[str, object], after: Mapping[str, object]) -> dict[str, ValueChange]:
    """Return the values that are others than before, by their names."""
    names = {**before, **after}
    return {
        name: (before.get(name), after.get(name)) for name in names if before.get(name) != after.get(name)
    }


class TickRecord(NamedTuple):
    """What a tick has come to.

    Attributes:
        events: What leaves did, in order; the last one is the end of the tick.
        facts: The facts that have changed.
        keys: The keys of the blackboard that have changed, likewise.
        statuses: The status of each node that was ticked, by its id, where that is known.
        error: What was raised in it, in words, where that is known; else empty.
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
        """When it was, seconds from the first one; 0 where any time may have passed."""
        return self.events[-1].time_sec or 0.0

    @property
    def root(self) -> str:
        """The root's status; empty if the tick was not finished."""
        return self.events[-1].status


def with_end(
    events: Iterable[Event], root: str, status: str, tick: int = 0, time_sec: float | None = None
) -> tuple[Event, ...]:
    """Return the events of a tick and its end.

    Args:
        events: What leaves did.
        root: The name of the root.
        status: What it came to; empty if the tick was not finished.
        tick: The number of the tick.
        time_sec: Its time.
    """
    end = Event((root,), 0, TICKED, status)
    return tuple(each._replace(tick=tick, time_sec=time_sec) for each in (*events, end))
