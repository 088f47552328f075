"""The nodes of a compiled tree with the numbers by which BehaviorTree.CPP's tools know them, and the changes of their statuses."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.visitors import VisitorBase

from sar_compiler.compiler import CompiledTree, Construction, Origins
from sar_compiler.errors import SarError
from sar_compiler.runtime.kernel.cells import ENDED, INVALID, RUNNING, number_of
from sar_compiler.runtime.skipping import was_skipped

MOST_NODES = 0xFFFF
"""A number has 16 bits, and 0 is none."""


class TooManyNodesError(SarError):
    """A tree has more nodes than there are numbers."""


class NumberedNode(NamedTuple):
    """A node of a tree.

    Attributes:
        uid: Its number: from 1, in pre-order.
        name: Its name.
        around: The number of the node around it; 0 at the root.
        behaviour: Its behaviour, the outer one where conditions are wrapped around it.
        inner: Its behaviour without its conditions.
        made: How the inner one was made.
    """

    uid: int
    name: str
    around: int
    behaviour: Behaviour
    inner: Behaviour
    made: Construction


class NumberedTree:
    """The nodes of a compiled tree, numbered as BehaviorTree.CPP does; a node and its conditions are one.

    Args:
        tree: The tree.

    Attributes:
        name: Its ID.
        scopes: The scopes of the tree and its subtrees, by their paths.
        nodes: The nodes; that with the number 1 is the first.

    Raises:
        TooManyNodesError: If it has more nodes than there are numbers.
    """

    def __init__(self, tree: CompiledTree) -> None:
        self.name = tree.instance.tree.name
        self.scopes = {each.scope.path: each.scope for each in tree.instance.iterate()}
        self.nodes = list(_number(tree.root, tree.origins))
        if len(self.nodes) > MOST_NODES:
            raise TooManyNodesError(
                f"the tree '{self.name}' has {len(self.nodes)} nodes; numbers of nodes have 16 bits in BehaviorTree.CPP's "
                f"protocols, which is enough for {MOST_NODES}"
            )
        self._uids = {id(each.behaviour): each.uid for each in self.nodes}
        self._inner = {id(each.inner): each.uid for each in self.nodes}

    def uid(self, behaviour: Behaviour) -> int:
        """Return the number of a behaviour; 0 for one that has none, or shares its node's with its conditions."""
        return self._uids.get(id(behaviour), 0)

    def uid_of_inner(self, behaviour: Behaviour) -> int:
        """Return the number of a behaviour; 0 for one that has none, or is the conditions of a node."""
        return self._inner.get(id(behaviour), 0)

    def node(self, uid: int) -> NumberedNode | None:
        """Return the node of a number; None if there is none."""
        return self.nodes[uid - 1] if 0 < uid <= len(self.nodes) else None

    def around(self, uid: int) -> Iterator[int]:
        """Yield the numbers of the nodes around one, from the inside out."""
        while uid := self.nodes[uid - 1].around:
            yield uid


def _number(root: Behaviour, origins: Origins) -> Iterator[NumberedNode]:
    waiting = [(root, 0)]
    uid = 0
    while waiting:
        behaviour, around = waiting.pop()
        inner = behaviour
        while getattr(inner, "is_its_child", False):
            (inner,) = inner.children
        uid += 1
        yield NumberedNode(uid, inner.name, around, behaviour, inner, origins.construction(inner.id))
        waiting.extend((child, uid) for child in reversed(inner.children))


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
