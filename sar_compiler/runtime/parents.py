"""The common base of nodes with children that follow BehaviorTree.CPP's rules.

Stock py_trees classes know no SKIPPED, and keep the statuses of children that have ended until these are started
again. The classes on top of these ask what the outcome of a child's tick was, and reset children when BehaviorTree.CPP
does: one that is running is halted, one that has ended only forgets how it did.

What a node does in a tick, and when it is halted, is said by its class in the kernel (`node_class`), whether it is ticked by
itself or in a tree.
"""

from collections.abc import Callable, Hashable, Iterator
from functools import wraps
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.clock import Clock, WallClock
from sar_compiler.runtime.leaf_protocol import Wake, stay_asleep

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, TreeNode, Visit
    from sar_compiler.runtime.kernel.user_nodes import Tick


class Children(list[Behaviour]):
    """The children of a behaviour, in a list that counts the changes of all lists of its kind.

    Attributes:
        changes: How often any such list was changed, so far.
    """

    changes: ClassVar[int] = 0

    @classmethod
    def of(cls, children: list[Behaviour]) -> "Children":
        """Return children as such a list, which may be the one that they are in."""
        return children if isinstance(children, cls) else cls(children)

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        """Be copied as a list."""
        return list, (list(self),)


def _counting(name: str) -> Callable[..., Any]:
    change = getattr(list, name)

    @wraps(change)
    def counted(self: Children, *args: Any, **kwargs: Any) -> Any:
        Children.changes += 1
        return change(self, *args, **kwargs)

    return counted


_PLAIN = ("append", "clear", "extend", "insert", "pop", "remove", "reverse", "sort")
for _name in (*_PLAIN, "__delitem__", "__iadd__", "__imul__", "__setitem__"):
    setattr(Children, _name, _counting(_name))


class TickedTree(Protocol):
    """A tree of the kernel, as a behaviour that has a node in it sees it; see `LiveTree`."""

    def is_whole(self) -> bool:
        """Return whether all nodes still have the children that they had."""

    def tick(self, visits: "list[Visit] | None" = None, index: int = 0) -> int:
        """Tick a node once, and note the nodes below it that were ticked."""

    def stop(self, index: int = 0) -> None:
        """Stop a node."""


class KernelTicking(NamedTuple):
    """How a behaviour is ticked that py_trees ticks.

    Attributes:
        make_tree: Makes the tree of a root and all that is below it, of the kernel's nodes; takes over from a former tree.
        show_visits: Yields the behaviours that were ticked, each as it was then.
    """

    make_tree: Callable[..., TickedTree]
    show_visits: "Callable[[list[Visit]], Iterator[Behaviour]]"


class EngineBehaviour(Behaviour):
    """A behaviour that ticks and stops as its node in the kernel says.

    Ticked by its own methods, as py_trees does, it is the root of a tree of such nodes, with all that is below it.

    Args:
        name: The node's name.
        clock: What the time is measured with.
        enums: The names that stand for numbers.

    Attributes:
        node_class: The class of the node; None for a class that is only a base.
        ticking: How it is ticked, as `runtime.ticking` says, where all classes are that are no base.
        clock: What the node measures time with.
        skipped: Whether the last tick was skipped; the status is then not the tick's, see `runtime.skipping`.
    """

    node_class: "ClassVar[type[TreeNode] | None]" = None
    ticking: ClassVar[KernelTicking]
    skipped = False
    clock: Clock = WallClock()
    place: tuple[TickedTree, int] | None = None
    """The tree that has its node, and the node's index there."""
    wake: Wake = staticmethod(stay_asleep)
    """Asks for the next tick at once, for a node that pauses by RUNNING, so that the rest of the tree gets its turn."""

    def setup(self, **kwargs: Any) -> None:
        """Take what the runner offers.

        Args:
            **kwargs: Perhaps `wake`, to be called when the tree is to be ticked again at once.
        """
        self.wake = kwargs.get("wake", stay_asleep)

    def build_node(self, part: "NodeBuilder") -> "TreeNode":
        """Build the node, of what the kernel offers."""
        assert self.node_class is not None  # noqa: S101 - others are not asked
        return self.node_class(part)

    def tick(self) -> Iterator[Behaviour]:
        """Tick once; then yield every node that was ticked on the way as it was after its tick, and this one last."""
        visits: list[Visit] = []
        try:
            tree, index = self._place()
            tree.tick(visits, index)
        finally:
            yield from self.ticking.show_visits(visits)
        yield self

    def _place(self) -> tuple[TickedTree, int]:
        if self.place is None or not self.place[0].is_whole():
            self.ticking.make_tree(self, former=self.place[0] if self.place else None)
        assert self.place is not None  # noqa: S101 - the tree has said so
        return self.place

    def update(self) -> Status:
        """Return the status; `tick` does the work."""
        return self.status

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """End; with INVALID the node is halted, and its children with it."""
        if new_status == Status.INVALID:
            tree, index = self._place()
            tree.stop(index)
        self.status = new_status


class Cell(NamedTuple):
    """A place for what a control or decorator remembers.

    Attributes:
        number: Its index among those of the node.
        first: What it holds at first.
        keeps: Whether it goes on holding what it does when the node ends or is halted.
    """

    number: int
    first: Hashable
    keeps: bool


class EngineParent(EngineBehaviour):
    """A node with children that keeps BehaviorTree.CPP's rules.

    One without a `node_class` says itself, in `begin` and `resume`, which child it needs next. Between two of these calls, and between two
    ticks, it remembers only what is in cells: so `verify` can put it back to any state that it was in.

    Attributes:
        is_its_child: Whether it and its child are one node, with one status.
        cells: The cells that it has asked for.
    """

    is_its_child = False
    cells: tuple[Cell, ...] = ()

    def cell(self, first: Hashable = 0, *, keeps: bool = False) -> Cell:
        """Add a cell, in the constructor; `tick[cell]` is what it holds: anything that can be hashed, and never changes in place.

        Args:
            first: What it holds at first, and again after the node has ended or was halted.
            keeps: Whether it goes on holding what it does then.
        """
        added = Cell(len(self.cells), first, keeps)
        self.cells = (*self.cells, added)
        return added

    def ask(self, leaf: Behaviour) -> None:
        """Take a leaf that answers for the world around the node, before the children."""
        self.children.insert(0, leaf)
        leaf.parent = self

    def begin(self, tick: "Tick") -> Behaviour | Status:
        """Begin a tick.

        Args:
            tick: What there is to be seen and done in it.

        Returns:
            The child that is to be ticked first; or the outcome, if no child is needed. With `SKIPPED` the node is
            passed over, and with any outcome but RUNNING its work is over: its children are brought to rest.
        """
        raise NotImplementedError

    def resume(self, tick: "Tick", outcome: Status) -> Behaviour | Status:
        """Go on with a tick, after a child.

        Args:
            tick: What there is to be seen and done in it.
            outcome: What the child has come to; `SKIPPED` if it was skipped.

        Returns:
            As `begin`. A child that has ended starts anew if it is ticked once more.
        """
        raise NotImplementedError

    def build_node(self, part: "NodeBuilder") -> "TreeNode":
        """Build the node, of what the kernel offers."""
        if self.node_class is not None:
            return self.node_class(part)
        from sar_compiler.runtime.kernel.user_nodes import UserNode

        return UserNode(part)
