"""Specs of nodes whose classes are named by import path.

A spec names the class and describes all constructor parameters for which a tree file or a mission provides values, except
for the name and the children. Trees can then be checked without importing the class::

    node_spec(
        Kind.DECORATOR,
        "Delay",
        "sar_compiler.runtime.kernel.timing:DelayNode",
        "Waits before it ticks its child for the first time.",
        input_port("delay_msec", MILLISECONDS, "The waiting time, in milliseconds."),
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
"""The parameter for the name of a node, which every constructor has."""
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
        kind: The kind of the node, which determines the parameter for the children.
        doc: The node's description, in a sentence or two.
        *parameters: The constructor parameters in order, except for the name and the children.
        fixed: The values of parameters that the tag implies, by name.
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
        kind: The kind of the node.
        tag: The node's tag.
        path: The import path of the class (`module:name`), or of the node in the kernel.
        doc: The node's description, in a sentence or two.
        *parameters: The constructor parameters in order, except for the name and the children.
        fixed: The values of parameters that the tag implies, by name.
        factory: The import path of a function that creates the node instead of the class.
        **more: Further fields of the spec; `statuses` defaults to all statuses except SKIPPED.
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
    """Return the spec of a leaf whose tag equals the name of its class.

    Args:
        path: The import path of the class (`module:name`).
        doc: The leaf's description, in a sentence or two.
        *parameters: The constructor parameters in order, except for the name.
        outcomes: The leaf's outcomes in a run without a robot.
        kind: The kind: `ACTION` or `CONDITION`.
        effects: The leaf's effect on the world, in a few words.
        uses: The resources outside the tree that the leaf needs.
        facts: The facts that the outcomes use, with their initial values.
        reads: Further facts on which the leaf's behaviour depends.
        writes: Further facts that the leaf changes.
        semantics: The leaf's use of the keys in its attributes, if the ports do not declare it.
        rule: A function that reports conflicting attributes.
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
    """Return a parameter whose value is already fixed when the tree is compiled.

    Args:
        keyword: The name in the constructor. The attribute's name lacks a trailing `_`.
        kind: The type of the values, as an annotation or a `ValueType`.
        doc: The description.
        default: The default value; without a default, the attribute is required.
    """
    return _parameter(
        keyword, kind if isinstance(kind, ValueType) else require_value_type(kind), None, doc, default
    )


def input_port(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return an input port; see `attribute` for the arguments. The type `object` allows any value."""
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
        keyword: The parameter's name.
        target: The object's class, which `mission_context` marks, or the import path of the class.
        doc: The description.
        required: Whether the node requires the object; otherwise the default is None.
    """
    return Parameter(keyword, ParameterRole.CONTEXT, required, target_or_path=target, doc=doc)


def reference(keyword: str, path: str, doc: str) -> Parameter:
    """Return a parameter for another leaf of the tree. The tree file contains the name of this leaf.

    Args:
        keyword: The parameter's name.
        path: The import path of the other leaf's class.
        doc: The description.
    """
    return Parameter(keyword, ParameterRole.REFERENCE, required=True, target_or_path=path, doc=doc)


SCOPE = handed_over(
    "scope", "sar_compiler.runtime.blackboard:Scope", "The scope in which the node's keys are looked up."
)
ENUMS = handed_over("enums", "sar_compiler.runtime.variables:Enums", "The named constants and their numbers.")
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
