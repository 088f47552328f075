"""Controls: nodes with several children."""

from py_trees.composites import Selector, Sequence

from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.spec import Kind

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})

_SEQUENCE = "Ticks its children in order until one does not succeed; succeeds when all have."
_SELECTOR = "Ticks its children in order until one does not fail; fails when all have."
_REACTIVE = "Looks at every child again in every tick."

REGISTRATIONS = [
    Registration("Sequence", Sequence, Kind.CONTROL, _ALL, doc=_SEQUENCE, defaults={"memory": True}),
    Registration("Selector", Selector, Kind.CONTROL, _ALL, doc=_SELECTOR, defaults={"memory": True}),
    Registration("Fallback", Selector, Kind.CONTROL, _ALL, doc=_SELECTOR, defaults={"memory": True}),
    Registration(
        "ReactiveSequence",
        Sequence,
        Kind.CONTROL,
        _ALL,
        doc=f"{_SEQUENCE} {_REACTIVE}",
        fixed={"memory": False},
    ),
    Registration(
        "ReactiveFallback",
        Selector,
        Kind.CONTROL,
        _ALL,
        doc=f"{_SELECTOR} {_REACTIVE}",
        fixed={"memory": False},
    ),
]
