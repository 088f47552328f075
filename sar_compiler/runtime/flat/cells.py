"""Cells: all that a flat tree remembers between two ticks, in one list.

A cell holds a small whole number or another value that can be hashed. The first ones are the statuses of the nodes,
in pre-order; behind them come the positions, counters and timers that nodes have asked for.
"""

from collections.abc import Callable
from typing import Any

from py_trees.common import Status

from sar_compiler.runtime.flat.times import Times

INVALID = 0
RUNNING = 1
SUCCESS = 2
FAILURE = 3
SKIPPED = 4
"""The outcome of a skipped tick, which is never a status."""

ENDED = SUCCESS & FAILURE
"""What only SUCCESS and FAILURE have in common: `outcome & ENDED` is not 0 for these two."""

STATUSES = _, _RUNNING, _SUCCESS, _FAILURE = Status.INVALID, Status.RUNNING, Status.SUCCESS, Status.FAILURE
"""py_trees' status for each number."""

Cells = list[Any]
Tick = Callable[[Cells, Times], int]
"""Ticks a node and returns its outcome: RUNNING, SUCCESS, FAILURE or SKIPPED."""
Stop = Callable[[Cells, Times], None]
"""Stops a node as `Behaviour.stop(Status.INVALID)` does."""


def number_of(status: object) -> int:
    """Return the number of a status of py_trees; INVALID for what is none."""
    # By identity, and by names of this module: the hash of a member of an enumeration is slow, and so is to look it up.
    if status is _RUNNING:
        return RUNNING
    if status is _SUCCESS:
        return SUCCESS
    if status is _FAILURE:
        return FAILURE
    return INVALID
