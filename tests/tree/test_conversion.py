"""From one form to the other: the same tree, and nothing lost unsaid."""

import pytest

from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form, Severity, TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from tests.tree.strategies import everything


def losses(tree_file, form):
    return [(one.code, one.span.line, one.severity) for one in convert(tree_file, form).losses]


def test_both_forms_of_the_shipped_tree_say_the_same_in_the_same_order_with_the_same_comments():
    in_xml = read_tree_file("trees/search_and_rescue.xml")
    in_yaml = read_tree_file("trees/search_and_rescue.yaml")
    assert everything(in_yaml) == everything(in_xml)


@pytest.mark.parametrize("name", ["trees/search_and_rescue.xml", "trees/search_and_rescue.yaml"])
def test_shipped_trees_come_back_to_the_letter_from_the_other_form(name):
    tree_file = read_tree_file(name)
    own = tree_file.source.form
    other, parse = (Form.YAML, parse_yaml) if own is Form.XML else (Form.XML, parse_xml)
    assert convert(parse(convert(tree_file, other).text), own).text == tree_file.source.text


def test_what_tells_an_editor_about_the_form_is_left_out_and_said():
    in_xml = parse_xml('<root\n xmlns:xsi="x"\n xsi:noNamespaceSchemaLocation="y" BTCPP_format="4"/>')
    assert losses(in_xml, Form.YAML) == [("left-out", 2, Severity.INFO), ("left-out", 3, Severity.INFO)]
    assert convert(in_xml, Form.YAML).text == "root:\n  BTCPP_format: 4\n"
    in_yaml = parse_yaml("# yaml-language-server: $schema=x\n# A mission.\nroot\n")
    assert losses(in_yaml, Form.XML) == [("left-out", 3, Severity.INFO)]
    assert convert(in_yaml, Form.XML).text.split("\n")[1:] == ["<!-- A mission. -->", "<root/>", ""]


def test_a_comment_that_xml_cannot_have_in_its_place_is_moved_and_said():
    tree_file = parse_yaml("root:\n  a: 1  # why\n")
    assert losses(tree_file, Form.XML) == [("moved", 2, Severity.INFO)]
    assert "<!-- why -->\n<root" in convert(tree_file, Form.XML).text


def test_two_hyphens_in_a_comment_are_parted_for_xml_and_said():
    tree_file = parse_yaml("# a -- b --- c-\nroot\n")
    assert losses(tree_file, Form.XML) == [("changed", 2, Severity.INFO)]
    converted = convert(tree_file, Form.XML).text
    assert "<!-- a - - b - - - c- -->" in converted
    assert parse_xml(converted).comments[0].text == "a - - b - - - c-"


@pytest.mark.parametrize("form", Form)
@pytest.mark.parametrize(
    ("text", "code", "place"),
    [
        ("<root>\n  <A/> text\n</root>", "stray-text", (2, 8)),
        ("<root>\n  <A><![CDATA[text]]></A>\n</root>", "stray-text", (2, 15)),
        ("// text\n<root/>", "stray-text", (1, 1)),
        ("<?xml-model href='x'?>\n<root/>", "processing-instruction", (1, 1)),
    ],
)
def test_what_is_no_part_of_a_tree_is_refused_before_it_is_lost(text, form, code, place):
    with pytest.raises(TreeError) as caught:
        convert(parse_xml(text), form)
    assert [(one.code, (one.span.line, one.span.column)) for one in caught.value.findings] == [(code, place)]


def test_the_text_of_a_port_is_no_stray_text():
    text = '<root><TreeNodesModel><Action ID="A"><input_port name="x">Where</input_port></Action></TreeNodesModel></root>'
    assert "$text: Where" in convert(parse_xml(text), Form.YAML).text


def test_an_attribute_called_children_cannot_be_written_in_yaml():
    with pytest.raises(TreeError, match=r"1:7: error\[not-in-yaml\]"):
        convert(parse_xml('<root children="3"/>'), Form.YAML)
    assert convert(parse_xml('<root children="3"/>'), Form.XML).text.endswith('<root children="3"/>\n')
