"""YAML files with the location of every value.

An unquoted scalar is a number, a Boolean (`true`, `false`) or a string. For example, `no` and `12:30` are strings.
"""

from collections.abc import Mapping
from enum import Enum
from pathlib import Path, PurePath
from typing import Any

import yaml

from sar_compiler.documents.located import Document, Value, parse_scalar
from sar_compiler.errors import SarError
from sar_compiler.opener import DOCUMENT, FileKind, read_file
from sar_compiler.tree.content import make_source
from sar_compiler.tree.diagnostic import Diagnostic, Span, TreeError
from sar_compiler.tree.yaml_events import YamlEvents
from sar_compiler.tree.yaml_spans import SPLIT, YamlSpans, split_number


class DataError(SarError):
    """An error about Python data that cannot be written to a file."""


def read_yaml(path: str | Path, kind: FileKind, empty_hint: str) -> Document:
    """Read a YAML file.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        TreeError: As `parse_yaml`.
    """
    content = read_file(path, kind)
    return parse_yaml(content.data, str(path), empty_hint, content.real_path.parent)


def parse_yaml(data: bytes | str, path: str, empty_hint: str, folder: Path | None = None) -> Document:
    """Parse the content of a YAML file.

    Args:
        data: The content.
        path: The path shown in findings.
        empty_hint: The hint for an empty file.
        folder: The folder that contained the file when it was read, with links resolved.

    Raises:
        TreeError: If the content is not YAML, empty or too large, or uses features beyond plain data.
    """
    document = Document(make_source(data, path, YamlSpans(), None, empty_hint, DOCUMENT), folder)
    events = YamlEvents(document.source)
    events.pop()  # start of the stream
    if not isinstance(events.next, yaml.DocumentStartEvent):
        start, message = Span(1, 1, 1, 1), "the file is empty"
        raise TreeError([Diagnostic("empty-file", message, document.source, start, hint=empty_hint)])
    events.pop()
    document.root = _value(events, document)
    events.pop()  # end of the document
    if isinstance(events.next, yaml.DocumentStartEvent):
        mark = _start_offset(events.next)
        message, hint = (
            "a second document begins here, but the file may have only one",
            "move it to a separate file",
        )
        events.report_finding("second-document", message, mark, mark + 3, hint=hint)
    if events.findings:
        raise TreeError(events.findings)
    return document


class _Dumper(yaml.SafeDumper):
    """A YAML dumper that writes enumeration members as names, and repeated values in full instead of as aliases."""

    def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002
        return True


_Dumper.add_multi_representer(Enum, lambda dumper, member: dumper.represent_str(member.name))
_Dumper.add_multi_representer(PurePath, lambda dumper, path: dumper.represent_str(str(path)))
for _type in (set, bytes):
    _Dumper.add_representer(_type, _Dumper.represent_undefined)


def as_yaml(data: Mapping[str, object]) -> str:
    """Return Python data as YAML text."""
    text: str = yaml.dump(dict(data), Dumper=_Dumper, allow_unicode=True, sort_keys=False, width=1000)
    return text


def document_from_data(data: Mapping[str, object], name: str, empty_hint: str) -> Document:
    """Return Python data as the document of an equivalent YAML file.

    Raises:
        DataError: If the data cannot be written to a file.
        TreeError: As `parse_yaml`.
    """
    try:
        text = as_yaml(data)
    except (yaml.representer.RepresenterError, RecursionError) as error:
        what = repr(error.args[1]) if len(error.args) > 1 else "an object that contains itself"
        raise DataError(
            f"{what} cannot be part of the {name}: use strings, numbers, True, False, lists and dictionaries"
        ) from None
    return parse_yaml(text, name, empty_hint)


def _value(events: YamlEvents, document: Document) -> Value:
    document.count_value()
    event: Any = events.pop()
    start, end = _start_offset(event), int(event.end_mark.index)
    if isinstance(event, yaml.SequenceStartEvent):
        items = []
        while not isinstance(events.next, yaml.SequenceEndEvent):
            items.append(_value(events, document))
        return Value.from_items(start, events.pop().end_mark.index, items)
    if isinstance(event, yaml.MappingStartEvent):
        entries: dict[str, tuple[Value, Value]] = {}
        while not isinstance(events.next, yaml.MappingEndEvent):
            key, inner = _value(events, document), _value(events, document)
            split = split_number(document.source.text, key.start, key.end) if inner.is_nothing else None
            if split is not None:
                number = Value(split.start, key.end, split.written, text=split.written)
                message = SPLIT.format(split.written)
                document.report("wrong-value", message, number, suggestion=split.meant, hint=split.hint)
            elif not key.text:
                document.report("wrong-shape", f"a key must be a string, but is {key.kind}", key)
            elif key.text in entries:
                document.report("duplicate-key", f"the key '{key.text}' is given twice in this mapping", key)
            else:
                entries[key.text] = (key, inner)
        return Value.from_entries(start, events.pop().end_mark.index, entries.values())
    if isinstance(event, yaml.AliasEvent):  # already reported
        return Value(start, end, None, text="")
    return Value(start, end, event.value if event.style else parse_scalar(event.value), text=event.value)


def _start_offset(event: Any) -> int:
    return int(event.start_mark.index)
