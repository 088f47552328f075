"""The time as a class sees it that is ticked in every state that it can be in: any time may have passed since it last looked.

How much time has passed is in no state. So a moment is not a number: moments can be stored, subtracted, shifted by seconds and
compared, and a comparison has every result that it can have, one after the other.
"""

import math
from collections.abc import Hashable
from typing import Any, Final, NoReturn, Protocol

from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.clock import ManualClock


class Asker(Protocol):
    """Whoever is asked what comes of a comparison."""

    def look(self, has_begun: bool | None) -> bool:
        """Return whether a time is up.

        Args:
            has_begun: Whether it has begun in an earlier tick; None where nobody knows what it is.
        """
        ...

    def whose(self) -> str:
        """Return who looks at it, in words."""
        ...


_EARLIER: Final = 0
"""In place of the number of a moment: it is one of an earlier tick."""


class TimeComputedError(UndecidableError):
    """A class does something with the time that cannot be followed."""

    def __init__(self, whose: str) -> None:
        super().__init__(
            f"{whose} needs the time as a number: only the difference of two times, their sum with seconds, and comparisons "
            "can be followed in all runs"
        )


class PossibleClock(ManualClock):
    """A clock whose moments are compared in every possible way.

    Attributes:
        asker: Decides comparisons.
    """

    asker: Asker
    _count: int

    @classmethod
    def of(cls, clock: ManualClock, asker: Asker) -> None:
        """Turn a clock into such a one, which remains the same object: those that measure time refer to it."""
        clock.__class__ = cls
        assert isinstance(clock, cls)  # noqa: S101 - the line above says so
        clock.asker, clock._count = asker, _EARLIER

    def now(self) -> Any:
        """Return this moment."""
        self._count += 1
        return Moment(self.asker, 0.0, self._count)


class PossibleTime:
    """What the time can be and a number cannot.

    Args:
        asker: Decides comparisons.
        shift: How many seconds were added.
    """

    def __init__(self, asker: Asker, shift: float) -> None:
        self.asker = asker
        self.shift = shift

    def grow_old(self) -> bool:
        """Be what is left of it once it is stored; return whether it is a moment of this tick."""
        raise NotImplementedError

    number: int | None = None
    """The greater, the later, for moments; the same for all of earlier ticks."""
    known: Hashable = None
    """What is known of it besides."""

    def less(self, other: Any, *, or_equal: bool) -> bool:
        """Return whether it is less than something else, or perhaps equal."""
        raise NotImplementedError

    def __lt__(self, other: Any) -> bool:
        return self.less(other, or_equal=False)

    def __le__(self, other: Any) -> bool:
        return self.less(other, or_equal=True)

    def __gt__(self, other: Any) -> bool:
        return not self.less(other, or_equal=True)

    def __ge__(self, other: Any) -> bool:
        return not self.less(other, or_equal=False)

    def __eq__(self, other: object) -> bool:
        return other is self or (isinstance(other, (int, float, PossibleTime)) and self.asker.look(None))

    # Whoever keeps one outside of the state is told so.
    __hash__ = None  # type: ignore[assignment]

    def __format__(self, _how: str) -> str:
        return "..."

    def __repr__(self) -> str:
        return "..."

    def _unknown(self, *_: Any) -> NoReturn:
        raise TimeComputedError(self.asker.whose())

    __bool__ = __float__ = __int__ = __index__ = __round__ = __floor__ = __ceil__ = __trunc__ = __abs__ = (
        _unknown
    )
    __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __floordiv__ = __rfloordiv__ = _unknown
    __mod__ = __rmod__ = __divmod__ = __rdivmod__ = __pow__ = __rpow__ = _unknown


class Moment(PossibleTime):
    """A moment.

    Args:
        asker: Decides comparisons.
        shift: How many seconds were added.
        number: The greater, the later; the same for all of earlier ticks.
    """

    def __init__(self, asker: Asker, shift: float, number: int = _EARLIER) -> None:
        super().__init__(asker, shift)
        self.number: int = number

    def grow_old(self) -> bool:
        """Be a moment of an earlier tick from now on; return whether it was one of this tick."""
        was_new, self.number = self.number != _EARLIER, _EARLIER
        return was_new

    def __add__(self, other: Any) -> "Moment":
        return self._shifted(other, 1)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if not isinstance(other, Moment):
            return self._shifted(other, -1)
        shift = self.shift - other.shift
        if self.number == other.number:
            return Elapsed(self.asker, shift, 0, None) if self.number == _EARLIER else shift
        sign, began = (1, other) if self.number > other.number else (-1, self)
        return Elapsed(self.asker, shift, sign, began.number == _EARLIER)

    def __rsub__(self, _other: Any) -> NoReturn:
        self._unknown()

    def less(self, other: Any, *, or_equal: bool) -> bool:
        """Return whether it is before another moment."""
        if isinstance(other, Moment):
            between = self - other
            return bool(between <= 0 if or_equal else between < 0)
        return self.asker.look(None)

    def _shifted(self, seconds: Any, sign: int) -> "Moment":
        if not isinstance(seconds, (int, float)):
            self._unknown()
        return Moment(self.asker, self.shift + sign * seconds, self.number)


class Elapsed(PossibleTime):
    """The time between two moments: a time that has passed, with a sign, and a number of seconds.

    Args:
        asker: Decides comparisons.
        shift: The number of seconds.
        sign: 1 or -1 for what is added to it; 0 if nothing is known of that.
        is_old: Whether what has passed began in an earlier tick; None if nothing is known of that.
    """

    def __init__(self, asker: Asker, shift: float, sign: int = 0, is_old: bool | None = None) -> None:
        super().__init__(asker, shift)
        self.sign = sign
        self.is_old = is_old
        self.known = sign, is_old

    def grow_old(self) -> bool:
        """Be a time of which nothing is known: unlike a moment's, that which has passed since does not grow."""
        self.sign, self.is_old = 0, None
        self.known = 0, None
        return False

    def __add__(self, other: "Elapsed | float") -> "Elapsed":
        if isinstance(other, Elapsed):
            return Elapsed(self.asker, self.shift + other.shift)
        return Elapsed(self.asker, self.shift + other, self.sign, self.is_old)

    __radd__ = __add__

    def __sub__(self, other: "Elapsed | float") -> "Elapsed":
        return self + -other

    def __rsub__(self, other: float) -> "Elapsed":
        return -self + other

    def __neg__(self) -> "Elapsed":
        return Elapsed(self.asker, -self.shift, -self.sign, self.is_old)

    def less(self, other: Any, *, or_equal: bool) -> bool:
        """Return whether it is less than a number of seconds."""
        if not isinstance(other, (int, float)) or not self.sign:
            return self.asker.look(None)
        wanted = self.sign * (other - self.shift)
        # What has passed is to be less than that with a sign of 1, and more than that with the other one.
        if wanted < 0 or (wanted == 0 and or_equal == (self.sign < 0)):
            is_up = True
        else:
            is_up = wanted != math.inf and self.asker.look(self.is_old)
        return is_up == (self.sign < 0)
