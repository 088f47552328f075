"""Forms of every registered control and decorator with different attributes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Direction, NodeSpec, Parameter, ParameterRole
from sar_compiler.nodes.values import NO_VALUE, ConversionError, ValueType
from sar_compiler.runtime.expressions import Script

_SAMPLES = ("-1", "0", "1", "2", "true", "false", "SUCCESS", "FAILURE", "RUNNING", "SKIPPED", "1;2")


def reads_keys(body: str) -> bool:
    """Return whether the behaviour of some nodes depends on the blackboard."""
    return any(key in body for key in ("{v}", "{entry}", "v =="))


@dataclass(frozen=True)
class Form:
    """A node with children and chosen attributes.

    Attributes:
        spec: The node.
        attributes: The written attributes.
    """

    spec: NodeSpec
    attributes: tuple[tuple[str, str], ...]

    def text(self, children: Sequence[str]) -> str:
        written = "".join(f' {name}="{value}"' for name, value in self.attributes)
        return f"<{self.spec.tag}{written}>{''.join(children)}</{self.spec.tag}>"

    def count(self, wanted: int) -> int:
        """Return the allowed number of children that is nearest to a wanted number."""
        least, most = self.spec.child_count
        return max(least, min(wanted, wanted if most is None else most))

    @property
    def reads_keys(self) -> bool:
        """Whether its behaviour depends on the blackboard."""
        return reads_keys(self.text([]))

    def __str__(self) -> str:
        return self.text([])


def forms(registry: Registry | None = None) -> list[Form]:
    """Return forms of every control and decorator: each attribute with every sample value that it accepts.

    Args:
        registry: The registered nodes; by default all installed ones.
    """
    return [
        form
        for spec in registry or default_registry()
        if not spec.kind.is_leaf and spec.tag != "ForEach"
        for form in _forms_of(spec)
    ]


def _forms_of(spec: NodeSpec) -> Iterator[Form]:
    samples = {p.name: _samples(p) for p in spec.parameters.values() if p.role is ParameterRole.ATTRIBUTE}
    samples = {name: texts for name, texts in samples.items() if name not in spec.implied_values}
    usual = {p.name: samples[p.name][0] for p in spec.required_attributes}
    seen: set[tuple[tuple[str, str], ...]] = set()
    for name, text in [("", ""), *((name, text) for name, texts in samples.items() for text in texts)]:
        written = {**usual, **({name: text} if name else {})}
        if "selected" in written or ("policy" in spec.parameters and spec.semantics.order is Order.TOGETHER):
            written = {key: value for key, value in written.items() if key != "selected"}
            if written.get("policy") == "SuccessOnSelected" or (
                written.get("policy") == "SuccessOnOne" and "synchronise" in written
            ):
                continue
        if (attributes := tuple(written.items())) not in seen:
            seen.add(attributes)
            yield Form(spec, attributes)


def _samples(parameter: Parameter) -> list[str]:
    """Return sample texts for an attribute."""
    name, value_type = parameter.name, parameter.value_type
    told = {
        "entry": ["{entry}"],
        "current_child_idx": ["{v}"],
        "variable": ["1", "2", "{v}"],
        **{f"case_{n}": [str(n)] for n in range(1, 7)},
    }
    is_input = parameter.direction is None or parameter.direction is Direction.INPUT
    if name in told or value_type is NO_VALUE or not is_input:
        return told.get(name, ["{item}"])
    if value_type.name.startswith("nav2."):  # messages do not change the behaviour of nodes
        return []
    if value_type.python is Script:
        return ["true", "false", "v == 1"]
    return list(value_type.choices)[:4] or [text for text in _SAMPLES if _is_value(text, value_type)]


def _is_value(text: str, value_type: ValueType) -> bool:
    try:
        value_type.convert(text)
    except ConversionError:
        return False
    return True
