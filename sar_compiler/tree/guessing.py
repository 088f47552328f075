"""Suggestions for misspelt words."""

import re
from collections.abc import Collection, Iterable

MOST_COMPARED = 100_000
"""The maximum number of words that one `Guesses` object compares."""
_UNITS = {
    "ms": ("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"),
    "us": ("us", "µs", "usec", "micros", "microseconds"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "min": ("min", "mins", "minute", "minutes"),
    "h": ("h", "hour", "hours"),
    "hz": ("hz", "hertz"),
    "rad": ("rad", "rads", "radian", "radians"),
    "deg": ("deg", "degs", "degree", "degrees", "°"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "cm": ("cm",),
    "mm": ("mm",),
    "km": ("km",),
}
UNIT_OF = {word: unit for unit, words in _UNITS.items() for word in words}
"""The units of measurement by their usual spellings, in lower case."""
LIKE = 0.7
"""The minimum similarity at which one word may be a typo of another."""
_SHORT, _LIKE_SHORT = 3, 0.6
_LIKE_WHOLE = 0.88
"""The minimum similarity at which two names with different numbers of words may be typos of each other."""
_MOST_NEAR = 10
_WORDS = r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[^\W\dA-Za-z_]+|\d+"
_BETWEEN = r"_|(?<=[^\W\d])[\s-]+(?=[^\W\d])"
"""The separators between the words of a name. A minus sign is not a separator: `-5` differs from `5`."""
_LETTER = r"[^\W\d_]"
_PARTS = r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])"


def unit_suffix(name: str) -> str:
    """Return the unit at the end of a name, such as `ms` for `delay_msec`; empty without a unit."""
    parts = re.findall(_PARTS, name)
    return UNIT_OF.get(parts[-1].lower(), "") if parts else ""


def has_same_unit(written: str, meant: str) -> bool:
    """Return whether two names have the same unit.

    For example, `delay_msec` and `msec` do, but `msec` and `sec` do not.
    """
    unit = unit_suffix(meant)
    if unit == unit_suffix(written):
        return True
    # The last part of the written name may be a misspelt unit (`mesc`) if both names have the same number of parts.
    return not unit_suffix(written) and len(re.findall(_PARTS, written)) == len(re.findall(_PARTS, meant))


def nearest(word: str, known: Iterable[str], least: float = LIKE) -> str | None:
    """Return the known word that was probably meant by a written word; None if no known word is similar.

    A number is never suggested for another number. For a name with a unit (`delay_msec`), no name with another unit or
    without a unit is suggested, because the written value would then have another meaning.

    Args:
        word: The written word.
        known: The known words.
        least: The minimum similarity, from 0 to 1, of each word of the written name to the word at the same position of
            the known name. Names that differ only in case and separators always match.
    """
    import difflib

    candidates, lower, folded = (
        [each for each in known if has_same_unit(word, each)],
        word.lower(),
        _fold(word),
    )
    least = min(least, _LIKE_SHORT) if len(word) <= _SHORT else least
    found = (
        [candidate for candidate in candidates if candidate.lower() == lower]
        or [candidate for candidate in candidates if _fold(candidate) == folded]
        or [
            candidate
            for candidate in difflib.get_close_matches(word, candidates, n=_MOST_NEAR, cutoff=least)
            if re.search(_LETTER, word) and _is_near(word, candidate, least)
        ]
    )
    return found[0] if found else None


def is_typo(written: str, meant: str) -> bool:
    """Return whether two words differ only in case or in one letter.

    The letter may be extra, missing, wrong or swapped with its neighbour.
    """
    one, other = written.lower(), meant.lower()
    if one == other:
        return True
    if min(len(one), len(other)) < _SHORT or any(each.isdigit() for each in one + other):
        return False
    before = 0
    while one[before : before + 1] == other[before : before + 1] != "":
        before += 1
    one, other = one[before:], other[before:]
    return (
        one[1:] == other[1:]
        or one[1:] == other
        or one == other[1:]
        or (one[:2] == other[1::-1] and one[2:] == other[2:])
    )


def likeness(word: str, other: str) -> float:
    """Return how similar the letters of two words are, as a number from 0 to 1."""
    import difflib

    return difflib.SequenceMatcher(None, word, other).ratio()


def _is_near(written: str, meant: str, least: float) -> bool:
    """Return whether two names are similar word by word."""
    if _is_misspelt(written, meant):
        return True
    words, others = (re.findall(_WORDS, each) for each in (written, meant))
    if len(words) != len(others):  # a word is extra or missing, so the rest must be nearly equal
        words, others, least = [_fold(written)], [_fold(meant)], max(least, _LIKE_WHOLE)
    return all(_is_like(*pair, least) for pair in zip(words, others, strict=True))


def _is_misspelt(written: str, meant: str) -> bool:
    """Return whether two names differ in one extra, missing or swapped letter."""
    shorter = min(len(written), len(meant))
    is_other = len(written) == len(meant) and sorted(written.lower()) != sorted(meant.lower())
    return shorter > _SHORT and not is_other and is_typo(written, meant)


def _is_like(word: str, other: str, least: float) -> bool:
    """Return whether one word may be a typo of another.

    `unlock` does not count as a typo of `lock`, nor `get` of `set`.
    """
    one, two = word.lower(), other.lower()
    if one[:1] != two[:1]:
        return min(len(one), len(two)) > _SHORT and is_typo(one, two)
    least = min(least, _LIKE_SHORT) if len(one) <= _SHORT else least
    return one == two or is_typo(one, two) or (not one.isdigit() and likeness(one, two) >= least)


def did_you_mean(near: str | None) -> str:
    """Return the end of a message that suggests a word. For None, return an empty string."""
    return f"; did you mean '{near}'?" if near else ""


class Guesses:
    """Suggestions for misspelt words. The number of comparisons is limited, so that large files do not take too long."""

    def __init__(self) -> None:
        self._left = MOST_COMPARED

    def nearest(self, word: str, known: Collection[str], least: float = LIKE) -> str | None:
        """Return the word that was probably meant; None if the limit of comparisons is reached."""
        if len(known) > self._left:
            return None
        self._left -= len(known)
        return nearest(word, known, least)


def _fold(word: str) -> str:
    return re.sub(_BETWEEN, "", word).lower()
