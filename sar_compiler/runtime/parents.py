"""The base classes of behaviours that follow BehaviorTree.CPP's rules.

The classes of py_trees do not support SKIPPED, and keep the statuses of ended children until these children are restarted. Classes derived
from this module use the outcome of a child's tick, and reset children like BehaviorTree.CPP: a running child is halted, and an ended child
only loses its status.

The node class in the kernel (`node_class`) defines the effect of a tick and of a halt, whether py_trees or the kernel requests it.
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
    """A list of the children of a behaviour. The class counts the changes of all its instances.

    Attributes:
        changes: The number of changes of all instances so far.
    """

    changes: ClassVar[int] = 0

    @classmethod
    def from_list(cls, children: list[Behaviour]) -> "Children":
        """Convert a plain list of children to an instance of this class."""
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
    """The methods that behaviours call on a kernel tree; see `LiveTree`."""

    def is_whole(self) -> bool:
        """Return whether all nodes still have the children that they had when the tree was built."""

    def tick(self, visits: "list[Visit] | None" = None, index: int = 0) -> int:
        """Tick the node at an index once, and add its ticked descendants to the visits."""

    def stop(self, index: int = 0) -> None:
        """Stop the node at an index."""


class KernelTicking(NamedTuple):
    """The functions with which py_trees ticks a behaviour through the kernel.

    Attributes:
        make_tree: Function that builds the kernel tree below a root, and copies the state from an earlier kernel tree.
        show_visits: Function that yields the ticked behaviours, each with its status at the end of its tick.
    """

    make_tree: Callable[..., TickedTree]
    show_visits: "Callable[[list[Visit]], Iterator[Behaviour]]"


class EngineBehaviour(Behaviour):
    """A behaviour that is ticked and stopped by a node of the kernel.

    If py_trees calls the behaviour's own `tick`, the behaviour becomes the root of a kernel tree that contains its descendants.

    Args:
        name: The node's name.
        clock: The clock that measures the time.
        enums: The named constants.

    Attributes:
        node_class: The node class in the kernel; None for an abstract base class.
        ticking: The functions for ticking, which `runtime.ticking` sets.
        clock: The clock that measures the node's durations.
        skipped: Whether the last tick was skipped. In this case, the status is older than this tick; see `runtime.skipping`.
    """

    node_class: "ClassVar[type[TreeNode] | None]" = None
    ticking: ClassVar[KernelTicking]
    skipped = False
    clock: Clock = WallClock()
    place: tuple[TickedTree, int] | None = None
    """The kernel tree with the node of this behaviour, and the index of the node in this tree."""
    wake: Wake = staticmethod(ignore_wake)
    """Function that requests an immediate next tick. Nodes call it if they return RUNNING between two children."""

    def setup(self, **kwargs: Any) -> None:
        """Store the runner's `wake` function.

        Args:
            **kwargs: The runner's arguments; the optional `wake` is a function that requests another tick at once.
        """
        self.wake = kwargs.get("wake", ignore_wake)

    def build_node(self, part: "NodeBuilder") -> "TreeNode":
        """Create the behaviour's node in the kernel."""
        assert self.node_class is not None  # noqa: S101 - abstract classes have no nodes
        return self.node_class(part)

    def tick(self) -> Iterator[Behaviour]:
        """Tick once. Then yield each ticked node, with its status at the end of its tick, and this node last."""
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
        """Return the current status, which `tick` has set."""
        return self.status

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Set the status. The status INVALID halts the node and its children."""
        if new_status == Status.INVALID:
            tree, index = self._tree_and_index()
            tree.stop(index)
        self.status = new_status


class Cell(NamedTuple):
    """A memory cell of a control or decorator.

    Attributes:
        number: The index among the node's cells.
        first: The initial value.
        keeps: Whether the cell keeps its value when the node ends or is halted.
    """

    number: int
    first: Hashable
    keeps: bool


class EngineParent(EngineBehaviour):
    """A node with children that follows BehaviorTree.CPP's rules.

    A class without a `node_class` chooses the next child in `begin` and `resume`. Between these calls, and between ticks, an object may
    store state only in cells, so that `verify` can restore any earlier state.

    Attributes:
        is_its_child: Whether the behaviour and its child count as one node of the tree and share one status.
        cells: The behaviour's cells.
    """

    is_its_child = False
    cells: tuple[Cell, ...] = ()

    def cell(self, first: Hashable = 0, *, keeps: bool = False) -> Cell:
        """Add a cell. `tick[cell]` reads and sets the cell's value, which must be hashable and immutable.

        Args:
            first: The initial value. The cell gets this value again when the node ends or is halted.
            keeps: Whether the cell keeps its value when the node ends or is halted.
        """
        added = Cell(len(self.cells), first, keeps)
        self.cells = (*self.cells, added)
        return added

    def insert_leaf(self, leaf: Behaviour) -> None:
        """Insert a leaf before the children. The leaf represents the world around the node."""
        self.children.insert(0, leaf)
        leaf.parent = self

    def begin(self, tick: "Tick") -> Behaviour | Status:
        """Begin a tick.

        Args:
            tick: The access to the node's cells, its timer and its children.

        Returns:
            The first child to tick, or the node's outcome. `SKIPPED` means that the node is skipped. After any outcome except RUNNING, the
            node ends and its children are reset.
        """
        raise NotImplementedError

    def resume(self, tick: "Tick", outcome: Status) -> Behaviour | Status:
        """Continue a tick after a child was ticked.

        Args:
            tick: The access to the node's cells, its timer and its children.
            outcome: The outcome of the child; `SKIPPED` if the child was skipped.

        Returns:
            The next child to tick, or the node's outcome, as for `begin`. A child that has ended is restarted.
        """
        raise NotImplementedError

    def build_node(self, part: "NodeBuilder") -> "TreeNode":
        """Create the behaviour's node in the kernel."""
        if self.node_class is not None:
            return self.node_class(part)
        from sar_compiler.runtime.kernel.user_nodes import UserNode

        return UserNode(part)
