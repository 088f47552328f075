"""Guesses of the words that were meant."""

import re
from collections.abc import Collection, Iterable

MOST_COMPARED = 100_000
"""The largest number of words that one `Guesses` compares with what was written."""
_UNITS = {
    "ms": ("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"),
    "us": ("us", "usec", "micros", "microseconds"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "min": ("min", "mins", "minute", "minutes"),
    "h": ("h", "hour", "hours"),
    "hz": ("hz", "hertz"),
    "rad": ("rad", "rads", "radian", "radians"),
    "deg": ("deg", "degs", "degree", "degrees"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "cm": ("cm",),
    "mm": ("mm",),
    "km": ("km",),
}
_UNIT_OF = {word: unit for unit, words in _UNITS.items() for word in words}
LIKE = 0.7
"""How alike two words are at least of which one may be a slip for the other."""
_SHORT, _LIKE_SHORT = 3, 0.6
_LETTER = re.compile(r"[^\W\d_]")
_PARTS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def unit_in(name: str) -> str:
    """Return the unit that a name ends with: `ms` for `delay_msec`; empty if it says none."""
    parts = _PARTS.findall(name)
    return _UNIT_OF.get(parts[-1].lower(), "") if parts else ""


def keeps_unit(written: str, meant: str) -> bool:
    """Return whether a number has the same unit under another name: `delay_msec` for `msec`, not `msec` for `sec`, or for none."""
    unit = unit_in(meant)
    if unit == unit_in(written):
        return True
    # A slip in the unit itself (`mesc`) leaves none, and as many parts.
    return not unit_in(written) and len(_PARTS.findall(written)) == len(_PARTS.findall(meant))


def nearest(word: str, known: Iterable[str], likeness: float = LIKE) -> str | None:
    """Return the known word that was probably meant, or None.

    A number is never meant by another one, nor a name with a unit (`delay_msec`) by one with another unit, or none: what is
    written as its value would be another value then.

    Args:
        word: What was written.
        known: The words that may have been meant.
        likeness: How alike the two must be at least, from 0 to 1, if they differ in more than case and underscores.
    """
    import difflib

    candidates, lower, folded = (
        [each for each in known if keeps_unit(word, each)],
        word.lower(),
        _folded(word),
    )
    likeness = min(likeness, _LIKE_SHORT) if len(word) <= _SHORT else likeness
    found = (
        [candidate for candidate in candidates if candidate.lower() == lower]
        or [candidate for candidate in candidates if _folded(candidate) == folded]
        or (_LETTER.search(word) and difflib.get_close_matches(word, candidates, n=1, cutoff=likeness))
    )
    return found[0] if found else None


def did_you_mean(near: str | None) -> str:
    """Return the end of a sentence that asks whether a word was meant; empty for None."""
    return f"; did you mean '{near}'?" if near else ""


class Guesses:
    """Guesses of the words that were meant, which end when they would take long in a large file."""

    def __init__(self) -> None:
        self._left = MOST_COMPARED

    def nearest(self, word: str, known: Collection[str], likeness: float = LIKE) -> str | None:
        """Return the known word that was probably meant, as `nearest`; None if there are too many to compare."""
        if len(known) > self._left:
            return None
        self._left -= len(known)
        return nearest(word, known, likeness)


def _folded(word: str) -> str:
    return word.replace("_", "").lower()
