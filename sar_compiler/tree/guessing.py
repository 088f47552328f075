"""Guesses of the words that were meant."""

from collections.abc import Collection, Iterable

MOST_COMPARED = 100_000
"""The largest number of words that one `Guesses` compares with what was written."""


def nearest(word: str, known: Iterable[str], likeness: float = 0.6) -> str | None:
    """Return the known word that was probably meant, or None.

    Args:
        word: What was written.
        known: The words that may have been meant.
        likeness: How alike the two must be at least, from 0 to 1, if they differ in more than case and underscores.
    """
    import difflib

    candidates, lower, folded = list(known), word.lower(), _folded(word)
    found = (
        [candidate for candidate in candidates if candidate.lower() == lower]
        or [candidate for candidate in candidates if _folded(candidate) == folded]
        or difflib.get_close_matches(word, candidates, n=1, cutoff=likeness)
    )
    return found[0] if found else None


def did_you_mean(near: str | None) -> str:
    """Return the end of a sentence that asks whether a word was meant; empty for None."""
    return f"; did you mean '{near}'?" if near else ""


class Guesses:
    """Guesses of the words that were meant, which end when they would take long in a large file."""

    def __init__(self) -> None:
        self._left = MOST_COMPARED

    def nearest(self, word: str, known: Collection[str], likeness: float = 0.6) -> str | None:
        """Return the known word that was probably meant, as `nearest`; None if there are too many to compare."""
        if len(known) > self._left:
            return None
        self._left -= len(known)
        return nearest(word, known, likeness)


def _folded(word: str) -> str:
    return word.replace("_", "").lower()
