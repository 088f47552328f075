"""Leaves without a port, with an input port and with an output port, for the benchmarks."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.runtime.ports import Input, Output


class Leaf(Behaviour):
    """A leaf without ports, which may come to anything."""

    def update(self) -> Status:
        """Succeed."""
        return Status.SUCCESS


class Reader(Leaf):
    """A leaf with an input port.

    Args:
        name: The node's name.
        x: What it reads.
    """

    def __init__(self, name: str, x: Input[str]) -> None:
        super().__init__(name)
        self.x = x


class Writer(Leaf):
    """A leaf with an output port.

    Args:
        name: The node's name.
        y: What it writes.
    """

    def __init__(self, name: str, y: Output[str]) -> None:
        super().__init__(name)
        self.y = y
