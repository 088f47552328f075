"""Outcomes and statuses as small whole numbers, as the cells of a tree hold them."""

from typing import Any, Final

from py_trees import decorators
from py_trees.common import Status

INVALID: Final = 0
RUNNING: Final = 1
SUCCESS: Final = 2
FAILURE: Final = 3
SKIPPED: Final = 4
"""The outcome of a skipped tick, which is never a status."""
CALLED: Final = 5
"""In place of an outcome: another node has to be ticked first."""

WORDS: Final[tuple[str, ...]] = ("", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED")
"""The word for each outcome; empty for none."""

ENDED: Final = 2
"""What only SUCCESS and FAILURE have in common: `outcome & ENDED` is not 0 for these two."""

STATUSES: Final[tuple[Any, ...]] = (Status.INVALID, Status.RUNNING, Status.SUCCESS, Status.FAILURE)
"""py_trees' status for each number; of any length for the compiler, which would make an object of a table of four at every look."""

# Names of this module: to look up a member of an enumeration is slow.
_RUNNING: Final[Any] = Status.RUNNING
_SUCCESS: Final[Any] = Status.SUCCESS
_FAILURE: Final[Any] = Status.FAILURE


IS_2_3: Final = not hasattr(decorators, "ForEach")
"""Whether this is py_trees 2.3, which does some things differently."""


def number_of(status: Any) -> int:
    """Return the number of a status of py_trees; INVALID for what is none."""
    if status is _RUNNING:
        return RUNNING
    if status is _SUCCESS:
        return SUCCESS
    if status is _FAILURE:
        return FAILURE
    return INVALID
