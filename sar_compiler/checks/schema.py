"""Validation against the XML schema that the registry generates.

The schema is what editors complete with and what other tools validate with. Everything it can refuse
the rules beside it say better, with a column and a suggestion; so its findings count only for elements
of which the rules said nothing.
"""

import bisect
import functools
import re
from collections.abc import Iterable, Iterator

from lxml import etree

from sar_compiler.nodes.registry import Registry
from sar_compiler.nodes.schema import xml_schema
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import Element, TreeFile


@functools.lru_cache(maxsize=8)
def _schema_of(registry: Registry) -> etree.XMLSchema:
    return etree.XMLSchema(etree.fromstring(xml_schema(registry).encode()))


def schema_errors(tree_file: TreeFile, registry: Registry) -> list[tuple[int, str]]:
    """Return what lxml says about a file: pairs of line and message.

    The line is that in which a start tag ends; libxml2 knows no columns, and goes on behind an
    unexpected element without looking at its siblings.
    """
    parser = etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False)
    # libxml2 does not count a lone carriage return as the end of a line, expat does.
    text = re.sub(r"\r\n?", "\n", tree_file.source.text)
    try:
        document = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:  # what expat lets pass, such as a prefix that is not bound
        return [(error.lineno or 1, f"not well-formed XML: {error.msg}")]
    schema = _schema_of(registry)
    if schema.validate(document):
        return []
    # The log grows over the life of the schema object; the last validation's errors are those of now.
    return [(error.line, error.message) for error in schema.error_log.filter_from_errors()]


def check_schema(
    tree_file: TreeFile, registry: Registry, findings: Iterable[Diagnostic]
) -> Iterator[Diagnostic]:
    """Yield what the schema refuses in places where the rules found nothing.

    Args:
        tree_file: The file.
        registry: What tags mean.
        findings: What the rules found.
    """
    errors = schema_errors(tree_file, registry)
    if not errors:
        return
    spoken_of = {finding.span.line for finding in findings}
    elements = sorted(tree_file.root.iterate(), key=_place)
    for line, message in errors:
        # The last element that begins in the line or before it.
        element = elements[max(0, bisect.bisect_left(elements, (line + 1, 0), key=_place) - 1)]
        if not any(number in spoken_of for number in range(element.line, line + 1)):
            yield Diagnostic("schema", message, tree_file.source, element.tag_span())


def _place(element: Element) -> tuple[int, int]:
    return element.line, element.column
