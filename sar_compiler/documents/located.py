"""Parsed values and their locations in a file. A JSON schema validates them, and all errors are reported at once."""

import functools
import json
import math
import pathlib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sar_compiler.errors import SarError
from sar_compiler.nodes.numbers import (
    convert_mistaken,
    convert_with_unit,
    find_implausible_number,
    intended_duration,
    intended_plain_number,
    number_hint,
)
from sar_compiler.nodes.values import literal_value
from sar_compiler.resources import shared_file_path
from sar_compiler.tree.diagnostic import Advice, Diagnostic, Severity, Source, Span, TreeError
from sar_compiler.tree.guessing import nearest
from sar_compiler.tree.kinds import SEVERITIES
from sar_compiler.tree.yaml_spans import offsets_in_scalar, unquote

if TYPE_CHECKING:
    from jsonschema import Draft7Validator
    from typing_extensions import Unpack

Path = tuple[int | str, ...]

_WORDS = {"object": "a mapping", "array": "a list", "string": "a string"}
_KINDS = {bool: "true or false", int: "a number", float: "a number", str: "a string"}
# The maximum number of known keys in a message. The nearest key is suggested in any case.
_MOST_LISTED = 15


@dataclass(frozen=True)
class SchemaViolation:
    """A value that a schema rejects.

    Attributes:
        code: The kind of the finding.
        message: The text of the finding; empty if another finding already covers the violation.
        path: The path of the value from the root.
        place: The value that the finding marks.
        suggestion: The replacement text, if it can be guessed.
        hint: The remedy, if there is no replacement text.
    """

    code: str
    message: str
    path: Path
    place: "Value"
    suggestion: str | None = None
    hint: str | None = None


def find_violations(root: "Value", schema: str) -> Iterator[SchemaViolation]:
    """Yield the violations of a schema in a value."""
    validator = _validator(schema)
    errors: Iterator[Any] = validator.iter_errors(root.data)
    for error in errors:
        path = tuple(error.absolute_path)
        finders = {
            "additionalProperties": _unknown_keys,
            "required": _missing_keys,
            "anyOf": _missing_keys,
            "not": _conflict,
            UNIT: _unusual_number,
        }
        wrong_quotes = _wrong_quotes(validator, root.value_at(path), path, error)
        if wrong_quotes is not None:
            yield wrong_quotes
        else:
            yield from finders.get(error.validator, functools.partial(_schema_violations, validator))(
                root, path, error
            )


UNIT = "x-unit"
"""The keyword for a number's unit (one of `nodes.numbers.UNITS`) in our schemas. Other programs ignore the keyword."""


@functools.cache
def _validator(schema: str) -> "Draft7Validator":
    # jsonschema is slow to import, and only files that are validated against a schema need it.
    from jsonschema import Draft7Validator, ValidationError, validators

    def check_unit(_validator: Any, unit: str, number: Any, _schema: Any) -> Iterator[ValidationError]:
        is_number = isinstance(number, int | float) and not isinstance(number, bool)
        oddity = find_implausible_number(number, unit) if is_number else None
        # The limits in the schema reject impossible values.
        if oddity is not None and not oddity.is_impossible:
            yield ValidationError(oddity.message, cause=None, context=())

    extend: Any = validators.extend
    parsed = json.loads(shared_file_path("schemas", f"sar_{schema}.schema.json").read_bytes())
    validator: Draft7Validator = extend(Draft7Validator, {UNIT: check_unit})(parsed)
    return validator


def _unknown_keys(root: "Value", path: Path, error: Any) -> Iterator[SchemaViolation]:
    known = list(error.schema["properties"])
    listed = f" (known: {', '.join(known)})" if len(known) <= _MOST_LISTED else ""
    for name in (each for each in error.instance if each not in known):
        message = f"{_owner(path, error.schema)} has no key '{name}'{listed}"
        inner = (*path, name)
        yield SchemaViolation("unknown-key", message, inner, root.name_at(inner), nearest(name, known))


def _missing_keys(root: "Value", path: Path, error: Any) -> Iterator[SchemaViolation]:
    """Yield one finding for all missing keys of a mapping, except for keys that are misspelt."""
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
    hint = f"for example {names[0]}: {examples[0]}" if examples else None
    message = f"{_owner(path, error.schema)} needs {needs}" if needs else ""
    yield SchemaViolation("missing-key", message, path, root.name_at(path), hint=hint)


