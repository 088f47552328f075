"""Graphs written by hand, explored like a tree."""

from collections.abc import Mapping, Sequence

from sar_compiler.checks.verify.exploring import Judgement, Transition, explore


class HandMade:
    """States are numbers; each tick leads to one, and may wait for something (bits).

    Args:
        ticks: Where the ticks of each state lead to, as numbers or as pairs of a number and what is waited for; a
            state that is not named stays as it is.
        ends: The states in which the run is over.
        broken: The rules that each state breaks, as bits.
        owing: What each state owes, as bits.
        idle_ends: The states in which the run is over if they are idle.
    """

    def __init__(
        self,
        ticks: Mapping[int, Sequence[int | tuple[int, int]]],
        *,
        ends: Sequence[int] = (),
        broken: Mapping[int, int] | None = None,
        owing: Mapping[int, int] | None = None,
        idle_ends: Sequence[int] = (),
    ) -> None:
        self._ticks = ticks
        self._ends = ends
        self._broken = broken or {}
        self._owing = owing or {}
        self._idle_ends = idle_ends
        self.path: tuple[int, ...] = ()

    def start(self):
        return 0

    def steps(self, state):
        for place, tick in enumerate(self._ticks.get(state, [state])):
            self.path = (place,)
            target, waits = tick if isinstance(tick, tuple) else (tick, 0)
            yield Transition(target, waits)

    def judge(self, state, *, idle):
        ends = state in self._ends or bool(idle and state in self._idle_ends)
        is_open = idle is None and bool(self._idle_ends)
        return Judgement(ends, self._broken.get(state, 0), self._owing.get(state, 0), is_open)


def explored(ticks, max_states=1000, **judged):
    return explore(HandMade(ticks, **judged), max_states)
