"""The flat form of a compiled tree: it ticks the same leaves without generators, and its state can be copied.

`flatten` makes a `FlatTree`, whose cells are all that it remembers between two ticks, but for the blackboard and for
what leaves keep to themselves.
"""

from sar_compiler.runtime.flat.cells import Cells, Stop, Tick
from sar_compiler.runtime.flat.parts import Build, Part
from sar_compiler.runtime.flat.table import NotFlatError, builder_of
from sar_compiler.runtime.flat.times import ClockTimes, Times
from sar_compiler.runtime.flat.tree import FlatNode, FlatTree, flatten

__all__ = [
    "Build",
    "Cells",
    "ClockTimes",
    "FlatNode",
    "FlatTree",
    "NotFlatError",
    "Part",
    "Stop",
    "Tick",
    "Times",
    "builder_of",
    "flatten",
]
