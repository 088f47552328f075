"""Violations of a JSON schema in `schemas/`, as readable findings.

Editors use the same schemas for completion. A `title` names a kind of value with its article; `examples` are valid ones.
"""

import functools
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sar_compiler.resources import shipped
from sar_compiler.tree.guessing import nearest

if TYPE_CHECKING:
    from jsonschema import Draft7Validator

    from sar_compiler.documents.located import Value

Path = tuple[int | str, ...]

_WORDS = {"object": "a mapping", "array": "a list", "string": "a text"}
_KINDS = {bool: "true or false", int: "a number", float: "a number", str: "a text"}
# A longer list does not help; the nearest name is suggested nevertheless.
_MOST_LISTED = 15


@dataclass(frozen=True)
class Refusal:
    """A value that a schema refuses.

    Attributes:
        code: The kind of the finding.
        message: The text of the finding; empty if another finding covers it already.
        path: Its path from the root.
        place: The value to mark.
        suggestion: The replacement, if it can be guessed.
        hint: The remedy, if there is no replacement.
    """

    code: str
    message: str
    path: Path
    place: "Value"
    suggestion: str | None = None
    hint: str | None = None


def refusals(root: "Value", schema: str) -> Iterator[Refusal]:
    """Yield the parts of a value that a schema refuses."""
    validator = _validator(schema)
    errors: Iterator[Any] = validator.iter_errors(root.data)
    for error in errors:
        path = tuple(error.absolute_path)
        refuse = {
            "additionalProperties": _unknown_keys,
            "required": _missing,
            "anyOf": _missing,
            "not": _conflict,
        }
        of_another_type = _of_another_type(validator, root.at(path), path, error)
        if of_another_type is not None:
            yield of_another_type
        else:
            yield from refuse.get(error.validator, _wrong)(root, path, error)


@functools.cache
def _validator(schema: str) -> "Draft7Validator":
    # Imported here, since it is slow and only these files need it.
    from jsonschema import Draft7Validator

    return Draft7Validator(json.loads(shipped("schemas", f"sar_{schema}.schema.json").read_bytes()))


def _unknown_keys(root: "Value", path: Path, error: Any) -> Iterator[Refusal]:
    known = list(error.schema["properties"])
    listed = f"; it has {', '.join(known)}" if len(known) <= _MOST_LISTED else ""
    for name in (each for each in error.instance if each not in known):
        message = f"{_owner(path, error.schema)} has no '{name}'{listed}"
        inner = (*path, name)
        yield Refusal("unknown-key", message, inner, root.name_at(inner), nearest(name, known))


def _missing(root: "Value", path: Path, error: Any) -> Iterator[Refusal]:
    """Yield one finding for all missing keys, except those probably meant by an unknown one that has its own."""
    given, properties = error.instance, error.schema["properties"]
    unknown = set() if error.schema.get("additionalProperties", True) else given.keys() - properties.keys()
    meant = {nearest(name, properties) for name in unknown}
    if error.validator == "anyOf":
        names = [each["required"][0] for each in error.validator_value]
        needs = "" if meant & set(names) else f"one of {', '.join(names)}"
    else:
        names = [name for name in error.validator_value if name not in given and name not in meant]
        needs = _series((f"'{name}'" for name in names), "and")
    examples = properties[names[0]].get("examples") if len(names) == 1 else None
    hint = f"write {names[0]}: {examples[0]}" if examples else None
    message = f"{_owner(path, error.schema)} needs {needs}" if needs else ""
    yield Refusal("missing-key", message, path, root.name_at(path), hint=hint)


def _conflict(root: "Value", path: Path, error: Any) -> Iterator[Refusal]:
    inner = (*path, error.instance)
    message = f"'{error.instance}' does not go with {error.schema['title']}"
    yield Refusal("conflicting-keys", message, inner, root.name_at(inner), hint="make two of it")


def _of_another_type(validator: "Draft7Validator", value: "Value", path: Path, error: Any) -> Refusal | None:
    """Return the finding about a value that would be right with quotes, or without them; None about others."""
    if error.validator not in ("type", "enum") or value.text is None or value.is_nothing:
        return None
    if isinstance(value.data, str):
        meant, which, suggestion = value.meaning, "in", None
        hint = f"write {value.text}, without quotes"
    else:
        meant, which, suggestion, hint = value.text, "without", f'"{value.text}"', None
    if meant is None or meant == value.data or not validator.evolve(schema=error.schema).is_valid(meant):
        return None
    message = (
        f"{_title(path, error.schema)} is {_accepted_values(error.schema)}, and {value.text} {which} quotes is "
        f"{_KINDS.get(type(value.data), 'a date or a time')}"
    )
    return Refusal("wrong-value", message, path, value, suggestion, hint)


def _wrong(root: "Value", path: Path, error: Any) -> Iterator[Refusal]:
    value, schema = root.at(path), error.schema
    message = f"{_title(path, schema)} is {_accepted_values(schema)}, and this is {value.kind}"
    near = nearest(value.text, _texts(schema["enum"])) if value.text and "enum" in schema else None
    hint = f"write {_series(_texts(schema['examples']), 'or')}" if "examples" in schema else None
    misshapen = value.text is None or _types(schema) <= {"object", "array"}
    code = "wrong-shape" if error.validator == "type" and misshapen else "wrong-value"
    if value.is_nothing or value.data in ("", []):
        code = "missing-value"
    yield Refusal(code, message, path, value, near, hint)


def _types(schema: dict[str, Any]) -> set[str]:
    types = schema.get("type", ())
    return {types} if isinstance(types, str) else set(types)


def _accepted_values(schema: dict[str, Any]) -> str:
    """Return the values that a schema accepts, for a sentence."""
    if "enum" in schema:
        return f"one of {', '.join(_texts(schema['enum']))}"
    types = _types(schema)
    if "title" in schema and "object" not in types:
        return str(schema["title"])
    keys = schema.get("properties", ())
    listed = f" of {', '.join(keys)}" if types == {"object"} and 0 < len(keys) <= _MOST_LISTED else ""
    return _series((word for name, word in _WORDS.items() if name in types), "or") + listed


def _owner(path: Path, schema: dict[str, Any]) -> str:
    """Return the name of a mapping with a wrong or missing key."""
    return schema.get("title") or _title(path, schema)


def _title(path: Path, schema: dict[str, Any]) -> str:
    if not path:
        return str(schema["title"])
    if isinstance(path[-1], str):
        return f"'{path[-1]}'"
    return f"an item of '{next(step for step in reversed(path) if isinstance(step, str))}'"


def _texts(values: Iterable[Any]) -> list[str]:
    return [value if isinstance(value, str) else json.dumps(value) for value in values]


def _series(words: Iterable[str], last: str) -> str:
    *front, end = [*words] or [""]
    return f"{', '.join(front)} {last} {end}" if front else end
