"""Graphs written by hand, explored like a tree."""

from collections.abc import Mapping, Sequence

from sar_compiler.analysis.state_search.searching import A_STATE, NOTHING, Judgement, Stepper, explore


class HandMade(Stepper):
    """States are numbers, as a byte; each tick leads to one, and may wait for something (bits).

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
        super().__init__()
        self._ticks = ticks
        self._ends = ends
        self._breaks = broken or {}
        self._owing = owing or {}
        self._idle_ends = idle_ends
        self._place = 0
        self._left: list[tuple[int, int | tuple[int, int]]] = []

    def start(self):
        return bytes([0])

    def enter(self, state, *, alone=False):
        self._left = list(enumerate(self._ticks.get(state[0], [state[0]])))

    def step(self):
        if not self._left:
            return NOTHING
        place, tick = self._left.pop(0)
        self._place = place
        number, waits = tick if isinstance(tick, tuple) else (tick, 0)
        self.state, self.waits = bytes([number]), (waits, 0, 0)
        return A_STATE

    def path(self):
        return (self._place,)

    def judge(self, state, idle):
        number = state[0]
        ends = number in self._ends or bool(idle and number in self._idle_ends)
        is_open = idle is None and bool(self._idle_ends)
        return Judgement(ends, self._breaks.get(number, 0), self._owing.get(number, 0), is_open)


def explored(ticks, max_states=1000, **judged):
    return explore(HandMade(ticks, **judged), max_states)


def numbers(graph):
    return [state[0] for state in graph.states]
