"""Watching a run for what the properties forbid: an automaton for each, all of them as one, and its end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from sar_compiler.checks.verify.property_conditions import IdleUnknownError
from sar_compiler.runtime.blackboard import Entry
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.searching import Judgement
from sar_compiler.runtime.kernel.trail import Guarded


class PropertyPattern(Enum):
    """The pattern of a property, after the specification patterns of Dwyer, Avrunin and Corbett."""

    NEVER = "never"
    """Absence: the event does not happen."""
    BEFORE = "before"
    """Precedence: before the event comes another one (since a third)."""
    AFTER = "after"
    """Response: after the event another one comes (before a third)."""
    AT_MOST_ONCE = "at_most_once"
    """Bounded existence: the event happens once at most (between two of another)."""


MAIN, OTHER, LIMIT = 1, 2, 4
"""The roles of an event in a property: the one that it is about, the one that must come, the one that bounds it."""


@dataclass(frozen=True)
class Monitor:
    """One property over events.

    Attributes:
        form: What it says.
        roles: What each event is in it, as bits; events that are nothing are left out.
        owes: Whether what must come can come at any time, so that it is owed until it comes.
    """

    form: PropertyPattern
    roles: Mapping[int, int]
    owes: bool = False

    def after(self, flag: bool, event: int) -> tuple[bool, bool]:
        """Return the flag after an event, and whether the event breaks the property.

        Args:
            flag: What is remembered: that the other event has come (`BEFORE`), that it has still to come
                (`AFTER`), that the event has happened (`AT_MOST_ONCE`).
            event: The event.
        """
        roles = self.roles.get(event)
        if roles is None:
            return flag, False
        return _RULES[self.form](flag, roles)


def _never(_: bool, roles: int) -> tuple[bool, bool]:
    return False, bool(roles & MAIN)


def _before(flag: bool, roles: int) -> tuple[bool, bool]:
    broken = bool(roles & MAIN) and not flag
    return bool(roles & OTHER) or (flag and not roles & LIMIT), broken


def _after(flag: bool, roles: int) -> tuple[bool, bool]:
    owed = flag and not roles & OTHER
    broken = owed and bool(roles & LIMIT)
    return bool(roles & MAIN) or (owed and not broken), broken


def _at_most_once(flag: bool, roles: int) -> tuple[bool, bool]:
    happened = flag and not roles & LIMIT
    return happened or bool(roles & MAIN), happened and bool(roles & MAIN)


_RULES: Mapping[PropertyPattern, Callable[[bool, int], tuple[bool, bool]]] = {
    PropertyPattern.NEVER: _never,
    PropertyPattern.BEFORE: _before,
    PropertyPattern.AFTER: _after,
    PropertyPattern.AT_MOST_ONCE: _at_most_once,
}


class Monitors:
    """Several monitors as one, whose state is a number: a bit for each.

    Args:
        monitors: The monitors; the first has the lowest bit.
    """

    start = 0

    def __init__(self, monitors: Sequence[Monitor]) -> None:
        self._monitors = tuple(monitors)
        self._owing = sum(1 << bit for bit, monitor in enumerate(self._monitors) if monitor.owes)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._monitors)

    @property
    def heard(self) -> set[int]:
        """The events that matter to at least one of them."""
        return {event for monitor in self._monitors for event in monitor.roles}

    def after(self, state: int, event: int) -> tuple[int, int]:
        """Return the state after an event, and the monitors that it breaks, as bits."""
        following = broken = 0
        for bit, monitor in enumerate(self._monitors):
            flag, wrong = monitor.after(bool(state >> bit & 1), event)
            following |= flag << bit
            broken |= wrong << bit
        return following, broken

    def owed(self, state: int) -> int:
        """Return the monitors that still owe something in a state, as bits."""
        return state & self._owing


AfterTickCondition = Callable[[str, bool | None], bool]
"""Returns whether a condition holds after a tick, given the root's status and whether the tree idles: every tick from
now on leaves it as it is. None if that is not known yet: then it may raise `IdleUnknownError`."""


@dataclass(frozen=True)
class Rules:
    """The properties of a tree, ready to be watched.

    Attributes:
        monitors: Those over events; the first rules.
        guarded: The events that count only while a condition holds, by the number of the event without it.
        ends: Says whether a run is over.
        at_end: What must hold when it is over; the rules behind those over events.
        entries: The entries that these and the end look at.
    """

    monitors: Monitors
    guarded: Mapping[int, Sequence[Guarded]]
    ends: AfterTickCondition
    at_end: Sequence[AfterTickCondition] = ()
    entries: Sequence[Entry] = ()

    @property
    def count(self) -> int:
        """How many there are; rules of others have higher numbers."""
        return self.monitors.count + len(self.at_end)

    def judge(self, outcome: int, watched: int, idle: bool | None) -> Judgement:
        """Judge the state after a tick.

        Args:
            outcome: The outcome of the root, as a number; INVALID before the first tick.
            watched: What the monitors remember.
            idle: Whether every tick leaves it as it is; None if that is not known yet.
        """
        owed = self.monitors.owed(watched)
        root = WORDS[outcome]
        if not root:
            return Judgement(pending=owed)
        ends = _answer(self.ends, root, idle=idle)
        if not ends:
            return Judgement(pending=owed, is_open=ends is None)
        broken, is_open = owed, False
        for place, condition in enumerate(self.at_end):
            holds = _answer(condition, root, idle=idle)
            is_open = is_open or holds is None
            if holds is False:
                broken |= 1 << (self.monitors.count + place)
        return Judgement(ends=True, broken=broken, pending=owed, is_open=is_open)


def _answer(condition: AfterTickCondition, root: str, *, idle: bool | None) -> bool | None:
    """Return whether a condition holds; None if that depends on what is not known yet."""
    try:
        return condition(root, idle)
    except IdleUnknownError:
        return None
