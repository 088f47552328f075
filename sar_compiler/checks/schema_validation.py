"""Validation against the XML schema that is generated from the registry for editors and other tools.

The rules report the same errors with better messages, columns and suggestions. Therefore, the schema's errors are used
only for elements about which no rule has a finding.
"""

import bisect
import dataclasses
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from operator import attrgetter
from weakref import WeakKeyDictionary

from lxml import etree

from sar_compiler.nodes.binding.attributes import CONDITIONS
from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.schemas.xml_schema import xml_schema
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity
from sar_compiler.tree.model import INCLUDE_TAG, ROOT_TAG, TREE_TAG, Element, TreeFile
from sar_compiler.tree.xml_recovery import readable

_TEXT = "Character content other than whitespace"
"""libxml2's message about text between elements."""
_MALFORMED = "not well-formed XML: "
_DECLARATION = re.compile(r"^<\?xml\s[^>]*\?>")
_IGNORED = re.compile(
    rf"Element '({ROOT_TAG}|{INCLUDE_TAG}|{TREE_TAG})', attribute '.*': The attribute '.*' is not allowed"
)
"""libxml2's message about attributes that BehaviorTree.CPP ignores. The rules report these attributes."""
_SUFFICIENT = ("unknown-element", "wrong-format", "unknown-attribute", "ignored-attribute")
"""The kinds of findings that replace the schema's error about the same element, even as warnings."""


_MOST_SCHEMAS = 32
"""The maximum number of schemas that are cached for each registry. Files with the same tags share a schema."""
_schemas: "WeakKeyDictionary[Registry, dict[tuple[frozenset[str], ...], etree.XMLSchema]]" = (
    WeakKeyDictionary()
)


def _schema_of(registry: Registry, tags: frozenset[str], notes: frozenset[str]) -> etree.XMLSchema:
    cached = _schemas.setdefault(registry, {})
    if (tags, notes) not in cached:
        if len(cached) == _MOST_SCHEMAS:
            del cached[next(iter(cached))]
        cached[tags, notes] = _schema(registry, tags, notes, ())
    return cached[tags, notes]


def _schema(
    registry: Registry, tags: frozenset[str], notes: frozenset[str], described: Iterable[NodeSpec]
) -> etree.XMLSchema:
    """Generate the part of the schema that files with the given tags need, because the whole takes too long."""
    return etree.XMLSchema(etree.fromstring(xml_schema(registry, described, tags, sorted(notes)).encode()))


def schema_errors(
    tree_file: TreeFile,
    registry: Registry,
    described: Sequence[NodeSpec] = (),
) -> list[tuple[int, str]]:
    """Return lxml's errors about a file as pairs of line number and message.

    Each line number is that of the line in which a start tag ends. libxml2 reports no columns, and does not check the
    siblings that follow an unexpected element.

    Args:
        tree_file: The file.
        registry: The registered nodes.
        described: Nodes that only a model describes.
    """
    elements = list(tree_file.root.iterate())
    tags, notes = frozenset({element.tag for element in elements}), _editor_attributes(elements)
    schema = _schema(registry, tags, notes, described) if described else _schema_of(registry, tags, notes)
    text, lines = _as_xml(tree_file)
    return [(lines[line - 1], message) for line, message in _schema_errors_in(text, schema)]


def _schema_errors_in(text: str, schema: etree.XMLSchema) -> list[tuple[int, str]]:
    """Validate an XML text against a schema, and return the errors as pairs of line number and message."""
    parser = etree.XMLParser(
        encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False, remove_blank_text=True
    )
    try:
        document = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:  # an error that expat accepts, such as an unbound prefix
        return [(error.lineno or 1, f"{_MALFORMED}{error.msg}")]
    if schema.validate(document):
        return []
    return [(error.line, error.message) for error in schema.error_log.filter_from_errors()]


def _editor_attributes(elements: Iterable[Element]) -> frozenset[str]:
    """Return the names of attributes that may belong to an editor, because they begin with `_`."""
    names = set().union(*(element.attributes for element in elements)).difference(CONDITIONS)
    return frozenset(name for name in names if name.startswith("_") and ":" not in name)


def _as_xml(tree_file: TreeFile) -> tuple[str, Sequence[int]]:
    """Return a file as XML, together with the original line number of each XML line."""
    if tree_file.source.form is not Form.XML:
        from sar_compiler.tree.xml_writer import xml_with_tag_per_line

        return xml_with_tag_per_line(tree_file.root), [element.line for element in tree_file.root.iterate()]
    # Unlike expat, libxml2 does not treat a lone carriage return as the end of a line.
    text = readable(tree_file)
    if "\r" in text:
        text = re.sub(r"\r\n?", "\n", text)
    # libxml2 refuses the declaration of another XML version, which expat accepts.
    text = _DECLARATION.sub(lambda match: "\n" * match[0].count("\n"), text)
    return text, range(1, text.count("\n") + 2)


def check_schema(
    tree_file: TreeFile,
    registry: Registry,
    described: Sequence[NodeSpec],
    findings: Iterable[Diagnostic],
) -> Iterator[Diagnostic]:
    """Yield the schema's errors for the elements about which no rule reported a finding.

    Args:
        tree_file: The file.
        registry: The registered nodes.
        described: Nodes that only a model describes.
        findings: The rules' findings.
    """
    errors = [
        (line, message)
        for line, message in schema_errors(tree_file, registry, described)
        if not _IGNORED.match(message)
    ]
    if not errors:
        return
    if tree_file.source.form is Form.XML and any(_TEXT in message for _, message in errors):
        yield from _stray_text(tree_file)
        errors = [(line, message) for line, message in errors if _TEXT not in message]
    reported_lines = sorted(
        finding.span.line
        for finding in findings
        if finding.source is tree_file.source
        and (finding.severity is Severity.ERROR or finding.code in _SUFFICIENT)
    )
    elements = [*tree_file.root.iterate()]
    if tree_file.source.form is not Form.XML:  # children may precede attributes
        elements.sort(key=attrgetter("position"))
    for line, message in errors:
        # The last element that starts in or before the line.
        index = max(0, bisect.bisect_left(elements, (line + 1, 0), key=attrgetter("position")) - 1)
        element, last = elements[index], line
        if tree_file.source.form is not Form.XML:
            # The element's attributes are on lines of their own, up to the next element.
            last = elements[index + 1].line - 1 if index + 1 < len(elements) else sys.maxsize
        following = bisect.bisect_left(reported_lines, element.line)
        if following == len(reported_lines) or reported_lines[following] > last:
            yield element.finding("schema", message)


def _stray_text(tree_file: TreeFile) -> Iterator[Diagnostic]:
    """Yield findings about text between elements, with the location that libxml2 does not report."""
    from sar_compiler.tree.conversion import ignored_content

    message = "text between elements is ignored"
    for finding in ignored_content(tree_file):
        if finding.code == "stray-text":
            yield dataclasses.replace(finding, message=message)
