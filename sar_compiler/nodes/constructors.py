"""Parameters of a registered class, read from its constructor: the constructor is the manifest."""

import inspect
import re
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.nodes.answers import SELF, mistake_in, placeholders
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, Role
from sar_compiler.nodes.values import ANYTHING, ValueType, is_class, port_type_of, value_type_of, without_none
from sar_compiler.runtime.context import is_mission_context
from sar_compiler.runtime.ports import InOut, Input, Output

_DIRECTIONS: dict[object, Direction] = {
    Input: Direction.INPUT,
    Output: Direction.OUTPUT,
    InOut: Direction.INOUT,
}
_STRUCTURE = {"name": Role.NAME, "child": Role.CHILD, "children": Role.CHILDREN}
_VARIADIC = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)


class RegistrationError(SarError):
    """A class cannot be registered for a tag."""


def parameters_of(spec: NodeSpec) -> Mapping[str, Parameter]:
    """Return the parameters of the constructor of a node's class by attribute name, in their order.

    Raises:
        RegistrationError: If one cannot be written in a tree file, or the answers use unknown ones.
    """
    constructor: Callable[..., Any] = spec.cls.__init__  # type: ignore[misc]
    try:
        hints = typing.get_type_hints(constructor, include_extras=True)
    except Exception as error:
        message = f"<{spec.tag}>: the annotations of {_name_of(spec)} cannot be resolved: {error}"
        raise RegistrationError(message) from error
    docs = _inherited_documentation(spec.cls)
    found = (
        _parameter(spec, parameter, hints.get(name), docs.get(name, ""))
        for name, parameter in _writable(constructor)
    )
    parameters = {parameter.name: parameter for parameter in found}
    _complain_unless_structured(spec, parameters)
    _complain_unless_answerable(spec, parameters)
    return parameters


def summary_of(cls: type | None) -> str:
    """Return the first paragraph of a class's docstring, as one line."""
    return _documentation(cls)[0]


def _writable(constructor: Callable[..., Any]) -> Iterator[tuple[str, inspect.Parameter]]:
    """Yield the parameters without `self`, and without `*args` and `**kwargs`."""
    for name, parameter in list(inspect.signature(constructor).parameters.items())[1:]:
        if parameter.kind not in _VARIADIC:
            yield name, parameter


def _parameter(spec: NodeSpec, parameter: inspect.Parameter, annotation: object, doc: str) -> Parameter:
    keyword, name = parameter.name, parameter.name.removesuffix("_")
    required = parameter.default is inspect.Parameter.empty
    common: dict[str, Any] = {
        "required": required,
        "default": None if required else parameter.default,
        "doc": doc,
        "keyword": "" if keyword == name else keyword,
    }
    structure = _STRUCTURE.get(name)
    if structure is Role.NAME:
        return Parameter(name, structure, required=False, value_type=value_type_of(str), doc=doc)
    if structure is not None and not spec.kind.is_leaf:
        return Parameter(name, structure, required=required, doc=doc)
    if annotation is None:
        raise RegistrationError(f"<{spec.tag}>: parameter '{keyword}' of {_name_of(spec)} has no annotation")
    target = without_none(annotation)
    direction = _DIRECTIONS.get(typing.get_origin(target) or target)
    value_type = _carried_type(target) if direction else value_type_of(target)
    if value_type is not None:
        return Parameter(name, Role.ATTRIBUTE, value_type=value_type, direction=direction, **common)
    if is_class(target) and is_mission_context(target):
        return Parameter(name, Role.CONTEXT, target_or_path=target, **common)
    if is_class(target) and issubclass(target, Behaviour):
        return Parameter(name, Role.REFERENCE, target_or_path=target, **common)
    raise RegistrationError(
        f"<{spec.tag}>: parameter '{keyword}' of {_name_of(spec)} is annotated with {annotation!r}, which is "
        "neither a value that can be written in a file (float, int, bool, str, an enum, Path, timedelta, a list "
        "of such, or a port such as Input[float]) nor a leaf class nor marked with @mission_context"
    )


def _complain_unless_structured(spec: NodeSpec, parameters: Mapping[str, Parameter]) -> None:
    roles = {parameter.role for parameter in parameters.values()}
    wanted = {Kind.CONTROL: Role.CHILDREN, Kind.DECORATOR: Role.CHILD}.get(spec.kind)
    if wanted is not None and wanted not in roles:
        raise RegistrationError(
            f"<{spec.tag}>: {_name_of(spec)} is a {spec.kind.value} without a parameter '{wanted.value}'"
        )
    if Role.NAME not in roles:
        raise RegistrationError(f"<{spec.tag}>: the constructor of {_name_of(spec)} has no parameter 'name'")


def _complain_unless_answerable(spec: NodeSpec, parameters: Mapping[str, Parameter]) -> None:
    known = [SELF, *(p.name for p in parameters.values() if p.role is Role.REFERENCE)]
    numbers = [p.name for p in parameters.values() if p.is_whole_number]
    for fact in spec.facts:
        _complain_of_placeholders(spec, fact, known)
    for answer in spec.answers:
        for text in (answer.when, answer.then):
            _complain_of_placeholders(spec, text, [*known, *numbers])
        mistake = mistake_in(answer, known, numbers)
        if mistake is not None:
            part, text, error = mistake
            raise RegistrationError(f"<{spec.tag}>: answer '{answer.name}': {part} '{text}': {error}")


def _complain_of_placeholders(spec: NodeSpec, text: str, known: Sequence[str]) -> None:
    for placeholder in placeholders(text):
        if placeholder not in known:
            braced = ", ".join(f"{{{name}}}" for name in known)
            message = f"<{spec.tag}>: '{text}': nothing is called {{{placeholder}}}; there is {braced}"
            raise RegistrationError(message)


def _carried_type(port: object) -> ValueType | None:
    """Return the type of a port's values: `T` of `Input[T]`, any type for a bare `Input`."""
    carried = typing.get_args(port)[0] if typing.get_args(port) else object
    return ANYTHING if carried in (object, Any) else port_type_of(carried)


def _name_of(spec: NodeSpec) -> str:
    return spec.class_path.replace(":", ".")


def _inherited_documentation(cls: type | None) -> dict[str, str]:
    """Return the descriptions of parameters in the docstrings of a class and its bases, but not of py_trees' own."""
    described: dict[str, str] = {}
    for base in reversed(cls.__mro__ if cls is not None else ()):
        if base is cls or not base.__module__.startswith("py_trees."):
            described.update(_documentation(base)[1])
    return described


def _documentation(cls: type | None) -> tuple[str, dict[str, str]]:
    """Return a docstring's first paragraph and the descriptions of its `Args:`."""
    text = inspect.cleandoc(cls.__doc__ or "") if cls is not None else ""
    summary = " ".join(text.split("\n\n", 1)[0].split())
    section = re.search(r"^Args:\n((?:[ ]+.*(?:\n|$)|\n)*)", text, re.MULTILINE)
    described: dict[str, str] = {}
    if section:
        for entry in re.finditer(r"^ {4}(\w+)[^:\n]*:((?:.*)(?:\n {8,}.*)*)", section.group(1), re.MULTILINE):
            described[entry.group(1)] = " ".join(entry.group(2).split())
    return summary, described
