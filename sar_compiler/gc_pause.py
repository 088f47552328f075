"""Pausing the garbage collector while a large structure is built."""

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager

LARGE = 100_000
"""The number of characters (some 2,000 elements) from which garbage collection takes noticeable time."""

# Python 3.12 freezes some 400 objects of its own, again with each collection; other code that freezes freezes everything.
_FROZEN = 1_000


@contextmanager
def gc_paused(acyclic: int = 0) -> Iterator[None]:
    """Pause garbage collection while building a structure that creates no garbage.

    For large trees, collection would take as long as all other work together.

    Args:
        acyclic: The number of characters of source text, if the structure has no reference cycles. A large structure is
            then moved to the oldest generation at once, because the collector would scan it twice before that.
            A structure with cycles must not be moved: the collector would not know its size and would wait too long.
    """
    enabled = gc.isenabled()
    # Objects that other code has frozen must stay frozen.
    ages = enabled and acyclic >= LARGE and gc.get_freeze_count() < _FROZEN
    if ages:
        gc.collect(1)  # collect existing garbage before it is moved to the oldest generation
    gc.disable()
    try:
        yield
    finally:
        if ages:
            gc.freeze()
            gc.unfreeze()  # into the oldest generation
        if enabled:
            gc.enable()


@contextmanager
def large_imports() -> Iterator[None]:
    """Disable garbage collection during large imports; scanning the new objects, then or later, would free nothing."""
    with gc_paused(LARGE):
        yield
    atexit.register(gc.freeze)
