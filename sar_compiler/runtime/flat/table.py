"""Which class is brought into flat form by which builder."""

from py_trees.behaviour import Behaviour
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from sar_compiler.errors import SarError

# Each of them declares its builders when it is imported, as the modules of our own classes do.
from sar_compiler.runtime.flat import leaves, stock_composites, stock_decorators  # noqa: F401
from sar_compiler.runtime.flat.parts import BUILDERS, Build
from sar_compiler.runtime.parents import Built, Parent


class NotFlatError(SarError):
    """A tree has a node whose rules the flat form does not know.

    Attributes:
        behaviour: The node.
    """

    def __init__(self, behaviour: Behaviour) -> None:
        self.behaviour = behaviour
        cls = type(behaviour)
        message = (
            f"'{behaviour.name}' is a {cls.__module__}.{cls.__qualname__}, and only its own methods know when it "
            "ticks and stops its children; put nodes of the library in its place, or make it a leaf"
        )
        super().__init__(message)


def builder_of(behaviour: Behaviour) -> Build:
    """Return what brings a behaviour into flat form.

    Raises:
        NotFlatError: If it is no leaf and its class is not known; a subclass of a known one is not known.
    """
    build = BUILDERS.get(type(behaviour))
    if build is not None:
        return build
    if behaviour.children or isinstance(behaviour, (Composite, Decorator)):
        raise NotFlatError(behaviour)
    return leaves.leaf


def inherited_builder_of(node: Built) -> Build:
    """Return what brings one of our nodes into flat form; a subclass has its base's builder unless it has its own.

    Raises:
        NotFlatError: If neither the class nor a base is known.
    """
    known = (BUILDERS[cls] for cls in type(node).__mro__ if cls in BUILDERS)
    build = next(known, None)
    if build is None:
        raise NotFlatError(node)
    return build


def shares_status(behaviour: Behaviour) -> bool:
    """Return whether a behaviour and its child have one status between them."""
    return isinstance(behaviour, Parent) and behaviour.is_its_child