def _conflict(root: "Value", path: Path, error: Any) -> Iterator[SchemaViolation]:
    inner = (*path, error.instance)
    message = f"'{error.instance}' cannot be combined with {error.schema['title']}"
    yield SchemaViolation(
        "conflicting-keys", message, inner, root.name_at(inner), hint="write two separate entries"
    )


def _wrong_quotes(
    validator: "Draft7Validator", value: "Value", path: Path, error: Any
) -> SchemaViolation | None:
    """Return a finding if adding or removing quotes would make the value valid; otherwise return None."""
    if error.validator not in ("type", "enum") or value.text is None or value.is_nothing:
        return None
    if isinstance(value.data, str):
        meant, which, suggestion = value.scalar, "in", None
        hint = f"write {value.text}, without quotes"
    else:
        meant, which, suggestion, hint = value.text, "without", f'"{value.text}"', None
    if meant is None or meant == value.data or not validator.evolve(schema=error.schema).is_valid(meant):
        return None
    message = (
        f"{_title(path, error.schema)} must be {_accepted_values(error.schema)}, but {value.text} {which} quotes is "
        f"{_KINDS.get(type(value.data), 'a date or a time')}"
    )
    return SchemaViolation("wrong-value", message, path, value, suggestion, hint)


def _schema_violations(
    validator: "Draft7Validator", root: "Value", path: Path, error: Any
) -> Iterator[SchemaViolation]:
    value, schema = root.value_at(path), error.schema
    message = f"{_title(path, schema)} must be {_accepted_values(schema)}, but is {value.kind}"
    if value.text and "enum" in schema:
        suggestion, hint = nearest(value.text, _texts(schema["enum"])), None
    else:
        suggestion, hint = _advice(validator.evolve(schema=schema), value, schema)
    misshapen = value.text is None or _types(schema) <= {"object", "array"}
    code = "wrong-shape" if error.validator == "type" and misshapen else "wrong-value"
    if value.is_nothing or value.data in ("", []):
        code = "missing-value"
    yield SchemaViolation(code, message, path, value, suggestion, hint)


def _unusual_number(root: "Value", path: Path, error: Any) -> Iterator[SchemaViolation]:
    """Yield a warning about a number that is valid, but unusually small or large for the expected unit."""
    oddity = find_implausible_number(error.instance, error.schema[UNIT])
    assert oddity is not None  # noqa: S101 - the error is about it
    message = f"{_title(path, error.schema)} {oddity.message}"
    yield SchemaViolation("out-of-range", message, path, root.value_at(path), hint=oddity.hint)


def _advice(validator: Any, value: "Value", schema: dict[str, Any]) -> tuple[str | None, str | None]:
    """Return a valid replacement for a wrong value, or a hint; both may be None."""
    only = value.items[0] if value.items is not None and len(value.items) == 1 else value
    text, unit = only.text or "", schema.get(UNIT, "")
    meant = next(
        (each for each in _meanings(text, unit, schema) if validator.is_valid(parse_scalar(each))), None
    )
    if meant is not None and only is value and value.is_plain:
        return meant, None
    converted, unquoted_too = convert_mistaken(text, unit), "" if only.is_plain else ", without quotes"
    hint = None
    if only is not value and validator.is_valid(only.data):
        hint = f"write {only.text}, without brackets"
    elif value.text and validator.is_valid([value.data]):
        hint = f"write [{json.dumps(value.data, ensure_ascii=False)}]"
    elif meant is not None:
        hint = f"write {meant}{unquoted_too if not isinstance(parse_scalar(meant), str) else ''}"
    elif converted and validator.is_valid(parse_scalar(converted.rpartition(" ")[2])):
        hint = f"{converted}{unquoted_too}"
    elif "," in text and _types(schema) & {"number", "integer"}:
        hint = number_hint(text, unit)
    elif "examples" in schema:
        hint = f"for example {_series(_texts(schema['examples']), 'or')}"
    return None, hint


def _meanings(text: str, unit: str, schema: dict[str, Any]) -> Iterator[str]:
    """Yield the values that the author probably meant by a text in a different notation or unit."""
    readings = (
        intended_duration(text) if "pattern" in schema else None,
        convert_with_unit(text, unit),
        intended_plain_number(text),
    )
    return (each for each in readings if each is not None and each != text)


def _types(schema: dict[str, Any]) -> set[str]:
    types = schema.get("type", ())
    return {types} if isinstance(types, str) else set(types)


