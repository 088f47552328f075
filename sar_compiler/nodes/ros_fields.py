"""Parsing of ROS message fields in attributes of tree files.

The fields are YAML, with `{key}` for a blackboard key.

This module parses only the text, without ROS. `ros_interfaces` fills messages with the values.
"""

import dataclasses
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import yaml

from sar_compiler.nodes.values import ConversionError, ValueType
from sar_compiler.tree.yaml_fields import mask, unmask

_KEY = re.compile(r"[@\ue000]?[A-Za-z_]\w*", re.ASCII)
_MOST_CHARACTERS = 100_000
_DEEPEST = 50
_PATH = re.compile(r"[A-Za-z]\w*(\[[0-9]{1,6}\])?(\.[A-Za-z]\w*(\[[0-9]{1,6}\])?)*", re.ASCII)
_EXAMPLE = "write fields, for example x: 1.5, y: {key}"

PlaceInText: TypeAlias = tuple[int, int]
"""The start and end offsets of a part of the text."""


@dataclass(frozen=True)
class KeyReference:
    """A blackboard key that is read when the message is created."""

    name: str
    place: PlaceInText


@dataclass(frozen=True)
class Scalar:
    """A single value.

    Attributes:
        text: The text of the scalar.
        value: The YAML value: a number, a bool, a string, bytes or None.
        place: The location of the scalar in the text; None for a value from the blackboard.
    """

    text: str
    value: object
    place: PlaceInText | None = None


@dataclass(frozen=True)
class FieldList:
    """A list of values."""

    items: "tuple[FieldValue, ...]"
    place: PlaceInText | None = None


@dataclass(frozen=True)
class MessageFields:
    """Message fields by name, each with the location of the name.

    Attributes:
        fields: The value and the location of each field.
        text: The whole written text; empty for fields within other fields.
    """

    fields: "Mapping[str, tuple[FieldValue, PlaceInText | None]]"
    place: PlaceInText | None = None
    text: str = dataclasses.field(default="", compare=False)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class MessageReference:
    """A message from a blackboard key, or a part of such a message."""

    message: object
    place: PlaceInText | None = None


FieldValue: TypeAlias = KeyReference | Scalar | FieldList | MessageFields | MessageReference


def keys_of(value: FieldValue) -> Iterator[str]:
    """Yield the blackboard keys in a value. A key that occurs repeatedly is yielded repeatedly."""
    if isinstance(value, KeyReference):
        yield value.name
    elif isinstance(value, FieldList):
        for each in value.items:
            yield from keys_of(each)
    elif isinstance(value, MessageFields):
        for inner, _ in value.fields.values():
            yield from keys_of(inner)


def value_of(found: object, place: PlaceInText | None = None) -> FieldValue:
    """Convert a blackboard value to a `FieldValue`.

    The value is a number, a string, a list, a mapping or a message.

    Args:
        found: The value.
        place: The location of the blackboard key in the text.
    """
    if found is None or isinstance(found, (bool, int, float, str, bytes)):
        return Scalar(str(found), found, place)
    if isinstance(found, Mapping):
        return MessageFields(
            {str(name): (value_of(inner, place), place) for name, inner in found.items()}, place
        )
    if hasattr(found, "get_fields_and_field_types"):
        return MessageReference(found, place)
    if hasattr(found, "tolist"):  # an array of Python, or of numpy
        return value_of(found.tolist(), place)
    if isinstance(found, Sequence):
        return FieldList(tuple(value_of(each, place) for each in found), place)
    return MessageReference(found, place)


