"""The outcome of a tick as an attribute of a tree file names it."""

import enum

from py_trees.common import Status

from sar_compiler.runtime.skipping import SKIPPED


class Outcome(enum.Enum):
    """An outcome that an attribute chooses; its value is what a tick returns."""

    SUCCESS = Status.SUCCESS
    FAILURE = Status.FAILURE
    RUNNING = Status.RUNNING
    SKIPPED = SKIPPED