def _accepted_values(schema: dict[str, Any]) -> str:
    """Return a phrase that describes the values accepted by a schema, such as "a number or a string"."""
    if "enum" in schema:
        return f"one of {', '.join(_texts(schema['enum']))}"
    types = _types(schema)
    if "title" in schema and "object" not in types:
        return str(schema["title"])
    keys = schema.get("properties", ())
    listed = f" of {', '.join(keys)}" if types == {"object"} and 0 < len(keys) <= _MOST_LISTED else ""
    return _series((word for name, word in _WORDS.items() if name in types), "or") + listed


def _owner(path: Path, schema: dict[str, Any]) -> str:
    """Return the beginning of a message about a wrong or missing key: a phrase for the mapping."""
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


MAX_VALUES = 50_000
"""The maximum number of values, including keys, in a file other than a tree file."""

_CONSTANTS: dict[str, bool | None] = {"true": True, "false": False, "": None}


@dataclass(frozen=True)
class Value:
    """A value in a file.

    Attributes:
        start: The offset of the value's first character.
        end: The offset after the value's last character.
        data: The value as plain data: a dict for a mapping, a list, or a scalar; None for an empty value.
        text: The text of a scalar; None for lists and mappings.
        items: The values of a list; None for other values.
        entries: The keys and values of a mapping; None for other values.
    """

    start: int
    end: int
    data: Any
    text: str | None = None
    items: tuple["Value", ...] | None = None
    entries: tuple[tuple["Value", "Value"], ...] | None = None

    @classmethod
    def from_items(cls, start: int, end: int, items: Iterable["Value"]) -> "Value":
        """Create a list from its items."""
        values = tuple(items)
        return cls(start, end, [value.data for value in values], items=values)

    @classmethod
    def from_entries(cls, start: int, end: int, entries: Iterable[tuple["Value", "Value"]]) -> "Value":
        """Create a mapping from its entries, whose keys are unique strings."""
        pairs = tuple(entries)
        return cls(start, end, {key.text: inner.data for key, inner in pairs}, entries=pairs)

    @property
    def is_nothing(self) -> bool:
        """Whether the value is empty."""
        return self.data is None and not self.text

    @property
    def is_plain(self) -> bool:
        """Whether the value is a scalar without quotes in the file."""
        return self.text is not None and self.end - self.start == len(self.text)

    @property
    def kind(self) -> str:
        """A phrase for the value in a message, such as "a list" or "the string '5'"."""
        if self.text is None:
            return "a list" if self.entries is None else "a mapping"
        if self.is_nothing:
            return "empty"
        is_quoted = isinstance(self.data, str) and self.scalar != self.data
        return f"the string '{self.text}'" if is_quoted else f"'{self.text}'"

    @property
    def scalar(self) -> bool | float | str | None:
        """The value that this scalar would have if its text were written without quotes."""
        return parse_scalar(self.text or "")

    @property
    def mapping(self) -> dict[str, "Value"]:
        """The values of this mapping, by key; empty if this value is not a mapping."""
        return {key.text or "": inner for key, inner in self.entries or ()}

    @property
    def as_list(self) -> tuple["Value", ...]:
        """The items of a list; any other value is treated as a list with one item."""
        return (self,) if self.items is None else self.items

    def value_at(self, path: Path) -> "Value":
        """Return the value at a path of keys and indices."""
        value = self
        for step in path:
            value = value.as_list[step] if isinstance(step, int) else value.mapping[step]
        return value

    def name_at(self, path: Path) -> "Value":
        """Return the key of the value at *path*, or the value itself if it has no key (as an item of a list)."""
        keys = (key for key, _ in self.value_at(path[:-1]).entries or () if path and key.text == path[-1])
        return next(keys, self.value_at(path))

    def without_paths(self, paths: Iterable[Path]) -> "Value":
        """Return a copy of this value without the values at *paths*. Every path must have at least one step."""
        below: defaultdict[int | str, set[Path]] = defaultdict(set)
        for path in paths:
            below[path[0]].add(path[1:])
        if self.items is not None:
            kept = [(item, below[index]) for index, item in enumerate(self.items)]
            items = [item.without_paths(gone) if gone else item for item, gone in kept if () not in gone]
            return Value.from_items(self.start, self.end, items)
        entries = [(key, inner, below[key.text or ""]) for key, inner in self.entries or ()]
        left = [
            (key, inner.without_paths(gone) if gone else inner)
            for key, inner, gone in entries
            if () not in gone
        ]
        return Value.from_entries(self.start, self.end, left)


