"""Tests of locations within attribute values, which findings in scripts use."""

import pytest
from hypothesis import given

from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.xml_writer import write_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import write_yaml
from tests.tree.strategies import tree_files


def cut(element, name, part):
    """Return the file's text at the location of a part of a value."""
    start = element.attributes[name].index(part)
    source, span = element.source, element.value_part_span(name, start, start + len(part))
    return source.text[source.offset(span.line, span.column) : source.offset(span.end_line, span.end_column)]


@pytest.mark.parametrize(
    ("written", "part", "place"),
    [
        ('"a == b"', "==", "=="),
        ('"a &amp;&amp; b > c"', "b", "b"),
        ('"a &amp;&amp; b"', "&&", "&amp;&amp;"),
        ("'&#x1F600;&#62; x'", "x", "x"),
        ('"a;\n   b"', "b", "b"),
        ('"a;\r\nb"', "b", "b"),
    ],
)
def test_xml_reference_or_line_end_counts_as_one_character(written, part, place):
    assert cut(parse_xml(f"<root code={written}/>").root, "code", part) == place


@pytest.mark.parametrize(
    ("written", "part", "place"),
    [
        ("a == b", "==", "=="),
        ("'a == ''x'' && b'", "b", "b"),
        ("'a == ''x'' && b'", "'x'", "''x''"),
        (r'"a\t\u00e9 b"', "b", "b"),
        (r'"a\t\u00e9 b"', "é", r"\u00e9"),
        ('"a \\\n    b"', "b", "b"),
        ("one\n    two", "two", "two"),
        ("'one\n\n    two'", "two", "two"),
        ("|\n    a := 1\n      b\n    c\n", "b", "b"),
        ("|\n    a := 1\n      b\n    c\n", "c", "c"),
        ("|2-\n      a\n    b", "b", "b"),
        (">\n    one\n    two\n\n    three\n", "two", "two"),
        (">\n    one\n    two\n\n    three\n", "three", "three"),
    ],
)
def test_yaml_quotes_escapes_and_folds_are_skipped(written, part, place):
    assert cut(parse_yaml(f"root:\n  code: {written}\n").root, "code", part) == place


@pytest.mark.parametrize(("write", "parse"), [(write_xml, parse_xml), (write_yaml, parse_yaml)])
@given(tree_file=tree_files())
def test_part_location_is_within_its_value(write, parse, tree_file):
    for element in parse(write(tree_file)).root.iterate():
        for name, value in element.attributes.items():
            whole = element.value_span(name)
            for start in range(len(value) + 1):
                part = element.value_part_span(name, start, len(value))
                assert (whole.line, whole.column) <= (part.line, part.column)
                assert (part.line, part.column) <= (part.end_line, part.end_column)
                assert (part.end_line, part.end_column) <= (whole.end_line, whole.end_column)
