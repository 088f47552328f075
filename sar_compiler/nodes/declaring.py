"""The parameters of a node whose class is named by its import path: what annotations and docstring say of another's.

A spec names its class and describes all parameters of the constructor that a tree file or a mission provides, but for the
name and the children, so that nothing is imported for a tree to be checked::

    node_spec(
        Kind.DECORATOR,
        "Delay",
        "sar_compiler.runtime.kernel.timing:DelayNode",
        "Waits before it ticks its child for the first time.",
        input_port("delay_msec", MILLISECONDS, "How long to wait, in milliseconds."),
        CLOCK,
    )

`tests/nodes/test_declared_nodes.py` compares each with the constructor, or with what the node in the kernel reads.
"""

from collections.abc import Mapping
from typing import Any

from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, ParameterRole, Rule, Signature, Use
from sar_compiler.nodes.values import ANYTHING, ValueType, port_type_of, type_of
from sar_compiler.runtime.answers import Answer, Fact

NAME = Parameter("name", ParameterRole.NAME, required=False, value_type=type_of(str), doc="The node's name.")
"""The parameter for the node's name, which every node has."""
CHILDREN = Parameter("children", ParameterRole.CHILDREN, required=True)
CHILD = Parameter("child", ParameterRole.CHILD, required=True)
"""The parameters for what is below a control and a decorator."""
_OUTCOMES = frozenset({"SUCCESS", "FAILURE", "RUNNING"})
_STRUCTURE = {Kind.CONTROL: [CHILDREN], Kind.DECORATOR: [CHILD]}


def signature(
    kind: Kind, doc: str, *parameters: Parameter, fixed: Mapping[str, object] | None = None, factory: str = ""
) -> Signature:
    """Return the signature of a node.

    Args:
        kind: The kind of node, which decides on the parameter for what is below it.
        doc: The node's description, in a sentence or two.
        *parameters: The parameters but for the name and the children, in their order.
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
        *parameters: The parameters but for the name and the children, in their order.
        fixed: What the tag implies.
        factory: The import path of a function that creates the node instead of the class.
        **more: Further fields of the spec; without outcomes it has all but SKIPPED.
    """
    signed = signature(kind, doc, *parameters, fixed=fixed, factory=factory)
    return NodeSpec(tag, path, kind, signature=signed, **{"outcomes": _OUTCOMES, **more})


def leaf_spec(  # noqa: PLR0913 - all that there is to say of a leaf
    path: str,
    doc: str,
    *parameters: Parameter,
    answers: tuple[Answer, ...],
    kind: Kind = Kind.ACTION,
    effects: str = "",
    uses: tuple[Use, ...] = (),
    facts: Mapping[str, Fact] | None = None,
    reads: tuple[str, ...] = (),
    writes: tuple[str, ...] = (),
    semantics: Semantics = Semantics(),  # noqa: B008 - frozen
    rule: "Rule | None" = None,
) -> NodeSpec:
    """Return the spec of a leaf whose tag is the name of its class; its outcomes are those of its answers.

    Args:
        path: The import path of the class (`module:name`).
        doc: The leaf's description, in a sentence or two.
        *parameters: The parameters of the constructor but for the name, in their order.
        answers: What it can answer in a run without a robot.
        kind: An action or a condition.
        effects: Its effect on the world, in a few words.
        uses: What it needs outside the tree.
        facts: The facts that its answers use, with their initial values.
        reads: Further facts that its behaviour depends on.
        writes: Further facts that it changes.
        semantics: How it uses the keys in its attributes, where ports do not say it.
        rule: Reports attributes that do not fit each other.
    """
    return NodeSpec(
        path.rpartition(":")[2],
        path,
        kind,
        frozenset(answer.status for answer in answers),
        effects,
        uses,
        answers,
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
        keyword: The name in the constructor; the attribute's is without a trailing `_`.
        kind: The type of its values, as an annotation or a `ValueType`.
        doc: Its description.
        default: The value if it is not written; left out, it has to be.
    """
    return _parameter(keyword, kind if isinstance(kind, ValueType) else type_of(kind), None, doc, default)


def input_port(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return a port that is read; see `attribute`. The type `object` is that of any value."""
    return _port(Direction.INPUT, keyword, kind, doc, default)


def output_port(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return a port that is written; see `input_port`."""
    return _port(Direction.OUTPUT, keyword, kind, doc, default)


def inout_port(keyword: str, kind: object, doc: str, default: object = ...) -> Parameter:
    """Return a port that is read and written; see `input_port`."""
    return _port(Direction.INOUT, keyword, kind, doc, default)


def handed_over(keyword: str, target: type | str, doc: str, *, required: bool = True) -> Parameter:
    """Return a parameter for an object that the mission provides.

    Args:
        keyword: Its name.
        target: The object's class, which is marked by `mission_context`, or its import path.
        doc: Its description.
        required: Whether the node cannot do without; otherwise the default is None.
    """
    return Parameter(keyword, ParameterRole.CONTEXT, required, target_or_path=target, doc=doc)


def reference(keyword: str, path: str, doc: str) -> Parameter:
    """Return a parameter for another leaf of the tree, which a file names.

    Args:
        keyword: Its name.
        path: The import path of the leaf's class.
        doc: Its description.
    """
    return Parameter(keyword, ParameterRole.REFERENCE, required=True, target_or_path=path, doc=doc)


SCOPE = handed_over("scope", "sar_compiler.runtime.blackboard:Scope", "Where keys are looked up.")
ENUMS = handed_over("enums", "sar_compiler.runtime.variables:Enums", "The names that stand for numbers.")
CLOCK = handed_over("clock", "sar_compiler.runtime.clock:Clock", "What the time is measured with.")


def _port(direction: Direction, keyword: str, kind: object, doc: str, default: object) -> Parameter:
    value_type = kind if isinstance(kind, ValueType) else ANYTHING if kind is object else port_type_of(kind)
    assert value_type is not None, kind  # noqa: S101 - a slip in a spec
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
