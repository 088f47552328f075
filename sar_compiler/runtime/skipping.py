"""The outcome SKIPPED, which does not exist in py_trees.

A skipped node has not run, and its parent continues with the next child. In BehaviorTree.CPP, the tick returns SKIPPED, but the node keeps
its old status. In this project, a skipped node also keeps its old status, and its attribute `skipped` is True. py_trees' own composites and
decorators do not support SKIPPED, so the compiler uses them only if none of their children can be skipped.
"""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

SKIPPED = Status.INVALID
"""The outcome "skipped". A leaf's `update` can return this outcome, and this project's controls support it."""


class SkippableLeaf(Behaviour):
    """A leaf whose `update` may return `SKIPPED`. A skipped tick does not call `terminate`.

    Attributes:
        skipped: Whether the last tick was skipped.
    """

    skipped = False

    def tick(self) -> Iterator[Behaviour]:
        """Tick once. A skipped tick does not change the status."""
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
    """Return whether the last tick of a behaviour was skipped."""
    return behaviour.status == Status.INVALID or getattr(behaviour, "skipped", False)
