"""Base classes for controls, decorators and leaves. The kernel ticks them, even if py_trees calls `tick`.

For each node of the kernel, py_trees uses a behaviour with a name, children and attributes (`behaviour_class`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator as StockDecorator

from sar_compiler.runtime.kernel.live import LiveTree, show_visits
from sar_compiler.runtime.parents import EngineBehaviour, EngineParent, KernelTicking

if TYPE_CHECKING:
    from sar_compiler.runtime.kernel.tree_nodes import TreeNode
    from sar_compiler.runtime.kernel.user_nodes import Tick

# The kernel imports the base classes, so they cannot import the kernel's functions themselves.
EngineBehaviour.ticking = KernelTicking(LiveTree, show_visits)


class Control(EngineParent, Composite):
    """A node with several children.

    Args:
        children: The children, in order.
    """

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        # Not through `super()`: some controls also derive from stock classes, whose constructors need more arguments.
        Composite.__init__(self, name, list(children))

    def tip(self) -> Behaviour | None:
        """Return the deepest node that the last tick reached, or this node if all children are idle."""
        below: Behaviour | None = super().tip()
        return below or (self if self.status != Status.INVALID else None)


class Decorator(EngineParent, StockDecorator):
    """A node with one child. The constructor's argument `child` becomes the attribute `decorated`."""

    def begin(self, tick: "Tick") -> Behaviour | Status:  # noqa: ARG002 - for subclasses
        """Begin a tick by returning the child, which the kernel then ticks."""
        child: Behaviour = self.decorated
        return child

    def resume(self, tick: "Tick", outcome: Status) -> Behaviour | Status:  # noqa: ARG002
        """Return the outcome of the child as the node's outcome."""
        return outcome


class OwnLeaf(EngineBehaviour):
    """A leaf of this project.

    Args:
        name: The node's name.
        **attributes: The attributes of the leaf's tag, which its node in the kernel reads.
    """

    def __init__(self, name: str, **attributes: object) -> None:
        super().__init__(name)
        vars(self).update(attributes)


class OwnControl(Control):
    """A control of this project; see `OwnLeaf`.

    Args:
        children: The children, in order.
    """

    def __init__(self, name: str, children: Sequence[Behaviour], **attributes: object) -> None:
        super().__init__(name, children)
        vars(self).update(attributes)


class OwnDecorator(Decorator):
    """A decorator of this project; see `OwnLeaf`.

    Args:
        child: The child.
    """

    def __init__(self, name: str, child: Behaviour, **attributes: object) -> None:
        super().__init__(name, child)
        vars(self).update(attributes)


B = TypeVar("B", bound=EngineBehaviour)


_CLASSES: dict[type, type[Any]] = {}


def behaviour_class(base: type[B], node_class: "type[TreeNode]") -> type[B]:
    """Return the behaviour class for a node class of the kernel. The first call creates this class.

    Args:
        base: The base class.
        node_class: The node class, which defines the name and the docstring as well.
    """
    if node_class not in _CLASSES:
        body = {"node_class": node_class, "__module__": node_class.__module__, "__doc__": node_class.__doc__}
        _CLASSES[node_class] = type(node_class.__name__, (base,), body)
    return _CLASSES[node_class]
