"""The table of the kernel's node classes, by behaviour class."""

from collections.abc import Callable

from py_trees import behaviours, composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.kernel import leaf_nodes, stock_composites, stock_decorators
from sar_compiler.runtime.kernel.cells import IS_2_3
from sar_compiler.runtime.kernel.tree import FlatTree, flat_tree
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, TreeNode
from sar_compiler.runtime.parents import EngineBehaviour, EngineParent
from sar_compiler.runtime.skipping import SkippableLeaf

NodeClass = Callable[[NodeBuilder], TreeNode]

STOCK: dict[type[Behaviour], NodeClass] = {
    composites.Sequence: stock_composites.StockSequenceNode,
    composites.Selector: stock_composites.StockSelectorNode,
    composites.Parallel: stock_composites.StockParallelNode,
    # The counters of Count have no effect on ticks, so they need no cells.
    **dict.fromkeys(
        (*stock_decorators.TURNING, decorators.Count, decorators.StatusToBlackboard),
        stock_decorators.StockDecoratorNode,
    ),
    decorators.Repeat: stock_decorators.StockRepeatNode,
    decorators.Retry: stock_decorators.StockRetryNode,
    decorators.EternalGuard: stock_decorators.StockGuardNode,
    decorators.OneShot: stock_decorators.StockOneShotNode,
    **dict.fromkeys((behaviours.Success, behaviours.Failure, behaviours.Running), leaf_nodes.ConstantNode),
    behaviours.StatusQueue: leaf_nodes.StatusQueueNode,
    behaviours.Periodic: leaf_nodes.PeriodicNode,
    behaviours.SuccessEveryN: leaf_nodes.SuccessEveryNNode,
    behaviours.TickCounter: leaf_nodes.TickCounterNode,
}
"""The node class for each known class of py_trees."""

if not IS_2_3:
    STOCK[decorators.ForEach] = stock_decorators.StockForEachNode


class NotFlatError(UndecidableError):
    """Raised if the kernel cannot tick the children of a behaviour, because its class is unknown.

    Attributes:
        behaviour: The behaviour.
    """

    def __init__(self, behaviour: Behaviour) -> None:
        self.behaviour = behaviour
        cls = type(behaviour)
        message = (
            f"'{behaviour.name}' is a {cls.__module__}.{cls.__qualname__}, and only the methods of this class define when children are "
            f"ticked and stopped. Replace it by registered controls and decorators, or by a leaf"
        )
        super().__init__(message)


def known_node(part: NodeBuilder) -> TreeNode:
    """Create the node of a behaviour.

    Raises:
        NotFlatError: If the behaviour is not a leaf and its class is unknown, such as a subclass of a py_trees class.
    """
    behaviour = part.behaviour
    cls = node_class_of(behaviour)
    if cls is None:
        raise NotFlatError(behaviour)
    return cls(part)


def node_class_of(behaviour: Behaviour) -> NodeClass | None:
    """Return the function that creates the node of a behaviour, or None if the kernel cannot tick the children."""
    cls = type(behaviour)
    known = STOCK.get(cls)
    if known is not None and "update" not in vars(behaviour):
        return known
    if isinstance(behaviour, EngineBehaviour):
        return behaviour.build_node if is_known_class(cls) else None
    if behaviour.children or isinstance(behaviour, (Composite, Decorator)):
        return None
    if cls.stop is Behaviour.stop:
        if cls.tick is Behaviour.tick:
            return leaf_nodes.LeafNode
        if cls.tick is SkippableLeaf.tick:
            return leaf_nodes.SkippableLeafNode
    return leaf_nodes.ForeignNode


def is_known_class(cls: type[Behaviour]) -> bool:
    """Return whether the kernel knows how a class of controls or decorators ticks and stops children."""
    if not issubclass(cls, EngineBehaviour):
        return cls in STOCK
    # A class derived from a class of this project ticks its children alike, unless it overrides `tick` or `stop`.
    is_inherited = cls.tick is EngineBehaviour.tick and cls.stop is EngineBehaviour.stop
    return is_inherited and (
        cls.node_class is not None or getattr(cls, "begin", None) is not EngineParent.begin
    )


def flatten(root: Behaviour, node_of: NodeClass = known_node) -> FlatTree:
    """Convert a tree of behaviours to a `FlatTree`.

    Args:
        root: The root of the tree, after its setup.
        node_of: Function that creates the node of a behaviour.

    Raises:
        NotFlatError: If the tree has a composite or a decorator of an unknown class.
    """
    return flat_tree(root, node_of)
