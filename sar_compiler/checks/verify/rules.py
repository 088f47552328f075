"""What is watched while the states of a tree are gone through."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from sar_compiler.checks.verify.conditions import IdleUnknownError
from sar_compiler.checks.verify.exploring import Judgement
from sar_compiler.checks.verify.monitors import Monitors
from sar_compiler.checks.verify.trail import Guarded

Condition = Callable[[str, bool | None], bool]
"""Says whether a condition holds after a tick; is given what the root came to, and whether the tree idles: every
tick from now on leaves it as it is. None where nobody knows yet: then it may raise `IdleUnknownError`."""


@dataclass(frozen=True)
class Rules:
    """The properties of a tree, ready to be watched.

    Attributes:
        monitors: Those over events; the first rules.
        guarded: The events that count only while a condition holds, by the number of the event without it.
        ends: Says whether a run is over.
        at_end: What must hold when it is over; the rules behind those over events.
    """

    monitors: Monitors
    guarded: Mapping[int, Sequence[Guarded]]
    ends: Condition
    at_end: Sequence[Condition] = field(default_factory=tuple)

    def judge(self, root: str, watched: int, *, idle: bool | None) -> Judgement:
        """Judge the state after a tick.

        Args:
            root: What the root came to; empty before the first tick.
            watched: What the monitors remember.
            idle: Whether every tick leaves it as it is; None if that is not known yet.
        """
        owed = self.monitors.owed(watched)
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


def _answer(condition: Condition, root: str, *, idle: bool | None) -> bool | None:
    """Say whether a condition holds; None if that depends on what is not known yet."""
    try:
        return condition(root, idle)
    except IdleUnknownError:
        return None
