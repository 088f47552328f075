"""What happens in a tick, as numbers, and what is still waited for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass


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
    """The events of one tick.

    Args:
        guarded: What may go with an event, by the event's number.

    Attributes:
        numbers: What has happened, in order.
        going_on: The leaves that have answered RUNNING, and the timers that were not up, as bits.
        changed: The leaves and timers that have started or come to an end, as bits.
    """

    def __init__(self, guarded: Mapping[int, Sequence[Guarded]]) -> None:
        self._guarded = guarded
        self.numbers: list[int] = []
        self.going_on = self.changed = 0

    def begin(self) -> None:
        """Begin a tick."""
        self.numbers.clear()
        self.going_on = self.changed = 0

    @property
    def waits(self) -> int:
        """The leaves and timers that this tick has left running as they were, as bits.

        One that was halted and started again in the same tick is not among them although it runs before and
        after: it is another activation, which has its whole time before it. See `liveness` for what that decides.
        """
        return self.going_on & ~self.changed

    def take(self, number: int) -> None:
        """Take an event, and what goes with it."""
        if number not in self._guarded:
            self.numbers.append(number)
            return
        holding = [each for each in self._guarded[number] if each.holds()]
        self.numbers += [each.number for each in holding if each.comes_first]
        self.numbers.append(number)
        self.numbers += [each.number for each in holding if not each.comes_first]
