"""The common base of nodes with children that follow BehaviorTree.CPP's rules.

Stock py_trees classes know no SKIPPED, and keep the statuses of children that have ended until these are started
again. The classes on top of these ask what the outcome of a child's tick was, and reset children when BehaviorTree.CPP
does: one that is running is halted, one that has ended only forgets how it did.

A class has the constructor, and what its builder asks of it. What it does in a tick, and when it is halted, is said by
the builder (`runtime.flat.parts.builds`), whether the node is ticked by itself or in a flat tree.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from sar_compiler.runtime.clock import Clock, WallClock
from sar_compiler.runtime.leaf_protocol import Wake, stay_asleep

if TYPE_CHECKING:
    from sar_compiler.runtime.flat.single import SingleNode, Visit, Visits


class Built(Behaviour):
    """A node that ticks and stops as its builder says.

    The builder is asked with the first tick or stop, for this node alone: a flat tree that it is part of asks it
    again, and remembers for itself.

    Attributes:
        clock: What the node measures time with.
        skipped: Whether the last tick was skipped; the status is then not the tick's, see `runtime.skipping`.
    """

    skipped = False
    clock: Clock = WallClock()
    _form: "SingleNode | None" = None

    def tick(self) -> Iterator[Behaviour]:
        """Tick once; then yield every node that was ticked on the way as it was after its tick, and this one last."""
        visits: list[Visit] = []
        try:
            self.work(visits)
        finally:
            for node, status, message in visits:
                now = node.status, node.feedback_message
                node.status, node.feedback_message = status, message
                try:
                    yield node
                finally:
                    # Whoever was shown it may have stopped it.
                    if node.status is status:
                        node.status, node.feedback_message = now
        yield self

    def work(self, visits: "Visits") -> int:
        """Tick once, and yield nothing.

        Args:
            visits: Where the nodes below it go that are ticked, in order.

        Returns:
            The outcome, as a number of `flat.cells`.
        """
        return self._single().tick(visits)

    def _single(self) -> "SingleNode":
        if self._form is None or not self._form.is_of(self.children):
            # Only now: what is only checked is never ticked, and the builders import this module.
            from sar_compiler.runtime.flat.single import SingleNode

            self._form = SingleNode(self)
        return self._form

    def update(self) -> Status:
        """Return the status; `tick` does the work."""
        return self.status

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """End; with INVALID the node is halted, and its children with it.

        Args:
            new_status: The status from now on.
        """
        if new_status == Status.INVALID:
            self._single().halt()
        self.status = new_status


class Parent(Built):
    """A node with children that keeps BehaviorTree.CPP's rules.

    Attributes:
        is_its_child: Whether it and its child are one node, with one status.
    """

    is_its_child = False


class Control(Parent, Composite):
    """A node with several children.

    Args:
        name: The node's name.
        children: The children, in order.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        # By its name: some controls are subclasses of stock ones, whose constructors want more.
        Composite.__init__(self, name, list(children))

    def tip(self) -> Behaviour | None:
        """Return the deepest node that the last tick reached; this one if its children are at rest."""
        below: Behaviour | None = super().tip()
        return below or (self if self.status != Status.INVALID else None)


class Wrapper(Parent, Decorator):
    """A node with one child.

    Args:
        name: The node's name.
        child: The child.
    """


class Yielding(Parent):
    """A node that pauses in the middle of its work, so that the rest of the tree gets its turn.

    To pause is to ask for the next tick at once and to answer RUNNING. A stock composite goes on in the same
    tick, and a stock decorator waits for the next beat of the clock.
    """

    _wake: Wake = staticmethod(stay_asleep)

    def setup(self, **kwargs: Any) -> None:
        """Take what the runner offers.

        Args:
            **kwargs: Perhaps `wake`, to be called when the tree is to be ticked again at once.
        """
        self._wake = kwargs.get("wake", stay_asleep)
