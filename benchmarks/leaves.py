"""Leaves that do next to nothing, in Python: without a port, with an input port and with an output port."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.runtime.ports import Input, Output


class Leaf(Behaviour):
    """A leaf that answers always the same.

    Args:
        name: The node's name.
        answer: What it answers.
    """

    def __init__(self, name: str, answer: Status = Status.SUCCESS) -> None:
        super().__init__(name)
        self._answer = answer

    def update(self) -> Status:
        """Answer."""
        return self._answer


class Prepared(Leaf):
    """A leaf that does something when it begins and when it ends, as well: whoever has `initialise` and `terminate` is called for them."""

    def initialise(self) -> None:
        """Begin."""

    def terminate(self, new_status: Status) -> None:
        """End."""


class Reader(Behaviour):
    """A leaf that reads its input port.

    Args:
        name: The node's name.
        x: What it reads.
    """

    def __init__(self, name: str, x: Input[str]) -> None:
        super().__init__(name)
        self.x = x

    def update(self) -> Status:
        """Read, and succeed."""
        self.x.get()
        return Status.SUCCESS


class Writer(Behaviour):
    """A leaf that writes its output port.

    Args:
        name: The node's name.
        y: What it writes.
    """

    def __init__(self, name: str, y: Output[str]) -> None:
        super().__init__(name)
        self.y = y

    def update(self) -> Status:
        """Write, and succeed."""
        self.y.set("")
        return Status.SUCCESS


def registry_with_leaves() -> Registry:
    """Return the registry, with these leaves in it."""
    leaves = [NodeSpec(cls.__name__, cls, Kind.ACTION) for cls in (Leaf, Prepared, Reader, Writer)]
    return Registry([*default_registry().specs(), *leaves])
