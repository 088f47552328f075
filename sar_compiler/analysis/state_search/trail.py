"""Records the events of a tick as numbers, and the leaves and timers for which a run waits."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from librt.vecs import vec
from mypy_extensions import u8

from sar_compiler.runtime.kernel.entry_cells import EntryCells

Waits = tuple[int, int, int]
"""The effect of a part of a tick on the waits: `Trail.going_on`, `changed` and `settled` at the end of the part."""


@dataclass(frozen=True)
class Guarded:
    """An additional event that occurs together with a leaf event if a condition holds.

    Attributes:
        number: The number of the second event.
        holds: Returns whether the condition holds now.
        comes_first: Whether the second event precedes the leaf event, instead of following it. The order matters if the
            leaf event limits the same property.
    """

    number: int
    holds: Callable[[], bool]
    comes_first: bool


class Trail:
    """Records the events of one tick, and the effects of these events on the properties.

    Args:
        guarded: The second events that may accompany a leaf event, by the leaf event's number.
        heard: The numbers of the events that affect a property.
        after: Given the state of the properties and an event, returns the state after the event, and the properties
            that the event violates, as bits.
        entries: The contents of the blackboard's entries.

    Attributes:
        numbers: The numbers of the events, in order.
        keeps: Whether to keep the events and the contents of entries before each event; a search does not need them.
        pasts: The contents of the entries before each event.
        known: The number of leaves and timers that have a bit.
        going_on: The leaves that continue to run, and the timers that have not expired, as bits.
        changed: The running leaves and timers that have started in this tick, as bits.
        settled: The leaves and timers whose earlier record in the tick no longer makes a difference, as bits.
        watched: The state of the properties.
        broken: The violated properties, as bits.
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
        """Return the bit that stands for the leaf or timer at the given node index."""
        bits = self._bits
        while len(bits) <= index:
            bits.append(0)
        if not bits[index]:
            bits[index] = 1 << self.known
            self.known += 1
        return bits[index]

    def begin(self, watched: int) -> None:
        """Start a tick. *watched* is the state of the properties before the tick."""
        self.rewind(0)
        self.begin_part()
        self.broken = 0
        self.watched = watched

    def begin_part(self) -> None:
        """Start a part of a tick. The waits of each part are recorded separately."""
        self.going_on = self.changed = self.settled = 0

    def rewind(self, happened: int) -> None:
        """Discard all recorded events except the first *happened* events."""
        if self.keeps:
            del self.numbers[happened:]
            del self.pasts[happened:]

    @property
    def waits(self) -> Waits:
        """The effect of the current part of the tick on the waits."""
        return self.going_on, self.changed, self.settled

    def start(self, bit: int) -> None:
        """Record that a leaf or timer starts.

        A run does not wait for a leaf that was halted and restarted in the same tick. The leaf runs before and after
        the tick, but in two activations, and the second one begins with the whole running time. See `liveness`.
        """
        self.going_on &= ~bit
        self.changed |= bit
        self.settled |= bit

    def mark_running(self, bit: int) -> None:
        """Record that a leaf returns RUNNING, or a timer has not expired."""
        if not self.changed & bit:
            self.going_on |= bit

    def mark_ended(self, bit: int) -> None:
        """Record that a leaf ends or is halted, or a timer expires.

        The earlier record of the leaf or timer in this tick no longer makes a difference, so ticks that differ only in
        this record merge.
        """
        self.going_on &= ~bit
        self.changed &= ~bit
        self.settled |= bit

    def add_event(self, number: int) -> None:
        """Process an event, and the additional events that occur together with it."""
        if number >= self._count or not self._heard[number]:
            if self.keeps:
                self._store_event(number)
            return
        holding = [each for each in self._guarded.get(number, ()) if each.holds()]
        for each in holding:
            if each.comes_first:
                self._apply_event(each.number)
        self._apply_event(number)
        for each in holding:
            if not each.comes_first:
                self._apply_event(each.number)

    def _store_event(self, number: int) -> None:
        self.numbers.append(number)
        self.pasts.append(list(self._entries.now))

    def _apply_event(self, number: int) -> None:
        if self.keeps:
            self._store_event(number)
        place = self.watched * self._count + number
        known = self._known.get(place)
        if known is None:
            known = self._known[place] = self._after(self.watched, number)
        self.watched = known[0]
        self.broken |= known[1]