def read_fields(text: str) -> MessageFields:
    """Parse message fields, with or without braces around them.

    The text is YAML as for `ros2 service call`, with two additions: `{key}` in place of a value is a blackboard key, and
    commas may separate the outermost fields without braces.

    Raises:
        ConversionError: If the text is not YAML, or does not consist of fields. The error contains the location.
    """
    if len(text) > _MOST_CHARACTERS:
        raise ConversionError(
            f"the text has {len(text)} characters, but at most {_MOST_CHARACTERS} are allowed"
        )
    if not text.strip():
        return MessageFields({}, text=text)
    depth = max(itertools.accumulate((each in "[{") - (each in "]}") for each in text))
    if depth > _DEEPEST:
        raise ConversionError("the text is nested too deeply")
    node, shift = _compose_yaml(mask(text))
    found = _Reader(text, shift).node_value(node)
    if not isinstance(found, MessageFields):
        raise ConversionError(f"{_excerpt(text)} is not a field with a value", hint=_EXAMPLE)
    return dataclasses.replace(found, text=text)


def _compose_yaml(text: str) -> tuple[yaml.Node, int]:
    """Parse a text as YAML. Return the result and the number of characters added before the text."""
    # The text is first parsed unchanged, as in ROS. Without braces, `a: 1, b: 2` is not YAML.
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, ValueError):
        node = None
    if isinstance(node, yaml.MappingNode) or (node is not None and text.lstrip()[:1] in "{["):
        return node, 0
    try:
        wrapped = yaml.compose(f"{{{text}\n}}", Loader=yaml.SafeLoader)
    except yaml.YAMLError as error:
        raise _yaml_error(text, error) from error
    assert wrapped is not None  # noqa: S101 - there are braces
    return wrapped, 1


def _yaml_error(text: str, error: yaml.YAMLError) -> ConversionError:
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "not readable"
    mark = getattr(error, "problem_mark", None)
    at = min(max(mark.index - 1, 0), len(text) - 1) if mark is not None else 0
    return ConversionError(
        f"{_excerpt(text)} is not YAML: {problem}", hint=_EXAMPLE, place=(at, at + 1) if mark else None
    )


def _excerpt(text: str) -> str:
    return repr(text if len(text) <= 60 else f"{text[:57]}...")  # noqa: PLR2004 - a line of a terminal


class _Reader:
    """Converter of YAML nodes to values.

    Args:
        text: The text as written.
        shift: The number of characters added before the text for the YAML parser.
    """

    def __init__(self, text: str, shift: int) -> None:
        self._text, self._shift = text, shift
        self._seen: set[int] = set()
        self._constructor = yaml.constructor.SafeConstructor()

    def node_value(self, node: yaml.Node) -> FieldValue:
        """Return the value of a node and its descendants."""
        place = self._location(node)
        if id(node) in self._seen:
            # Aliases of lists of aliases could create a value of any size.
            raise ConversionError(
                "a YAML alias (*) is not allowed here", hint="repeat the value", place=place
            )
        self._seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            return FieldList(tuple(self.node_value(each) for each in node.value), place)
        if isinstance(node, yaml.MappingNode):
            return self._key(node, place) or self._fields(node, place)
        try:
            found = self._constructor.construct_object(node)
        except (yaml.YAMLError, ValueError) as error:
            problem = getattr(error, "problem", None) or error
            raise ConversionError(
                f"'{node.value}' is not a value: {problem}", hint="put it in quotes", place=place
            ) from error
        return Scalar(unmask(node.value), unmask(found) if isinstance(found, str) else found, place)

    def _key(self, node: yaml.MappingNode, place: PlaceInText) -> KeyReference | None:
        """Return the key in a mapping of the form `{x}`; None for other mappings."""
        if len(node.value) != 1 or not node.flow_style:
            return None
        name, nothing = node.value[0]
        is_alone = isinstance(nothing, yaml.ScalarNode) and nothing.value == "" and nothing.style is None
        is_name = isinstance(name, yaml.ScalarNode) and name.style is None and _KEY.fullmatch(name.value)
        # `{x:}` is a field without a value.
        written = self._text[place[0] : place[1]]
        if not (is_alone and is_name) or ":" in written:
            return None
        return KeyReference(unmask(name.value), place)

    def _fields(self, node: yaml.MappingNode, place: PlaceInText) -> MessageFields:
        found: dict[str, tuple[FieldValue, PlaceInText | None]] = {}
        for name, inner in node.value:
            at = self._location(name)
            if not isinstance(name, yaml.ScalarNode) or name.value == "<<":
                raise ConversionError("a field must have a name", hint=_EXAMPLE, place=at)
            field = unmask(name.value)
            if field in found:
                raise ConversionError(
                    f"'{field}' is given twice", hint="delete one of the two fields", place=at
                )
            found[field] = self.node_value(inner), at
        return MessageFields(found, place)

    def _location(self, node: yaml.Node) -> PlaceInText:
        begin, end = (mark.index - self._shift for mark in (node.start_mark, node.end_mark))
        return min(max(begin, 0), len(self._text)), min(max(end, 0), len(self._text))


