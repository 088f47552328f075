"""The common base of nodes with children that follow BehaviorTree.CPP's rules.

Stock py_trees classes do not know SKIPPED, and keep the statuses of ended children until these are restarted.
The classes derived from these use the outcome of a child's tick, and reset children like BehaviorTree.CPP:
a running child is halted, and an ended one only loses its status.

The class of a node in the kernel (`node_class`) defines its behaviour in a tick and when it is halted, whether it is ticked
by itself or in a tree.
"""

from collections.abc import Callable, Hashable, Iterator
from functools import wraps
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.clock import Clock, WallClock
from sar_compiler.runtime.leaf_protocol import Wake, ignore_wake

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, TreeNode, Visit
    from sar_compiler.runtime.kernel.user_nodes import Tick


class Children(list[Behaviour]):
    """The children of a behaviour, in a list that counts the changes of all lists of its kind.

    Attributes:
        changes: The number of changes of all such lists so far.
    """

    changes: ClassVar[int] = 0

    @classmethod
    def from_list(cls, children: list[Behaviour]) -> "Children":
        """Return children as a list of this class."""
        return children if isinstance(children, cls) else cls(children)

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        """Pickle and copy the children as a plain list."""
        return list, (list(self),)


def _count_changes(name: str) -> Callable[..., Any]:
    change = getattr(list, name)

    @wraps(change)
    def count_change(self: Children, *args: Any, **kwargs: Any) -> Any:
        Children.changes += 1
        return change(self, *args, **kwargs)

    return count_change


_PLAIN = ("append", "clear", "extend", "insert", "pop", "remove", "reverse", "sort")
for _name in (*_PLAIN, "__delitem__", "__iadd__", "__imul__", "__setitem__"):
    setattr(Children, _name, _count_changes(_name))


class TickedTree(Protocol):
    """The view of a kernel tree for a behaviour that has a node in it; see `LiveTree`."""

    def is_whole(self) -> bool:
        """Return whether all nodes still have the same children."""

    def tick(self, visits: "list[Visit] | None" = None, index: int = 0) -> int:
        """Tick a node once, and record the ticked nodes below it."""

    def stop(self, index: int = 0) -> None:
        """Stop a node."""


class KernelTicking(NamedTuple):
    """Define how py_trees ticks a behaviour through the kernel.

    Attributes:
        make_tree: Function that builds the kernel tree of a root and its descendants, and takes over the state of an earlier tree.
        show_visits: Function that yields the ticked behaviours, each with its status at that time.
    """

    make_tree: Callable[..., TickedTree]
    show_visits: "Callable[[list[Visit]], Iterator[Behaviour]]"


class EngineBehaviour(Behaviour):
    """A behaviour that its node in the kernel ticks and stops.

    If py_trees ticks it by its own methods, it is the root of a kernel tree with all its descendants.

    Args:
        name: The node's name.
        clock: The clock that measures the time.
        enums: The named constants.

    Attributes:
        node_class: The class of the node; None for a class that is only a base.
        ticking: The functions for ticking, which `runtime.ticking` sets.
        clock: The clock of the node.
        skipped: Whether the last tick was skipped; the status is then not the tick's, see `runtime.skipping`.
    """

    node_class: "ClassVar[type[TreeNode] | None]" = None
    ticking: ClassVar[KernelTicking]
    skipped = False
    clock: Clock = WallClock()
    place: tuple[TickedTree, int] | None = None
    """The tree that contains its node, and the node's index in it."""
    wake: Wake = staticmethod(ignore_wake)
    """Requests the next tick at once, for a node that returns RUNNING between children, so that other nodes are ticked."""

    def setup(self, **kwargs: Any) -> None:
        """Store the runner's `wake` function.

        Args:
            **kwargs: The runner's arguments; `wake` is optional and requests another tick at once.
        """
        self.wake = kwargs.get("wake", ignore_wake)

    def build_node(self, part: "NodeBuilder") -> "TreeNode":
        """Build the node with the kernel's builder."""
        assert self.node_class is not None  # noqa: S101 - only called with a class
        return self.node_class(part)

    def tick(self) -> Iterator[Behaviour]:
        """Tick once, then yield each ticked node with its status, this one last."""
        visits: list[Visit] = []
        try:
            tree, index = self._tree_and_index()
            tree.tick(visits, index)
        finally:
            yield from self.ticking.show_visits(visits)
        yield self

    def _tree_and_index(self) -> tuple[TickedTree, int]:
        if self.place is None or not self.place[0].is_whole():
            self.ticking.make_tree(self, former=self.place[0] if self.place else None)
        assert self.place is not None  # noqa: S101 - set by the tree
        return self.place

    def update(self) -> Status:
        """Return the status, which `tick` has set."""
        return self.status

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Stop the node; with INVALID, the node and its children are halted."""
        if new_status == Status.INVALID:
            tree, index = self._tree_and_index()
            tree.stop(index)
        self.status = new_status


class Cell(NamedTuple):
    """A memory cell of a control or decorator.

    Attributes:
        number: Its index among the node's cells.
        first: Its initial value.
        keeps: Whether it keeps its value when the node ends or is halted.
    """

    number: int
    first: Hashable
    keeps: bool


class EngineParent(EngineBehaviour):
    """A node with children that follows BehaviorTree.CPP's rules.

    A class without a `node_class` chooses the next child in `begin` and `resume`. Between these calls, and between ticks, it
    stores its state only in cells, so that `verify` can restore any of its states.

    Attributes:
        is_its_child: Whether it and its child are one node, with one status.
        cells: Its cells.
    """

    is_its_child = False
    cells: tuple[Cell, ...] = ()

    def cell(self, first: Hashable = 0, *, keeps: bool = False) -> Cell:
        """Add a cell, in the constructor; `tick[cell]` is its value, which must be hashable and immutable.

        Args:
            first: The initial value, which is restored when the node ends or is halted.
            keeps: Whether the value is kept instead.
        """
        added = Cell(len(self.cells), first, keeps)
        self.cells = (*self.cells, added)
        return added

    def insert_leaf(self, leaf: Behaviour) -> None:
        """Insert a leaf that represents the world around the node, before the children."""
        self.children.insert(0, leaf)
        leaf.parent = self

    def begin(self, tick: "Tick") -> Behaviour | Status:
        """Begin a tick.

        Args:
            tick: The access to the tick's state and functions.

        Returns:
            The child to tick first; or the outcome, if no child is needed. With `SKIPPED` the node is skipped, and with any
                outcome but RUNNING it has ended, and its children are reset.
        """
        raise NotImplementedError

    def resume(self, tick: "Tick", outcome: Status) -> Behaviour | Status:
        """Continue a tick after a child.

        Args:
            tick: The access to the tick's state and functions.
            outcome: The outcome of the child; `SKIPPED` if it was skipped.

        Returns:
            As for `begin`. A child that has ended is restarted if it is ticked again.
        """
        raise NotImplementedError

    def build_node(self, part: "NodeBuilder") -> "TreeNode":
        """Build the node with the kernel's builder."""
        if self.node_class is not None:
            return self.node_class(part)
        from sar_compiler.runtime.kernel.user_nodes import UserNode

        return UserNode(part)
