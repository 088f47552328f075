"""The conditions that end a run, in a module that `--help` can import quickly."""

from enum import Enum


class Until(str, Enum):
    """The condition that ends a run."""

    END = "end"
    """The root succeeds or fails."""
    COMPLETE = "complete"
    """The mission is complete, or can no longer become so."""
    SUCCESS = "success"
    """The root succeeds."""
    FAILURE = "failure"
    """The root fails."""
    FOREVER = "forever"
    """A signal stops the run."""
