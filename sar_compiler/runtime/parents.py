"""The common base of nodes with children that follow BehaviorTree.CPP's rules.

Stock py_trees classes know no SKIPPED, and keep the statuses of children that have ended until these are started
again. The classes on top of these ask what the outcome of a child's tick was, and reset children when BehaviorTree.CPP
does: one that is running is halted, one that has ended only forgets how it did.

What a node does in a tick, and when it is halted, is said by its class in the kernel (`node_class`), whether it is ticked by
itself or in a tree. py_trees sees a behaviour that is made for it (`behaviour_class`): a name, children, and what the tag says.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator as StockDecorator

from sar_compiler.runtime.clock import Clock, WallClock
from sar_compiler.runtime.leaf_protocol import Wake, stay_asleep

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.live import LiveTree
    from sar_compiler.runtime.kernel.tree_nodes import Part, TreeNode, Visit
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


class Built(Behaviour):
    """A behaviour that ticks and stops as its node in the kernel says.

    Ticked by its own methods, as py_trees does, it is the root of a tree of such nodes, with all that is below it.

    Args:
        name: The node's name.
        clock: What the time is measured with.
        enums: The names that stand for numbers.

    Attributes:
        node_class: The class of the node; None for a class that is only a base.
        clock: What the node measures time with.
        skipped: Whether the last tick was skipped; the status is then not the tick's, see `runtime.skipping`.
    """

    node_class: "ClassVar[type[TreeNode] | None]" = None
    skipped = False
    clock: Clock = WallClock()
    place: "tuple[LiveTree, int] | None" = None
    """The tree that has its node, and the node's index there."""
    wake: Wake = staticmethod(stay_asleep)
    """Asks for the next tick at once, for a node that pauses by RUNNING, so that the rest of the tree gets its turn."""

    def setup(self, **kwargs: Any) -> None:
        """Take what the runner offers.

        Args:
            **kwargs: Perhaps `wake`, to be called when the tree is to be ticked again at once.
        """
        self.wake = kwargs.get("wake", stay_asleep)

    def build_node(self, part: "Part") -> "TreeNode":
        """Build the node, of what the kernel offers."""
        assert self.node_class is not None  # noqa: S101 - others are not asked
        return self.node_class(part)

    def tick(self) -> Iterator[Behaviour]:
        """Tick once; then yield every node that was ticked on the way as it was after its tick, and this one last."""
        from sar_compiler.runtime.kernel.live import show_visits

        visits: list[Visit] = []
        try:
            tree, index = self._place()
            tree.tick(visits, index)
        finally:
            yield from show_visits(visits)
        yield self

    def _place(self) -> "tuple[LiveTree, int]":
        if self.place is None or not self.place[0].is_whole():
            # Only now: what is only checked is never ticked.
            from sar_compiler.runtime.kernel.live import LiveTree

            LiveTree(self, former=self.place[0] if self.place else None)
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


class Parent(Built):
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

    def build_node(self, part: "Part") -> "TreeNode":
        """Build the node, of what the kernel offers."""
        if self.node_class is not None:
            return self.node_class(part)
        from sar_compiler.runtime.kernel.user_nodes import UserNode

        return UserNode(part)


class Control(Parent, Composite):
    """A node with several children.

    Args:
        children: The children, in order.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        # By its name: some controls are subclasses of stock ones, whose constructors want more.
        Composite.__init__(self, name, list(children))

    def tip(self) -> Behaviour | None:
        """Return the deepest node that the last tick reached; this one if its children are at rest."""
        below: Behaviour | None = super().tip()
        return below or (self if self.status != Status.INVALID else None)


class Decorator(Parent, StockDecorator):
    """A node with one child (`decorated`), which its constructor takes."""

    def begin(self, tick: "Tick") -> Behaviour | Status:  # noqa: ARG002 - for those derived from it
        """Begin a tick with the child."""
        child: Behaviour = self.decorated
        return child

    def resume(self, tick: "Tick", outcome: Status) -> Behaviour | Status:  # noqa: ARG002
        """Pass on what the child has come to."""
        return outcome


class OwnLeaf(Built):
    """A leaf of ours.

    Args:
        name: The node's name.
        **attributes: What its tag says, which its node in the kernel reads.
    """

    def __init__(self, name: str, **attributes: object) -> None:
        super().__init__(name)
        vars(self).update(attributes)


class OwnControl(Control):
    """A control of ours, as `OwnLeaf`.

    Args:
        children: The children, in order.
    """

    def __init__(self, name: str, children: Sequence[Behaviour], **attributes: object) -> None:
        super().__init__(name, children)
        vars(self).update(attributes)


class OwnDecorator(Decorator):
    """A decorator of ours, as `OwnLeaf`.

    Args:
        child: The child.
    """

    def __init__(self, name: str, child: Behaviour, **attributes: object) -> None:
        super().__init__(name, child)
        vars(self).update(attributes)


B = TypeVar("B", bound=Built)


_CLASSES: dict[type, type[Any]] = {}


def behaviour_class(base: type[B], node_class: "type[TreeNode]") -> type[B]:
    """Return the class of the behaviours of a node.

    Args:
        base: What it derives from.
        node_class: The class of the node in the kernel, after which it is called.
    """
    if node_class not in _CLASSES:
        said = {"node_class": node_class, "__module__": node_class.__module__, "__doc__": node_class.__doc__}
        _CLASSES[node_class] = type(node_class.__name__, (base,), said)
    return _CLASSES[node_class]
