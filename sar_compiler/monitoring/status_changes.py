"""The changes of the statuses of a tree's nodes, as BehaviorTree.CPP reports them."""

from collections.abc import Callable
from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.visitors import VisitorBase

from sar_compiler.monitoring.numbered_tree import NumberedTree
from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING, number_of
from sar_compiler.runtime.skipping import was_skipped

IDLE = INVALID
"""The status of a node that waits for its start; beside RUNNING, SUCCESS and FAILURE of `kernel.cells`."""


class StatusChange(NamedTuple):
    """A change of a node's status.

    Attributes:
        uid: The node's number.
        before: Its status before.
        status: Its status.
    """

    uid: int
    before: int
    status: int


class StatusChanges(VisitorBase):
    """Watches every node that is ticked.

    A node that has ended is IDLE as soon as the work of the node around it is over, and so is one that was stopped: as in
    BehaviorTree.CPP, whatever class of py_trees it is. A node that is skipped stays as it was.

    Args:
        tree: The tree.
        note: Called with each change.

    Attributes:
        statuses: The status of each node, by its number; the first is nobody's.
    """

    def __init__(self, tree: NumberedTree, note: Callable[[StatusChange], object]) -> None:
        super().__init__(full=False)
        self.statuses = [IDLE] * (len(tree.nodes) + 1)
        self._tree = tree
        self._note = note
        self._busy: set[int] = set()

    def run(self, behaviour: Behaviour) -> None:
        """Watch a node that was ticked."""
        uid = self._tree.uid(behaviour)
        if uid and not was_skipped(behaviour):
            self._set(uid, number_of(behaviour.status))

    def finalise(self) -> None:
        """Watch the nodes whose work is over, the outer ones first."""
        for uid in sorted(self._busy):
            _, _, around, behaviour, *_ = self._tree.nodes[uid - 1]
            status = number_of(behaviour.status)
            if status == INVALID or (status & ENDED and self.statuses[around] != RUNNING):
                self._set(uid, IDLE)

    def run_around(self, uid: int) -> None:
        """Have the nodes around one count as RUNNING, because a tick pauses within."""
        for each in reversed([*self._tree.around(uid)]):
            self._set(each, RUNNING)

    def _set(self, uid: int, status: int) -> None:
        before = self.statuses[uid]
        if before != status:
            self.statuses[uid] = status
            (self._busy.discard if status == IDLE else self._busy.add)(uid)
            self._note(StatusChange(uid, before, status))
