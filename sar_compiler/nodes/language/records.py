"""Constructors for the specs of the language: of BehaviorTree.CPP's nodes, and of py_trees' own."""

from typing import Any

from sar_compiler.nodes.btcpp import BUILT_IN
from sar_compiler.nodes.declaring import node_spec
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, SkipPossibility, SkipSupport

FROM_CHILD = SkipSupport(SkipPossibility.FROM_CHILD)
_PLAIN = Semantics()


def own(
    kind: Kind,
    tag: str,
    path: str,
    doc: str,
    *parameters: Parameter,
    semantics: Semantics = _PLAIN,
    **more: Any,
) -> NodeSpec:
    """Return the spec of a node of the language; BehaviorTree.CPP has it as well if its tag is in `BUILT_IN`.

    *path* is that of its class in `runtime` or in py_trees.
    """
    if not path.startswith("py_trees."):
        path = f"sar_compiler.runtime.{path}"
    means = semantics._replace(counterpart=semantics.counterpart._replace(built_in=tag in BUILT_IN))
    return node_spec(kind, tag, path, doc, *parameters, semantics=means, **more)


def stock(
    kind: Kind, tag: str, doc: str, *parameters: Parameter, made_by: str = "", instead: str = "", **more: Any
) -> NodeSpec:
    """Return the spec of a node of py_trees.

    Args:
        kind: The kind of node.
        tag: Its tag, and the name of its class.
        doc: Its description.
        *parameters: Its parameters.
        made_by: The function of `py_trees_nodes` that creates it, if not the default one.
        instead: An equivalent node that supports skipped children.
        **more: Further fields of the spec.
    """
    module = {Kind.CONTROL: "composites", Kind.DECORATOR: "decorators"}.get(kind, "behaviours")
    factory = f"sar_compiler.nodes.language.py_trees_nodes:{made_by or 'stock'}" if parameters else ""
    skipping, path = SkipSupport(advice=instead), f"py_trees.{module}:{tag}"
    return node_spec(kind, tag, path, doc, *parameters, factory=factory, skipping=skipping, **more)
