"""Controls: nodes with several children."""

from py_trees.composites import Composite, Selector, Sequence

from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.spec import Kind

_ALL = frozenset({"SUCCESS", "FAILURE", "RUNNING"})

_SEQUENCE = "Ticks its children in order until one does not succeed; succeeds when all have."
_SELECTOR = "Ticks its children in order until one does not fail; fails when all have."
_REACTIVE = "Looks at every child again in every tick."

_PARAMETER_DOCS = {
    "name": "The node's name.",
    "memory": "Whether to go on with the child that was running (true), or to look at every child again (false).",
}


def _control(tag: str, cls: type[Composite], doc: str) -> Registration:
    defaults = {"memory": True}
    return Registration(
        tag, cls, Kind.CONTROL, _ALL, doc=doc, defaults=defaults, parameter_docs=_PARAMETER_DOCS
    )


def _reactive(tag: str, cls: type[Composite], doc: str) -> Registration:
    fixed, text = {"memory": False}, f"{doc} {_REACTIVE}"
    return Registration(tag, cls, Kind.CONTROL, _ALL, doc=text, fixed=fixed, parameter_docs=_PARAMETER_DOCS)


REGISTRATIONS = [
    _control("Sequence", Sequence, _SEQUENCE),
    _control("Selector", Selector, _SELECTOR),
    _control("Fallback", Selector, _SELECTOR),
    _reactive("ReactiveSequence", Sequence, _SEQUENCE),
    _reactive("ReactiveFallback", Selector, _SELECTOR),
]
