"""Files of properties: what must hold in every run of a tree, in YAML."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sar_compiler.checks.typed_values import parameters
from sar_compiler.checks.verify.monitors import PropertyPattern
from sar_compiler.documents.located import Document, Value
from sar_compiler.documents.yaml_files import parse_yaml, read_yaml
from sar_compiler.runtime.answers import Fact

_EMPTY_HINT = "write properties: and below it a name, and below that never: LEAF ANSWER"
# The keys of the events that a property is about, of those that must come, and of those that bound it.
_KEYS: Mapping[PropertyPattern, tuple[str, str, str]] = {
    PropertyPattern.AFTER: ("after", "eventually", "before"),
    PropertyPattern.NEVER: ("never", "", ""),
    PropertyPattern.AT_MOST_ONCE: ("at_most_once", "", "per"),
    # Last, because what comes after something may have to come before something else.
    PropertyPattern.BEFORE: ("before", "comes", "since"),
}


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
class PropertyFile:
    """The content of a file of properties.

    Attributes:
        document: The file, with its findings.
        end: When a run is over; None for when the root has succeeded or failed.
        events: The properties that speak of events.
        ends: What must hold at the end of a run, by the names of these properties.
        facts: What it says of facts.
        answers: What it says of what leaves answer.
        parameters: The keys of the root blackboard.
        controls: What it says of controls and decorators that only a model describes.
    """

    document: Document
    end: Value | None = None
    events: tuple[EventProperty, ...] = ()
    ends: Mapping[str, Value] = field(default_factory=dict)
    facts: Value | None = None
    answers: Value | None = None
    parameters: Mapping[str, Fact] = field(default_factory=dict)
    controls: Value | None = None


def read_property_file(path: str | Path) -> PropertyFile:
    """Read a file of properties.

    What is wrong with it is noted in its document, and raised by `verify` with what only a tree shows.

    Raises:
        UnreadableFileError: If it is not there or cannot be read.
        TreeError: If nothing of it can be used; carries the findings.
    """
    return _understood(read_yaml(path, _EMPTY_HINT))


def parse_property_file(text: str, path: str = "<text>") -> PropertyFile:
    """Read a file of properties from memory; raises as `read_property_file`."""
    return _understood(parse_yaml(text, path, _EMPTY_HINT))


def _understood(document: Document) -> PropertyFile:
    parts = document.validate("properties").mapping
    written = parts["properties"].mapping if "properties" in parts else {}
    return PropertyFile(
        document,
        parts.get("end"),
        tuple(_events(name, value.mapping) for name, value in written.items() if "at_end" not in value.data),
        {name: value.mapping["at_end"] for name, value in written.items() if "at_end" in value.data},
        parts.get("facts"),
        parts.get("answers"),
        parameters(parts.get("parameters")),
        parts.get("controls"),
    )


def _events(name: str, parts: Mapping[str, Value]) -> EventProperty:
    form = next(form for form, keys in _KEYS.items() if keys[0] in parts)
    main, other, limit = (parts[key].listed if key in parts else () for key in _KEYS[form])
    return EventProperty(name, form, main, other, limit, parts.get("while"))
