"""Tests of elements that are in no file."""

from sar_compiler.tree.diagnostic import Form, Span
from sar_compiler.tree.model import synthetic_element, synthetic_file
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.xml_writer import write_xml

ELEMENT = synthetic_element("root", {"name": "x"}, [synthetic_element("input_port", text="What.")])


def test_constructed_element_equals_parsed_element():
    assert (
        parse_xml(
            write_xml(synthetic_file(synthetic_element("root", {"a": "b"}, [synthetic_element("c")])))
        ).root
        == parse_xml('<root a="b"><c/></root>').root
    )


def test_constructed_element_has_no_location():
    nowhere = Span(1, 1, 1, 1)
    assert ELEMENT.line == 0
    assert ELEMENT.source.form is Form.XML
    assert ELEMENT.tag_span() == ELEMENT.name_span("name") == ELEMENT.value_span("name") == nowhere
    assert ELEMENT.value_part_span("name", 0, 1) == nowhere