@dataclass(frozen=True)
class FieldPath:
    """The path of a field in a message: `pose.position.x`, `results[0].successful`."""

    text: str
    place: PlaceInText | None = None

    @property
    def steps(self) -> "Iterator[tuple[str, int | None]]":
        """The field names of the path, each with the index of a list element, or None."""
        for step in self.text.split("."):
            name, _, number = step.partition("[")
            yield name, int(number[:-1]) if number else None

    def __str__(self) -> str:
        return self.text


def read_path(text: str) -> FieldPath | None:
    """Parse the path of a field. Return None for an empty text.

    Raises:
        ConversionError: If the text is not a field path.
    """
    if not text:
        return None
    if not _PATH.fullmatch(text):
        raise ConversionError(
            f"{_excerpt(text)} is not a field path", hint="separate the names by dots: pose.position.x"
        )
    return FieldPath(text, (0, len(text)))


@dataclass(frozen=True)
class Destinations:
    """Fields of a received message, and the keys to which they are written.

    Attributes:
        keys: The fields, each with its key.
        text: The whole written text.
    """

    keys: tuple[tuple[FieldPath, str], ...] = ()
    text: str = dataclasses.field(default="", compare=False)

    def __str__(self) -> str:
        return self.text


def read_destinations(text: str) -> Destinations:
    """Parse a list of fields with their keys, such as `error_code: {code}, error_msg: {message}`.

    Raises:
        ConversionError: If a field is invalid or has no key. The error contains the location.
    """
    return Destinations(tuple(_destinations(read_fields(text), "")), text)


def _destinations(fields: MessageFields, before: str) -> Iterator[tuple[FieldPath, str]]:
    for name, (value, place) in fields.fields.items():
        path = f"{before}{name}"
        if not _PATH.fullmatch(path):
            raise ConversionError(
                f"'{path}' is not a field path", hint="separate the names by dots: pose.x", place=place
            )
        if isinstance(value, MessageFields):
            yield from _destinations(value, f"{path}.")
        elif isinstance(value, KeyReference):
            yield FieldPath(path, place), value.name
        else:
            at = value.place if isinstance(value, (Scalar, FieldList)) else place
            raise ConversionError(
                f"'{path}' needs the key to which the field is written",
                hint=f"write {path}: {{key}}",
                place=at,
            )


def _keys_in(value: object) -> list[str]:
    return list(dict.fromkeys(keys_of(value))) if isinstance(value, MessageFields) else []


def _destination_keys(value: object) -> list[str]:
    return [key for _, key in value.keys] if isinstance(value, Destinations) else []


FIELDS = ValueType(
    "fields",
    "fields as YAML",
    read_fields,
    cpp="std::string",
    example="",
    keys_in=_keys_in,
    takes_braces=True,
)
"""The type of attributes with the fields of a request, goal or message to send."""
DESTINATIONS = ValueType(
    "destinations",
    "a map from fields to keys",
    read_destinations,
    python=Destinations,
    cpp="std::string",
    example="",
    keys_in=_destination_keys,
    takes_braces=True,
)
"""The type of attributes with fields of a received message, each with a key."""
FIELD_PATH = ValueType("field.path", "a field", read_path, python=FieldPath, cpp="std::string", example="")
"""The type of attributes with the path of one field."""
