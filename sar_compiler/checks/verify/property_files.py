"""Files of properties: what must hold in every run of a tree, in YAML."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sar_compiler.checks.verify.monitors import PropertyPattern
from sar_compiler.checks.yaml_values import Document, Value, raise_findings
from sar_compiler.runtime.answers import Fact

_EMPTY_HINT = "write properties: and below it a name, and below that never: LEAF ANSWER"
_PARTS = ("properties", "end", "facts", "answers", "parameters")
_WHILE = "while"
_AT_END = "at_end"


@dataclass(frozen=True)
class _Shape:
    """What a property of a form is written with.

    Attributes:
        main: The key of the events that it is about.
        other: The key of the events that must come; empty where there are none.
        limit: The key of the events that bound it, which may be left out; empty where there are none.
    """

    main: str
    other: str = ""
    limit: str = ""

    @property
    def keys(self) -> list[str]:
        """All keys that it can have."""
        return [key for key in (self.main, self.other, self.limit, _WHILE) if key]


_SHAPES: Mapping[PropertyPattern, _Shape] = {
    PropertyPattern.AFTER: _Shape("after", "eventually", "before"),
    PropertyPattern.NEVER: _Shape("never"),
    PropertyPattern.AT_MOST_ONCE: _Shape("at_most_once", limit="per"),
    # Last, because what comes after something may have to come before something else.
    PropertyPattern.BEFORE: _Shape("before", "comes", "since"),
}
_ALL_KEYS = list(dict.fromkeys([*(key for shape in _SHAPES.values() for key in shape.keys), _AT_END]))


@dataclass(frozen=True)
class EventProperty:
    """A property that speaks of events, as it is written.

    Attributes:
        name: What it is called.
        form: What it says.
        main: The events that it is about.
        other: The events that must come.
        limit: The events that bound it.
        condition: While what the first ones count; None for always.
    """

    name: str
    form: PropertyPattern
    main: tuple[Value, ...]
    other: tuple[Value, ...] = ()
    limit: tuple[Value, ...] = ()
    condition: Value | None = None


@dataclass(frozen=True)
class EndProperty:
    """A property that speaks of the end of a run, as it is written.

    Attributes:
        name: What it is called.
        condition: What must hold there.
    """

    name: str
    condition: Value


@dataclass(frozen=True)
class PropertyFile:
    """What a file of properties says.

    Attributes:
        document: The file; what is wrong with it is told to it.
        end: When a run is over; None for when the root has succeeded or failed.
        events: The properties that speak of events.
        ends: The properties that speak of the end of a run.
        facts: What it says of facts.
        answers: What it says of what leaves answer.
        parameters: The keys of the root blackboard.
    """

    document: Document
    end: Value | None = None
    events: tuple[EventProperty, ...] = ()
    ends: tuple[EndProperty, ...] = ()
    facts: Value | None = None
    answers: Value | None = None
    parameters: Mapping[str, Fact] = field(default_factory=dict)


def read_property_file(path: str | Path) -> PropertyFile:
    """Read a file of properties.

    Raises:
        UnreadableFileError: If it is not there or cannot be read.
        TreeError: If anything in it is wrong that can be seen without a tree; carries the findings.
    """
    file = _understood(Document.read(path, _EMPTY_HINT))
    raise_findings([file.document])
    return file


def parse_property_file(text: str, path: str = "<text>") -> PropertyFile:
    """Read a file of properties from memory; raises as `read_property_file`."""
    file = _understood(Document(text, path, _EMPTY_HINT))
    raise_findings([file.document])
    return file


def _understood(document: Document) -> PropertyFile:
    parts = document.mapping(document.root, _PARTS, "a file of properties")
    events: list[EventProperty] = []
    ends: list[EndProperty] = []
    if "properties" in parts:
        for name, value in document.entries(parts["properties"], None, "properties"):
            read = _property(document, name, value)
            if isinstance(read, EventProperty):
                events.append(read)
            elif read is not None:
                ends.append(read)
    return PropertyFile(
        document,
        parts.get("end"),
        tuple(events),
        tuple(ends),
        parts.get("facts"),
        parts.get("answers"),
        _parameters(document, parts.get("parameters")),
    )


def _parameters(document: Document, value: Value | None) -> dict[str, Fact]:
    entries = [] if value is None else document.entries(value, None, "parameters")
    read = {key.text or "": document.fact(inner, f"the parameter '{key.text}'") for key, inner in entries}
    return {name: parameter for name, parameter in read.items() if parameter is not None}


def _property(document: Document, name: Value, value: Value) -> EventProperty | EndProperty | None:
    found = document.entries(value, _ALL_KEYS, "a property")
    written = {key.text or "": inner for key, inner in found}
    if not written and value.entries != ():
        return None
    form = next((form for form, shape in _SHAPES.items() if shape.main in written), None)
    if form is None and _AT_END not in written:
        mains = ", ".join([*(shape.main for shape in _SHAPES.values()), _AT_END])
        document.report(
            name, "missing-key", f"'{name.text}' does not say what it demands; it needs one of {mains}"
        )
        return None
    allowed = [_AT_END] if form is None else _SHAPES[form].keys
    for key, _ in found:
        if key.text not in allowed:
            message = f"'{key.text}' does not go with '{allowed[0]}', which has {', '.join(allowed[1:]) or 'nothing else'}"
            document.report(key, "conflicting-keys", message, hint="make two properties of it")
    if form is None:
        return EndProperty(name.text or "", written[_AT_END])
    shape = _SHAPES[form]
    if shape.other and shape.other not in written:
        message = f"'{name.text}' does not say what must come; '{shape.main}' needs '{shape.other}'"
        document.report(name, "missing-key", message)
    main, other, limit = (
        document.listed(written[key]) if key in written else ()
        for key in (shape.main, shape.other, shape.limit)
    )
    return EventProperty(name.text or "", form, main, other, limit, written.get(_WHILE))
