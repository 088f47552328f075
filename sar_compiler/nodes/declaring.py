"""Declarations of nodes whose class is named by its import path.

A spec names the class and describes all constructor parameters that a tree file or a mission provides, except for
the name and the children. A tree is then checked without importing the class::

    node_spec(
        Kind.DECORATOR,
        "Delay",
        "sar_compiler.runtime.kernel.timing:DelayNode",
        "Waits before it ticks its child for the first time.",
        input_port("delay_msec", MILLISECONDS, "How long to wait, in milliseconds."),
        CLOCK,
    )

`tests/nodes/test_declared_nodes.py` compares each spec with the constructor, or with the ports of the node in the kernel.
"""

from collections.abc import Mapping
from typing import Any

from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, ParameterRole, Rule, Signature, Use
from sar_compiler.nodes.values import ANYTHING, ValueType, port_type_of, require_value_type
from sar_compiler.runtime.outcomes import Fact, Outcome

NAME = Parameter(
    "name", ParameterRole.NAME, required=False, value_type=require_value_type(str), doc="The node's name."
)
"""The parameter for the name, which every node has."""
CHILDREN = Parameter("children", ParameterRole.CHILDREN, required=True)
CHILD = Parameter("child", ParameterRole.CHILD, required=True)
"""The parameters for the children of controls and the child of decorators."""
_STATUSES = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
_STRUCTURE = {Kind.CONTROL: [CHILDREN], Kind.DECORATOR: [CHILD]}


def signature(
    kind: Kind, doc: str, *parameters: Parameter, fixed: Mapping[str, object] | None = None, factory: str = ""
) -> Signature:
    """Return the signature of a node.

    Args:
        kind: The kind of node, which determines the parameter for its children.
        doc: The node's description, in a sentence or two.
        *parameters: The parameters except for the name and the children, in their order.
        fixed: Parameters whose value the tag implies.
        factory: The import path of a function that creates the node instead of the class.
    """
    described = {each.name: each for each in (NAME, *_STRUCTURE.get(kind, ()), *parameters)}
    return Signature(described, doc, fixed or {}, factory)


def node_spec(
    kind: Kind,
    tag: str,
    path: str,
    doc: str,
    *parameters: Parameter,
    fixed: Mapping[str, object] | None = None,
    factory: str = "",
    **more: Any,
) -> NodeSpec:
    """Return the spec of a node.

    Args:
        kind: The kind of node.
        tag: Its tag.
        path: The import path of its class (`module:name`), or of its node in the kernel.
        doc: Its description, in a sentence or two.
        *parameters: The parameters except for the name and the children, in their order.
        fixed: The parameters whose value the tag implies.
        factory: The import path of a function that creates the node instead of the class.
        **more: Further fields of the spec; by default it has all outcomes but SKIPPED.
    """
    signed = signature(kind, doc, *parameters, fixed=fixed, factory=factory)
    return NodeSpec(tag, path, kind, signature=signed, **{"statuses": _STATUSES, **more})


def leaf_spec(  # noqa: PLR0913 - the declarations of a leaf
    path: str,
    doc: str,
    *parameters: Parameter,
    outcomes: tuple[Outcome, ...],
    kind: Kind = Kind.ACTION,
    effects: str = "",
    uses: tuple[Use, ...] = (),
    facts: Mapping[str, Fact] | None = None,
    reads: tuple[str, ...] = (),
    writes: tuple[str, ...] = (),
    semantics: Semantics = Semantics(),  # noqa: B008 - frozen
    rule: "Rule | None" = None,
) -> NodeSpec:
    """Return the spec of a leaf whose tag is the name of its class.

    Args:
        path: The import path of the class (`module:name`).
        doc: The leaf's description, in a sentence or two.
        *parameters: The parameters of the constructor except for the name, in their order.
        outcomes: Its outcomes in a run without a robot.
        kind: An action or a condition.
        effects: Its effect on the world, in a few words.
        uses: The resources that it needs outside the tree.
        facts: The facts that its outcomes use, with their initial values.
        reads: Further facts that its behaviour depends on.
        writes: Further facts that it changes.
        semantics: How it uses the keys in its attributes, if their ports do not declare it.
        rule: Function that reports conflicting attributes.
    """
    return NodeSpec(
        path.rpartition(":")[2],
        path,
        kind,
        frozenset(outcome.status for outcome in outcomes),
        effects,
        uses,
        outcomes,
        facts or {},
        reads,
        writes,
        semantics,
        signature=signature(kind, doc, *parameters),
        rule=rule,
    )


def attribute(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return a parameter whose value is fixed when the tree is compiled.

    Args:
        keyword: The name in the constructor; the attribute has no trailing `_`.
        kind: The type of its values, as an annotation or a `ValueType`.
        doc: Its description.
        default: The default value; without it the attribute is required.
    """
    return _parameter(
        keyword, kind if isinstance(kind, ValueType) else require_value_type(kind), None, doc, default
    )


def input_port(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return an input port; see `attribute`. The type `object` allows any value."""
    return _port(Direction.INPUT, keyword, kind, doc, default)


def output_port(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return an output port; see `input_port`."""
    return _port(Direction.OUTPUT, keyword, kind, doc, default)


def inout_port(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return a port that is read and written; see `input_port`."""
    return _port(Direction.INOUT, keyword, kind, doc, default)


def handed_over(keyword: str, target: type | str, doc: str, *, required: bool = True) -> Parameter:
    """Return a parameter for an object that the mission provides.

    Args:
        keyword: Its name.
        target: The object's class, marked by `mission_context`, or its import path.
        doc: Its description.
        required: Whether the node requires it; otherwise the default is None.
    """
    return Parameter(keyword, ParameterRole.CONTEXT, required, target_or_path=target, doc=doc)


def reference(keyword: str, path: str, doc: str) -> Parameter:
    """Return a parameter for another leaf of the tree, which the file names.

    Args:
        keyword: Its name.
        path: The import path of the leaf's class.
        doc: Its description.
    """
    return Parameter(keyword, ParameterRole.REFERENCE, required=True, target_or_path=path, doc=doc)


SCOPE = handed_over(
    "scope", "sar_compiler.runtime.blackboard:Scope", "The scope in which keys are looked up."
)
ENUMS = handed_over("enums", "sar_compiler.runtime.variables:Enums", "The names that stand for numbers.")
CLOCK = handed_over("clock", "sar_compiler.runtime.clock:Clock", "The clock that measures the time.")


def _port(direction: Direction, keyword: str, kind: object, doc: str, default: object) -> Parameter:
    value_type = kind if isinstance(kind, ValueType) else ANYTHING if kind is object else port_type_of(kind)
    assert value_type is not None, kind  # noqa: S101 - an error in a spec
    return _parameter(keyword, value_type, direction, doc, default)


def _parameter(
    keyword: str, value_type: ValueType, direction: Direction | None, doc: str, default: object
) -> Parameter:
    required, name = default is ..., keyword.removesuffix("_")
    return Parameter(
        name,
        ParameterRole.ATTRIBUTE,
        required,
        default=None if required else default,
        value_type=value_type,
        direction=direction,
        doc=doc,
        keyword="" if keyword == name else keyword,
    )
