"""The conditions that end a run. They have their own module, so that `--help` imports no others."""

from enum import Enum


class Until(str, Enum):
    """The condition that ends a run."""

    END = "end"
    """The tree's root succeeds, fails or is skipped."""
    COMPLETE = "complete"
    """The mission is complete, or no work is left that could complete it."""
    SUCCESS = "success"
    """The tree's root succeeds."""
    FAILURE = "failure"
    """The tree's root fails."""
    FOREVER = "forever"
    """No state of the tree or the mission ends the run: it continues until a signal stops it."""
