"""What happens in a tick, as numbers, and what is still waited for."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from librt.vecs import vec
from mypy_extensions import u8

from sar_compiler.runtime.kernel.entry_cells import EntryCells

Waits = tuple[int, int, int]
"""What a part of a tick does to what is waited for: `Trail.going_on`, `changed` and `settled` at its end."""


@dataclass(frozen=True)
class Guarded:
    """An event that counts only while a condition holds: where it does, a second event goes with it.

    Attributes:
        number: The number of the second event.
        holds: Says whether the condition holds now.
        comes_first: Whether the second event comes before the other one, not after it. That matters where the
            other one bounds the same property.
    """

    number: int
    holds: Callable[[], bool]
    comes_first: bool


class Trail:
    """The events of one tick, and what the properties make of them.

    Args:
        guarded: What may go with an event, by the event's number.
        heard: The events that mean something to a property.
        after: Returns what the properties remember after an event, given what they remember before it, and which of
            them it breaks, as bits.
        entries: What the entries of the blackboard hold.

    Attributes:
        numbers: What has happened, in order.
        keeps: Whether events are kept, and what the entries hold before each of them; a search has no use for it.
        pasts: The latter, for each event.
        known: How many leaves and timers have a bit.
        going_on: The leaves that run on as they were, and the timers that were not up, as bits.
        changed: The leaves that run and timers that count, but have begun in this tick, as bits.
        settled: Those of which something was noted that makes no difference to what was noted before, as bits.
        watched: What the properties remember.
        broken: The properties that were broken, as bits.
    """

    def __init__(
        self,
        guarded: Mapping[int, Sequence[Guarded]],
        heard: Iterable[int],
        after: Callable[[int, int], tuple[int, int]],
        entries: EntryCells,
    ) -> None:
        self._guarded = guarded
        numbers = {*heard, *guarded}
        beside = [each.number for some in guarded.values() for each in some]
        self._count: int = max([*numbers, *beside, -1]) + 1
        self._heard = vec[u8]([number in numbers for number in range(self._count)])
        self._after = after
        self._known: dict[int, tuple[int, int]] = {}
        self._bits: list[int] = []
        self.known = 0
        self._entries = entries
        self.numbers: list[int] = []
        self.keeps = False
        self.pasts: list[list[int]] = []
        self.going_on = self.changed = self.settled = self.watched = self.broken = 0

    def bit(self, index: int) -> int:
        """Return the bit of the leaf or timer of a node, by the node's index."""
        bits = self._bits
        while len(bits) <= index:
            bits.append(0)
        if not bits[index]:
            bits[index] = 1 << self.known
            self.known += 1
        return bits[index]

    def begin(self, watched: int) -> None:
        """Begin a tick, with what the properties remember."""
        self.go_back(0)
        self.begin_part()
        self.broken = 0
        self.watched = watched

    def begin_part(self) -> None:
        """Begin a part of a tick: what is noted from now on is noted apart from what was before."""
        self.going_on = self.changed = self.settled = 0

    def go_back(self, happened: int) -> None:
        """Forget all events but the first ones, of that number."""
        if self.keeps:
            del self.numbers[happened:]
            del self.pasts[happened:]

    @property
    def waits(self) -> Waits:
        """What the part of a tick in hand does to what is waited for."""
        return self.going_on, self.changed, self.settled

    def start(self, bit: int) -> None:
        """Note that a leaf or timer starts.

        One that was halted and started again in the same tick is not waited for although it runs before and
        after: it is another activation, which has its whole time before it. See `liveness` for what that decides.
        """
        self.going_on &= ~bit
        self.changed |= bit
        self.settled |= bit

    def go_on(self, bit: int) -> None:
        """Note that a leaf answers RUNNING, or a timer is not up."""
        if not self.changed & bit:
            self.going_on |= bit

    def end(self, bit: int) -> None:
        """Note that a leaf ends or is halted, or a timer is up.

        Whatever was before in this tick makes no difference any more, so that ticks meet that differ only in it.
        """
        self.going_on &= ~bit
        self.changed &= ~bit
        self.settled |= bit

    def take(self, number: int) -> None:
        """Take an event, and what goes with it."""
        if number >= self._count or not self._heard[number]:
            if self.keeps:
                self._keep(number)
            return
        holding = [each for each in self._guarded.get(number, ()) if each.holds()]
        for each in holding:
            if each.comes_first:
                self._note(each.number)
        self._note(number)
        for each in holding:
            if not each.comes_first:
                self._note(each.number)

    def _keep(self, number: int) -> None:
        self.numbers.append(number)
        self.pasts.append(list(self._entries.now))

    def _note(self, number: int) -> None:
        if self.keeps:
            self._keep(number)
        place = self.watched * self._count + number
        known = self._known.get(place)
        if known is None:
            known = self._known[place] = self._after(self.watched, number)
        self.watched = known[0]
        self.broken |= known[1]
