"""Functions that create nodes of this package from their specs."""

from collections.abc import Callable, Iterable
from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.nodes import nav2
from sar_compiler.nodes.language import SPECS
from sar_compiler.nodes.spec import NodeSpec, ParameterRole
from sar_compiler.runtime.parents import EngineParent

_STRUCTURE = (ParameterRole.NAME, ParameterRole.CHILD, ParameterRole.CHILDREN)


def own(tag: str, specs: Iterable[NodeSpec] = SPECS) -> Callable[..., Any]:
    """Return a function that creates a node from its name, its children, and its parameters in the order of its spec.

    If py_trees' class is used unless a child can be skipped, the function creates the class that replaces it.
    """
    spec = next(each for each in specs if each.tag == tag and not each.variant)
    spec = spec.skipping.replacement or spec
    maker = spec.maker
    assert maker is not None
    keywords = [each.keyword or each.name for each in spec.parameters.values() if each.role not in _STRUCTURE]
    below = 0 if spec.kind.is_leaf else 1

    def make(name: str, *values: object, **named: object) -> Behaviour:
        written = dict(zip(keywords, values[below:], strict=False))
        made: Behaviour = maker(name, *values[:below], **written, **named)
        return made

    return make


def of_nav2(tag: str, version: str = "jazzy") -> Callable[..., Any]:
    """Return such a function for a node of Nav2 that can run without Nav2."""
    return own(tag, nav2.specs(version))


def asking(tag: str) -> Callable[..., Any]:
    """Return a function that creates the stand-in for a node of Nav2 from its name, its children, and the leaf that it queries."""
    spec = next(each for each in nav2.specs("main") if each.tag == tag)
    assert spec.stand_in is not None
    maker = spec.stand_in.maker
    assert maker is not None

    def make(name: str, below: object, leaf: Behaviour) -> EngineParent:
        made: EngineParent = maker(name, below)
        made.insert_leaf(leaf)
        return made

    return make
