"""The outcome of a tick as an attribute of a tree file names it."""

import enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from py_trees.common import Status


class Outcome(enum.Enum):
    """An outcome that an attribute chooses."""

    SUCCESS = "SUCCESS"
    FAILURE = "FAILURE"
    RUNNING = "RUNNING"
    SKIPPED = "SKIPPED"

    @property
    def status(self) -> "Status":
        """The outcome that a tick returns."""
        from py_trees.common import Status

        from sar_compiler.runtime.skipping import SKIPPED

        return SKIPPED if self is Outcome.SKIPPED else Status[self.name]
