"""The conditions that end a run.

They are in a module of their own, so that `sar-run --help` does not need to import other modules.
"""

from enum import Enum


class Until(str, Enum):
    """The condition that ends a run."""

    END = "end"
    """The tree's root succeeds, fails or is skipped."""
    COMPLETE = "complete"
    """The mission is complete, or cannot be completed because no work is left."""
    SUCCESS = "success"
    """The tree's root succeeds."""
    FAILURE = "failure"
    """The tree's root fails."""
    FOREVER = "forever"
    """The run continues, whatever the state of the tree and the mission, until a signal stops it."""
