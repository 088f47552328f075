"""Pauses of the garbage collector while a program builds a large structure or imports large modules."""

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager

LARGE = 100_000
"""The number of characters of source text (about 2,000 elements) above which garbage collection takes noticeable time."""

# Python 3.12 itself freezes about 400 objects at each collection. If more objects are frozen, other code has called `gc.freeze`.
_FROZEN = 1_000


@contextmanager
def gc_paused(acyclic: int = 0) -> Iterator[None]:
    """Pause garbage collection while building a structure that creates no garbage.

    For a large tree, garbage collection would take as long as the rest of the work.

    Args:
        acyclic: The number of characters of source text if the structure has no reference cycles, else 0. A large structure
            is moved directly to the oldest generation, which saves the collector two scans. A structure with cycles must
            not be moved: the collector would not count its objects, and would collect them too late.
    """
    enabled = gc.isenabled()
    # Objects that other code has frozen must stay frozen.
    moves = enabled and acyclic >= LARGE and gc.get_freeze_count() < _FROZEN
    if moves:
        gc.collect(1)  # collect existing garbage before it is moved to the oldest generation
    gc.disable()
    try:
        yield
    finally:
        if moves:
            gc.freeze()
            gc.unfreeze()  # moves the objects to the oldest generation
        if enabled:
            gc.enable()


@contextmanager
def large_imports() -> Iterator[None]:
    """Disable garbage collection during large imports. Scanning the imported objects, now or later, would free no memory."""
    with gc_paused(LARGE):
        yield
    atexit.register(gc.freeze)
