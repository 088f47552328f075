"""The numbers that represent outcomes and statuses in the cells of a tree."""

from typing import Any, Final

from py_trees import decorators
from py_trees.common import Status

INVALID: Final = 0
RUNNING: Final = 1
SUCCESS: Final = 2
FAILURE: Final = 3
SKIPPED: Final = 4
"""The outcome of a node that was skipped. It is an outcome, but not a status."""
CALLED: Final = 5
"""A marker that a node returns instead of an outcome if another node has to be ticked first."""

WORDS: Final[tuple[str, ...]] = ("", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED")
"""The names of the outcomes, by number. The name of INVALID is empty."""

ENDED: Final = 2
"""The bit that only SUCCESS and FAILURE have: `outcome & ENDED` is zero for all other outcomes."""

STATUSES: Final[tuple[Any, ...]] = (Status.INVALID, Status.RUNNING, Status.SUCCESS, Status.FAILURE)
"""py_trees' statuses, by number. The type has a variable length, because mypyc would box a tuple of fixed length at every access."""

# Stored in variables, because access to a member of an enumeration is slow.
_RUNNING: Final[Any] = Status.RUNNING
_SUCCESS: Final[Any] = Status.SUCCESS
_FAILURE: Final[Any] = Status.FAILURE


IS_2_3: Final = not hasattr(decorators, "ForEach")
"""Whether the installed py_trees is version 2.3, whose behaviour differs slightly from that of later versions."""


def number_of(status: Any) -> int:
    """Return the number of a py_trees status; INVALID for any other value."""
    if status is _RUNNING:
        return RUNNING
    if status is _SUCCESS:
        return SUCCESS
    if status is _FAILURE:
        return FAILURE
    return INVALID
