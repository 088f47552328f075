"""The states and ticks that a verification has explored, for other tools."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from sar_compiler.runtime.kernel.graph import Graph


@dataclass(frozen=True)
class StateSpace:
    """The states of a tree and the ticks between them, with what is known of each state.

    Attributes:
        graph: The states, as numbers in the order in which they were found, and the ticks.
        values: Returns the facts and the keys of the tree in a state.
        rules: What the properties are called, by their numbers in the graph.
        owing: The numbers of those that can owe something.
    """

    graph: Graph
    values: Callable[[int], Mapping[str, object]]
    rules: tuple[str, ...]
    owing: tuple[int, ...]
