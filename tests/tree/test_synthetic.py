"""Elements that stand in no file."""

from sar_compiler.tree.diagnostic import Form, Span
from sar_compiler.tree.model import synthetic_element, synthetic_file
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.xml_writer import write_xml

ELEMENT = synthetic_element("root", {"name": "x"}, [synthetic_element("input_port", text="What.")])


def test_one_that_is_made_says_what_one_that_is_read_says():
    assert (
        parse_xml(
            write_xml(synthetic_file(synthetic_element("root", {"a": "b"}, [synthetic_element("c")])))
        ).root
        == parse_xml('<root a="b"><c/></root>').root
    )


def test_no_part_of_it_has_a_place():
    nowhere = Span(1, 1, 1, 1)
    assert ELEMENT.line == 0
    assert ELEMENT.source.form is Form.XML
    assert ELEMENT.tag_span() == ELEMENT.name_span("name") == ELEMENT.value_span("name") == nowhere
    assert ELEMENT.value_part_span("name", 0, 1) == nowhere
