"""Pausing the garbage collector while something large is built."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

LARGE = 100_000
"""The number of characters (some 2,000 elements) from which collecting what is built takes noticeable time."""

# Python 3.12 freezes some 400 objects of its own, again with every collection; whoever else freezes, freezes all there is.
_FROZEN = 1_000


@contextmanager
def gc_paused(acyclic: int = 0) -> Iterator[None]:
    """Pause the garbage collector while something grows that leaves no garbage.

    For large trees that would take as long as everything else together.

    Args:
        acyclic: How many characters of text it grows from, if nothing in it refers back to itself. Where these are
            many, it counts as old at once: the collector would look at all of it twice before that. What has
            cycles must not, since the collector would not know how much of it there is, and leave it too long.
    """
    enabled = gc.isenabled()
    # What somebody else has frozen must stay so.
    ages = enabled and acyclic >= LARGE and gc.get_freeze_count() < _FROZEN
    if ages:
        gc.collect(1)  # nothing that is garbage already may grow old
    gc.disable()
    try:
        yield
    finally:
        if ages:
            gc.freeze()
            gc.unfreeze()  # to where the oldest objects are
        if enabled:
            gc.enable()
