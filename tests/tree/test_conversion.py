"""Tests of the conversion between XML and YAML: the tree stays the same, and every loss is reported."""

import pytest

from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form, Severity, TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from tests.tree.strategies import everything


def losses(tree_file, form):
    return [(one.code, one.span.line, one.severity) for one in convert(tree_file, form).losses]


def test_both_forms_of_shipped_tree_have_same_content_and_comments():
    in_xml = read_tree_file("trees/search_and_rescue.xml")
    in_yaml = read_tree_file("trees/search_and_rescue.yaml")
    assert everything(in_yaml) == everything(in_xml)


@pytest.mark.parametrize("name", ["trees/search_and_rescue.xml", "trees/search_and_rescue.yaml"])
def test_shipped_trees_survive_round_trip_through_other_form(name):
    tree_file = read_tree_file(name)
    own = tree_file.source.form
    other, parse = (Form.YAML, parse_yaml) if own is Form.XML else (Form.XML, parse_xml)
    assert convert(parse(convert(tree_file, other).text), own).text == tree_file.source.text


def test_editor_schema_hints_are_omitted_and_reported():
    in_xml = parse_xml('<root\n xmlns:xsi="x"\n xsi:noNamespaceSchemaLocation="y" BTCPP_format="4"/>')
    assert losses(in_xml, Form.YAML) == [("left-out", 2, Severity.INFO), ("left-out", 3, Severity.INFO)]
    assert convert(in_xml, Form.YAML).text == "root:\n  BTCPP_format: 4\n"
    in_yaml = parse_yaml("# yaml-language-server: $schema=x\n# A mission.\nroot\n")
    assert losses(in_yaml, Form.XML) == [("left-out", 3, Severity.INFO)]
    assert convert(in_yaml, Form.XML).text.split("\n")[1:] == ["<!-- A mission. -->", "<root/>", ""]


def test_trailing_yaml_comment_is_moved_for_xml_and_reported():
    tree_file = parse_yaml("root:\n  a: 1  # why\n")
    assert losses(tree_file, Form.XML) == [("moved", 2, Severity.INFO)]
    assert "<!-- why -->\n<root" in convert(tree_file, Form.XML).text


def test_double_hyphens_in_comment_are_split_for_xml_and_reported():
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
def test_content_outside_tree_is_rejected_before_conversion(text, form, code, place):
    with pytest.raises(TreeError) as caught:
        convert(parse_xml(text), form)
    assert [(one.code, (one.span.line, one.span.column)) for one in caught.value.findings] == [(code, place)]


def test_port_description_is_not_stray_text():
    text = '<root><TreeNodesModel><Action ID="A"><input_port name="x">Where</input_port></Action></TreeNodesModel></root>'
    assert "$text: Where" in convert(parse_xml(text), Form.YAML).text


def test_attribute_named_children_cannot_be_written_in_yaml():
    with pytest.raises(TreeError, match=r"1:7: error\[not-in-yaml\]"):
        convert(parse_xml('<root children="3"/>'), Form.YAML)
    assert convert(parse_xml('<root children="3"/>'), Form.XML).text.endswith('<root children="3"/>\n')
