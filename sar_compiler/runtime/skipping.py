"""SKIPPED, which py_trees does not have.

A node that is skipped has not run: its parent passes it over. BehaviorTree.CPP never stores that status, it
only returns it: the node keeps the status it had. Here it is the same: `skipped` tells whether the last tick
of a node was one of these. py_trees' own composites and decorators know nothing of it, so the compiler uses
them only over children that cannot skip.
"""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

SKIPPED = Status.INVALID
"""The outcome "skipped": returned by `update` of a leaf, and used by the controls here."""


class SkippableLeaf(Behaviour):
    """A leaf whose `update` may return `SKIPPED`. That is not a halt: `terminate` is not called for it.

    Attributes:
        skipped: Whether the last tick was skipped.
    """

    skipped = False

    def tick(self) -> Iterator[Behaviour]:
        """Tick once; a tick that is skipped leaves the status as it was."""
        if self.status != Status.RUNNING:
            self.initialise()
        status = self.update()
        self.skipped = status == SKIPPED
        if not self.skipped:
            if status != Status.RUNNING:
                self.stop(status)
            self.status = status
        yield self


def was_skipped(behaviour: Behaviour) -> bool:
    """Return whether the tick that a behaviour has just had was skipped."""
    return behaviour.status == Status.INVALID or getattr(behaviour, "skipped", False)
