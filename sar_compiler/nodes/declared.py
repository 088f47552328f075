"""Leaf specs in a JSON file, which contains the declarations of a package's leaves.

Trees with such leaves are checked without importing their classes. `sar-compile nodes --format specs` writes the file.
"""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, Literal

from sar_compiler.errors import SarError
from sar_compiler.nodes.numbers import PlausibleRange
from sar_compiler.nodes.spec import (
    Direction,
    Kind,
    NodeSpec,
    Parameter,
    ParameterRole,
    Signature,
    Use,
    path_of,
)
from sar_compiler.nodes.values import (
    ANYTHING,
    MILLISECONDS,
    NO_VALUE,
    PLAIN,
    REAL_NUMBER,
    SECONDS,
    ValueType,
    at_least,
    list_type,
    require_value_type,
)
from sar_compiler.runtime.outcomes import Outcome

_NAMED = {**PLAIN, **{each.name: each for each in (ANYTHING, MILLISECONDS, NO_VALUE, REAL_NUMBER, SECONDS)}}
_FROM, _CHOICE, _LIST = "integer.from.", "one_of.", ".list"
_PLAIN_FIELDS = ("tag", "kind", "effects", "facts", "reads", "writes", "doc")


class UndeclarableError(SarError):
    """The spec of a leaf cannot be written as JSON."""


def declared_leaves(path: Path) -> list[NodeSpec]:
    """Load the leaf specs for a module's `SPECS` from a file.

    `sar-compile nodes --format specs` writes such files.

    Args:
        path: The file, in the package of the leaves.
    """
    return [_spec(each) for each in json.loads(path.read_text(encoding="utf-8"))]


def specs_as_json(specs: Iterable[NodeSpec]) -> str:
    """Return leaf specs as JSON for `declared_leaves`, one leaf per line.

    Raises:
        UndeclarableError: If a spec cannot be written as JSON. The message names the leaf.
    """
    return "[\n{}\n]\n".format(",\n".join(map(_line, specs)))


def _line(spec: NodeSpec) -> str:
    try:
        return json.dumps(_as_data(spec), default=_as_text)
    except TypeError as error:
        raise UndeclarableError(f"<{spec.tag}> cannot be written as JSON: {error}") from None


def _as_data(spec: NodeSpec) -> dict[str, object]:
    if spec.semantics != NodeSpec.semantics:
        raise TypeError("its semantics can contain functions")
    return {
        "class": spec.class_path,
        "statuses": sorted(spec.statuses),
        "uses": [_changed_fields(each) for each in spec.uses],
        "outcomes": [_changed_fields(each) for each in spec.outcomes],
        "parameters": [
            {**_changed_fields(each), "value_type": _type_as_data(each.value_type)}
            for each in spec.parameters.values()
        ],
        **{name: value for name in _PLAIN_FIELDS if (value := getattr(spec, name))},
    }


def _changed_fields(thing: Any) -> dict[str, object]:
    """Return the fields of a data class instance whose values differ from the defaults."""
    return {
        each.name: value
        for each in fields(thing)
        if (value := getattr(thing, each.name)) != each.default and not isinstance(value, ValueType)
    }


def _as_text(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, type):
        return path_of(value)
    raise TypeError(f"{value!r} is neither a number nor a string")


def _type_as_data(value_type: ValueType) -> object:
    """Return the name of a value type. If the type has a plausible range, return a list with both.

    Raises:
        TypeError: If the name alone does not identify the type.
    """
    plain = value_type._replace(usual=None)
    try:
        # Types are compared by name and label, because equivalent conversion functions are not equal.
        is_known = _type(plain.name)[:2] == plain[:2]
    except (KeyError, ValueError):
        is_known = False
    if not is_known:
        raise TypeError(f"the type '{plain.name}' is private to its package")
    if value_type.usual is None:
        return plain.name
    least, most, is_open = value_type.usual
    return [plain.name, least, None if math.isinf(most) else most, is_open]


def _type(data: Any) -> ValueType:
    if isinstance(data, list):
        name, least, most, is_open = data
        return _type(name)._replace(usual=PlausibleRange(least, math.inf if most is None else most, is_open))
    name = str(data)
    if name.startswith(_FROM):
        return at_least(int(name.removeprefix(_FROM)))
    if name.startswith(_CHOICE):
        return require_value_type(Literal[tuple(name.removeprefix(_CHOICE).split("."))])
    return list_type(_type(name.removesuffix(_LIST))) if name.endswith(_LIST) else _NAMED[name]


def _spec(data: Mapping[str, Any]) -> NodeSpec:
    return NodeSpec(
        data["tag"],
        data["class"],
        Kind(data["kind"]),
        frozenset(data["statuses"]),
        data.get("effects", ""),
        tuple(Use(**each) for each in data["uses"]),
        tuple(_make_outcome(**each) for each in data["outcomes"]),
        data.get("facts", {}),
        tuple(data.get("reads", ())),
        tuple(data.get("writes", ())),
        # The parameters are parsed late, because a file uses few of the installed leaves.
        signature=Signature(partial(_parameters, data["parameters"]), data.get("doc", "")),
    )


def _make_outcome(**said: Any) -> Outcome:
    given: dict[str, Any] = {
        name: tuple(each) if isinstance(each, list) else each for name, each in said.items()
    }
    return Outcome(**given)


def _parameters(data: Iterable[Mapping[str, Any]]) -> dict[str, Parameter]:
    parameters = (_parameter(**each) for each in data)
    return {each.name: each for each in parameters}


def _parameter(role: str, value_type: object, direction: str | None = None, **said: Any) -> Parameter:
    return Parameter(
        role=ParameterRole(role),
        value_type=_type(value_type),
        direction=None if direction is None else Direction(direction),
        **said,
    )
