"""Outcomes and statuses as small integers, for the cells of a tree."""

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
"""A marker in place of an outcome: another node has to be ticked first."""

WORDS: Final[tuple[str, ...]] = ("", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED")
"""The name of each outcome; empty for none."""

ENDED: Final = 2
"""The common bits of SUCCESS and FAILURE: `outcome & ENDED` is not 0 only for these two."""

STATUSES: Final[tuple[Any, ...]] = (Status.INVALID, Status.RUNNING, Status.SUCCESS, Status.FAILURE)
"""py_trees' status for each number; of variable length, because mypyc would box a fixed table at every access."""

# Names of this module, because access to a member of an enumeration is slow.
_RUNNING: Final[Any] = Status.RUNNING
_SUCCESS: Final[Any] = Status.SUCCESS
_FAILURE: Final[Any] = Status.FAILURE


IS_2_3: Final = not hasattr(decorators, "ForEach")
"""Whether this is py_trees 2.3, which behaves slightly differently."""


def number_of(status: Any) -> int:
    """Return the number of a py_trees status; INVALID for any other value."""
    if status is _RUNNING:
        return RUNNING
    if status is _SUCCESS:
        return SUCCESS
    if status is _FAILURE:
        return FAILURE
    return INVALID
