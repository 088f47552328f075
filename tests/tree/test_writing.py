"""Tests of writing tree files: reading a written file returns the same tree."""

import dataclasses

import pytest
import yaml
from hypothesis import given

from sar_compiler.tree.model import TreeFile
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.xml_writer import write_xml, xml_with_tag_per_line
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import scalar, write_yaml
from tests.tree.strategies import VALUES, everything, tree_files

FORMS = {"xml": (write_xml, parse_xml), "yaml": (write_yaml, parse_yaml)}


@pytest.mark.parametrize("form", FORMS)
@given(tree_file=tree_files())
def test_order_and_comments_survive_round_trip(form, tree_file):
    write, parse = FORMS[form]
    text = write(tree_file)
    again = parse(text)
    assert everything(again) == everything(tree_file)
    assert write(again) == text


@given(tree_files())
def test_tree_survives_round_trip_through_other_form(tree_file):
    in_xml = write_xml(tree_file)
    in_yaml = write_yaml(parse_xml(in_xml))
    assert everything(parse_yaml(in_yaml)) == everything(tree_file)
    assert write_xml(parse_yaml(in_yaml)) == in_xml


@given(VALUES)
def test_other_yaml_readers_read_equivalent_scalar(text):
    read = yaml.safe_load(f"a: {scalar(text)}")["a"]
    printed = str(read).lower() if isinstance(read, bool) else str(read)
    assert printed == text


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("DetectSurvivor", "DetectSurvivor"),
        ("ZonesRemaining?", "ZonesRemaining?"),
        ("a := b + 1; c", "a := b + 1; c"),
        ("false", "false"),
        ("3", "3"),
        ("-0.5", "-0.5"),
        ("no", "'no'"),
        ("12:30", "'12:30'"),
        ("1e3", "'1e3'"),
        ("1.50", "'1.50'"),
        ("", "''"),
        ("{@goal}", "'{@goal}'"),
        ("a: b", "'a: b'"),
        ("mode == 'fast'", "mode == 'fast'"),
        ("!ready && mode == 'fast'", "\"!ready && mode == 'fast'\""),
        ("a\tb", '"a\\tb"'),
    ],
)
def test_string_is_quoted_only_if_necessary(text, written):
    assert scalar(text) == written


FORMATTED_XML = """\
<?xml version="1.0" encoding="UTF-8"?>
<!-- A mission. -->

<root BTCPP_format="4">  <!-- beside -->
  <BehaviorTree ID="Main">
    <!--
      First,
        at length.
    -->
    <A code="a &amp;&amp; b &lt; &quot;c&quot;&#10;d"/>  <!-- beside A -->

    <B
        first="a long value that takes its place in the line"
        second="another long value that takes its place in the line"/>
    <C>
      <!-- nothing here -->
    </C>
    <!-- at the end -->
  </BehaviorTree>
  <TreeNodesModel>
    <Action ID="A">
      <input_port name="code">What to do</input_port>
    </Action>
  </TreeNodesModel>
</root>
<!-- behind -->
"""

FORMATTED_YAML = """\
# A mission.

root:  # beside
  BTCPP_format: 4
  children:
    - BehaviorTree:
        ID: Main
        children:
          # First,
          #   at length.
          - A:  # beside A
              code: |-
                a && b < "c"
                d

          - B:
              first: a long value that takes its place in the line
              second: another long value that takes its place in the line
          - C:
              # nothing here
          # at the end
    - TreeNodesModel:
        children:
          - Action:
              ID: A
              children:
                - input_port:
                    name: code
                    $text: What to do
# behind
"""


def test_canonical_forms_convert_into_each_other_exactly():
    assert write_yaml(parse_xml(FORMATTED_XML)) == write_yaml(parse_yaml(FORMATTED_YAML)) == FORMATTED_YAML
    assert write_xml(parse_yaml(FORMATTED_YAML)) == write_xml(parse_xml(FORMATTED_XML)) == FORMATTED_XML


def test_blank_lines_are_collapsed_and_removed_at_element_edges():
    text = "<root>\n\n\n<A/>\n\n\n\n<B/>\n\n</root>"
    assert write_xml(parse_xml(text)).split("\n", 1)[1] == "<root>\n  <A/>\n\n  <B/>\n</root>\n"


def test_comments_beside_attributes_stay_in_yaml():
    text = "root:\n  a: 1  # one\n  # above\n  b: 2\n"
    assert write_yaml(parse_yaml(text)) == text


def test_xml_with_one_tag_per_line_has_countable_lines():
    root = parse_yaml("root: {children: [{A: {x: '1\n\n2', children: [B, C]}}, D]}").root
    lines = xml_with_tag_per_line(root).split("\n")
    assert [line.split(">")[0].split(" ")[0] for line in lines] == ["<root", "<A", "<B", "<C", "<D"]
    assert parse_xml("\n".join(lines)).root == root


def test_line_breaks_within_xml_values_are_kept():
    text = "<root>\n    <A code='a &amp;&amp; b;\n              c \"d\"'/>\n</root>"
    tree_file = parse_xml(text)
    written = write_xml(tree_file)
    assert '  <A code="a &amp;&amp; b;\n              c &quot;d&quot;"/>\n' in written
    assert parse_xml(written).root == tree_file.root
    assert write_xml(parse_xml(written)) == written
    assert 'code: a && b;               c "d"\n' in write_yaml(tree_file)


def test_changed_value_is_written_instead_of_original():
    root = parse_xml('<root a="1\n2"/>').root
    changed = TreeFile(root.source, dataclasses.replace(root, attributes={"a": "3 4"}))
    assert '<root a="3 4"/>' in write_xml(changed)
