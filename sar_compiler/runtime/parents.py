"""The common base of nodes with children that follow BehaviorTree.CPP's rules.

Stock py_trees classes know no SKIPPED, and keep the statuses of children that have ended until these are started
again. The classes on top of these ask what the tick of a child has come to (`outcome_of`), and reset children
when BehaviorTree.CPP does: one that is running is halted, one that has ended only forgets how it did.
"""

from abc import abstractmethod
from collections.abc import Generator, Iterator, Sequence
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from sar_compiler.runtime.leaf_protocol import Wake, stay_asleep
from sar_compiler.runtime.skipping import SKIPPED, reset, was_skipped

Ticking = Generator[Behaviour, None, Status]
"""A tick in progress: yields the nodes that are ticked, and returns the outcome (perhaps `SKIPPED`)."""


class Parent(Behaviour):
    """A node with children that keeps BehaviorTree.CPP's rules.

    `tick` and `stop` are the same for all of them. What makes one of them is `_work`, and `_halt` for one that
    remembers something.

    Attributes:
        skipped: Whether the last tick was skipped; the status is then not the tick's, see `runtime.skipping`.
        is_its_child: Whether it and its child are one node, with one status.
    """

    skipped = False
    is_its_child = False

    def tick(self) -> Iterator[Behaviour]:
        """Tick once, yielding every node that is ticked on the way, and this one last."""
        self.skipped = False
        outcome = yield from self._work()
        if outcome == SKIPPED:
            self.skipped = True
        else:
            self.status = outcome
        yield self

    def update(self) -> Status:
        """Return the status; `tick` does the work of a node with children."""
        return self.status

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """End; with INVALID the node is halted, and its children with it.

        Args:
            new_status: The status from now on.
        """
        if new_status == Status.INVALID:
            self._halt()
            self.feedback_message = ""
        self.status = new_status

    @abstractmethod
    def _work(self) -> Ticking:
        """Tick the children whose turn it is, and return the outcome."""

    def _starts(self) -> bool:
        """Return whether this tick starts the node, rather than goes on with it.

        The status alone cannot tell. BehaviorTree.CPP starts a node that is IDLE, and its controls and decorators
        reset their children to that (here INVALID) when their own work is over. A child with SUCCESS or FAILURE below
        such a parent was therefore ticked earlier in the same work and goes on: WhileDoElse ticks its condition again
        without resetting it. py_trees never resets a child that has ended; it starts any that is not RUNNING. So
        below a stock parent, SUCCESS and FAILURE mean that the node starts, and so they do at the root, which is
        ticked again after its end. A parent that is one node with its child (`is_its_child`) resets nothing by
        itself; the one around it decides.
        """
        if self.status == Status.RUNNING:
            return False
        around = self.parent
        while isinstance(around, Parent) and around.is_its_child:
            around = around.parent
        return self.status == Status.INVALID or not isinstance(around, Parent)

    def _halt(self) -> None:
        """Halt the children, in order, and forget where the node was."""
        self._reset_children()

    def _reset_children(self, first: int = 0) -> None:
        for child in self.children[first:]:
            reset(child)


class Control(Parent, Composite):
    """A node with several children.

    Args:
        name: The node's name.
        children: The children, in order.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        # By its name: some controls are subclasses of stock ones, whose constructors want more.
        Composite.__init__(self, name, list(children))

    def _tick_child(self, index: int) -> Ticking:
        """Tick a child."""
        child = self.current_child = self.children[index]
        yield from child.tick()
        return outcome_of(child)

    def tip(self) -> Behaviour | None:
        """Return the deepest node that the last tick reached; this one if its children are at rest."""
        below: Behaviour | None = super().tip()
        return below or (self if self.status != Status.INVALID else None)

    def _halt(self) -> None:
        self.current_child = None
        super()._halt()


class Wrapper(Parent, Decorator):
    """A node with one child.

    Args:
        name: The node's name.
        child: The child.
    """

    def __init__(self, name: str, child: Behaviour) -> None:
        Decorator.__init__(self, name, child)

    def _tick_child(self) -> Ticking:
        """Tick the child, and leave it at rest if it has ended, as every decorator of BehaviorTree.CPP does."""
        child = self.decorated
        yield from child.tick()
        outcome = outcome_of(child)
        if ended(outcome):
            child.status = Status.INVALID
        return outcome


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

    def _pause(self) -> Status:
        self._wake()
        return Status.RUNNING


def outcome_of(child: Behaviour) -> Status:
    """Return the outcome of a child's last tick: its status, or `SKIPPED`."""
    return SKIPPED if was_skipped(child) else child.status


def ended(outcome: Status) -> bool:
    """Return whether an outcome is SUCCESS or FAILURE."""
    return outcome in (Status.SUCCESS, Status.FAILURE)
