"""Graphs written by hand, explored in the same way as trees."""

from collections.abc import Mapping, Sequence

from sar_compiler.analysis.state_search.searching import A_STATE, NOTHING, Judgement, Stepper, explore


class HandMade(Stepper):
    """A graph whose states are numbers, as a byte. Each tick leads to a state, and may wait for answers (bits).

    Args:
        ticks: The targets of the ticks of each state, as numbers or as pairs of a number and the awaited
            answers; a state that is not listed stays unchanged.
        ends: The states in which the run is over.
        broken: The rules that each state violates, as bits.
        owing: The pending obligations of each state, as bits.
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
