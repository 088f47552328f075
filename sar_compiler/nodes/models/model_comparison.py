"""Comparison of a `TreeNodesModel` with the registry and with itself."""

from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.models.models import Model, Models, Port
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter
from sar_compiler.nodes.values import (
    ANYTHING,
    ConversionError,
    ValueType,
    blackboard_key,
    type_of,
    type_of_cpp_name,
)

_TEXT = type_of(str)
# The comparable types: C++ has types of its own for durations, enumerations and other values written as texts.
_COMPARED = (bool, int, float, str, list)


def compare(models: Models, registry: Registry, collector: Collector) -> None:
    """Report models that contradict the registry, and defaults that their ports do not accept.

    BehaviorTree.CPP does not look at the models of nodes, so these are warnings.
    """
    for model in models.nodes.values():
        specs = registry.variants(model.tag)
        if specs:
            _compare_kind(model, specs[0], collector)
        known = {parameter.name: parameter for spec in specs for parameter in spec.attributes}
        for port in model.ports.values():
            parameter = known.get(port.name)
            if parameter is not None:
                _compare_port(model, port, parameter, collector)
                _check_default(port, parameter.value_type or _TEXT, collector)
            elif specs:
                message = f"<{model.tag}> has no port '{port.name}'; it has {', '.join(known)}"
                near = collector.guesses.nearest(port.name, known)
                collector.add("model-mismatch", message, port.element, value="name", suggestion=near)
            else:
                _check_default(port, type_of_cpp_name(port.type_name) or ANYTHING, collector)


def _compare_kind(model: Model, spec: NodeSpec, collector: Collector) -> None:
    if model.kind is not spec.kind:
        article = "an" if spec.kind is Kind.ACTION else "a"
        message = f"<{model.tag}> is {article} {spec.kind.value}, and the model says {model.element.tag}"
        collector.add("model-mismatch", message, model.element, suggestion=spec.kind.value)


def _compare_port(model: Model, port: Port, parameter: Parameter, collector: Collector) -> None:
    if {parameter.direction, port.direction} == {Direction.INPUT, Direction.OUTPUT}:
        right = Direction.INPUT if port.direction is Direction.OUTPUT else Direction.OUTPUT
        message = f"the port '{port.name}' of <{model.tag}> is an {right.value}"
        collector.add("model-mismatch", message, port.element, suggestion=right.value)
    said, real = type_of_cpp_name(port.type_name), parameter.value_type or _TEXT
    if said is not None and not _agree(said, real):
        message = (
            f"the port '{port.name}' of <{model.tag}> is {real.label}, and the model says {port.type_name}"
        )
        collector.add("model-mismatch", message, port.element, value="type", suggestion=real.cpp)


def _agree(said: ValueType, real: ValueType) -> bool:
    """Return whether a model's type fits a port, regardless of the size of whole numbers."""
    if real.python not in _COMPARED:
        return True
    return said.cpp == real.cpp if list in (said.python, real.python) else said.python is real.python


def _check_default(port: Port, value_type: ValueType, collector: Collector) -> None:
    """Report a default that is not a valid value of the port; an empty one and that of an output do not count."""
    text = port.default
    if not text or port.direction is Direction.OUTPUT or blackboard_key(text, port.name) is not None:
        return
    try:
        value_type.convert(text)
    except ConversionError as error:
        message, near, hint = f"default: {error.message}", error.suggestion, error.hint
        collector.add("wrong-model", message, port.element, value="default", suggestion=near, hint=hint)