def parse_scalar(text: str) -> bool | float | str | None:
    """Convert an unquoted text to a number, a Boolean or (if empty) None; return any other text unchanged."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    value = literal_value(text)
    return value if isinstance(value, str) or math.isfinite(value) else text


class Document:
    """A file of values with their locations, and the findings about it.

    Attributes:
        source: The text of the file.
        folder: The folder that contained the file when it was read, with links resolved; None for a text without a file.
        root: The content, which the parser of the file's format sets.
        findings: The findings so far.
    """

    root: Value

    def __init__(self, source: Source, folder: pathlib.Path | None = None) -> None:
        self.source, self.folder = source, folder
        self.findings: list[Diagnostic] = []
        self._values = 0

    def count_value(self) -> None:
        """Add 1 to the number of parsed values.

        Raises:
            TreeError: If there are more than `MAX_VALUES`. A value takes up to a thousand times the memory of its text.
        """
        self._values += 1
        if self._values > MAX_VALUES:
            message = f"the file has more than {MAX_VALUES:,} values"
            raise TreeError([Diagnostic("file-too-large", message, self.source, Span(1, 1, 1, 1))])

    def report(
        self,
        code: str,
        message: str,
        value: Value,
        part: tuple[int, int] | None = None,
        **advice: "Unpack[Advice]",
    ) -> None:
        """Report an error in a value.

        Args:
            code: The kind of the finding.
            message: The text of the finding.
            value: The value with the error.
            part: The start and end of the wrong part of a scalar's text; None for the whole text.
            **advice: As in `Diagnostic`.
        """
        self.findings.append(Diagnostic(code, message, self.source, self.span(value, part), **advice))

    def validate(self, schema: str, value: Value | None = None) -> Value:
        """Validate a value against a schema, report the errors, and return the valid parts of the value.

        The result conforms to the schema, so it needs no further checks.

        Args:
            schema: The name of the schema, such as `scenario` for `schemas/sar_scenario.schema.json`.
            value: The value; by default the whole file.

        Raises:
            TreeError: If no part of the value can be used. The error contains all findings.
        """
        left = self.root if value is None else value
        refused = list(find_violations(left, schema))
        # If several parts of the schema reject one value, only the first finding is reported.
        reported: set[tuple[Path, str]] = set()
        impossible = {each.path for each in refused if each.code != "out-of-range"}
        for each in refused:
            if each.code == "out-of-range" and each.path in impossible:
                continue
            if each.message and (each.path, each.code) not in reported:
                place, suggestion, hint = each.place, each.suggestion, each.hint
                self.report(each.code, each.message, place, suggestion=suggestion, hint=hint)
                reported.add((each.path, each.code))
        # A mapping without a required key is removed as well. A number that is only unusual is kept.
        while gone := [each.path for each in refused if SEVERITIES[each.code] is Severity.ERROR]:
            if () in gone:
                self.raise_findings()
            left = left.without_paths(gone)
            refused = list(find_violations(left, schema))
        return left

    @contextmanager
    def prefer_findings(self) -> Iterator[None]:
        """If the block raises an error and the file has findings, raise these findings instead of the error.

        Raises:
            TreeError: If the file has findings and the block raises a `SarError`.
        """
        try:
            yield
        except SarError:
            self.raise_findings()
            raise

    def raise_findings(self) -> None:
        """If any finding about the file is an error, raise all findings in file order.

        Raises:
            TreeError: If at least one finding is an error.
        """
        if len(self.warnings) < len(self.findings):
            raise TreeError(_sort_findings(self.findings))

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """The findings that do not prevent the use of the file, in file order."""
        return tuple(each for each in _sort_findings(self.findings) if each.severity is not Severity.ERROR)

    def span(self, value: Value, part: tuple[int, int] | None = None) -> Span:
        """Return the location of a value or of a part of its text; for a list or mapping, its first line."""
        source = self.source
        if value.text is None:
            # Only the beginning is marked, because a mapping may extend over many lines.
            line = source.span(value.start, value.start).line
            end = source.offset(line, len(source.line(line)) + 1)
            return source.span(value.start, max(value.start + 1, min(value.end, end)))
        start, end = unquote(source.text, value.start, value.end)
        if part is None:
            return source.span(start, max(start + 1, end))
        offsets = offsets_in_scalar(source.text, value.start, value.end, value.text)
        first, last = (offsets[min(place, len(offsets) - 1)] for place in part)
        return source.span(first, max(first + 1, last))


def _sort_findings(findings: Iterable[Diagnostic]) -> list[Diagnostic]:
    return sorted(dict.fromkeys(findings), key=lambda each: (each.span.line, each.span.column))
