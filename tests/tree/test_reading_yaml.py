"""Tests of the YAML reader: it returns the same elements as from XML, or reports all findings."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.opener import TREE, UnreadableFileError
from sar_compiler.tree import yaml_events
from sar_compiler.tree.content import MAX_DEPTH
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.model import UnfinishedFileError
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import write_yaml
from tests.tree.strategies import tree_files


@pytest.fixture(params=["libyaml", "PyYAML alone"], autouse=True)
def _each_parser(request, monkeypatch):
    if request.param == "PyYAML alone":
        monkeypatch.setattr(yaml_events, "_LOADER", yaml.SafeLoader)


def findings_of(text):
    """Return the code, line and column of each finding in a file."""
    with pytest.raises(TreeError) as caught:
        parse_yaml(text, "test.yaml")
    return [(one.code, one.span.line, one.span.column) for one in caught.value.findings]


def message_of(text):
    with pytest.raises(TreeError) as caught:
        parse_yaml(text, "test.yaml")
    return str(caught.value)


def cut(root, span):
    source = root.source
    return source.text[source.offset(span.line, span.column) : source.offset(span.end_line, span.end_column)]


def test_node_is_mapping_of_tag_to_attributes_and_children():
    text = "root:\n  BTCPP_format: 4\n  children:\n    - BehaviorTree:\n        ID: Main\n        children:\n          - Success\n"
    in_xml = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Success/></BehaviorTree></root>'
    assert parse_yaml(text).root == parse_xml(in_xml).root


@pytest.mark.parametrize("node", ["A", "A:", "A: {}", "{A: }", "'A'", "? A"])
def test_empty_node_is_tag_with_or_without_colon(node):
    assert parse_yaml(f"root:\n  children:\n    - {node}\n").root == parse_xml("<root><A/></root>").root


def test_flow_lists_and_mappings_are_read():
    root = parse_yaml("{root: {a: 1, children: [A, {B: {x: 'y z'}}]}}").root
    assert root == parse_xml('<root a="1"><A/><B x="y z"/></root>').root


def test_empty_children_list_is_no_children():
    assert parse_yaml("root: {children: []}").root.children == ()


@pytest.mark.parametrize(
    "text",
    [
        "no",
        "Yes",
        "on",
        "true",
        "12:30",
        "1e3",
        "0x10",
        "010",
        "1_000",
        "~",
        "null",
        ".inf",
        "2001-01-01",
        "=",
        "<<",
    ],
)
def test_plain_values_are_strings(text):
    assert parse_yaml(f"root:\n  a: {text}\n").root.attributes == {"a": text}


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("'it''s'", "it's"),
        (r'"a\tb\u00e9"', "a\tbé"),
        ("'{key}'", "{key}"),
        ("''", ""),
        ("a := 1; b == 'x' && !c", "a := 1; b == 'x' && !c"),
        ("|\n    a := 1\n      b\n", "a := 1\n  b\n"),
        ("|-\n    a\n", "a"),
        (">-\n    one\n    two\n\n    three\n", "one two\nthree"),
        ("one\n    two", "one two"),
    ],
)
def test_quotes_and_blocks_follow_yaml_rules(written, value):
    assert parse_yaml(f"root:\n  a: {written}\n").root.attributes == {"a": value}


def test_tags_names_and_values_have_locations():
    text = "root:\n  first:   plain text  # c\n  'second': \"in quotes\"\n  third: |\n    a := 1\n    b\n  children:\n    - Ä: {ß: é}\n"
    root = parse_yaml(text).root
    assert (root.line, root.column, cut(root, root.tag_span())) == (1, 1, "root")
    assert [cut(root, root.name_span(name)) for name in root.attributes] == ["first", "second", "third"]
    values = [cut(root, root.value_span(name)) for name in root.attributes]
    assert values == ["plain text", "in quotes", "a := 1\n    b"]
    child = root.children[0]
    assert (child.line, child.column, cut(child, child.value_span("ß"))) == (8, 7, "é")


def test_locations_are_right_with_any_line_end():
    root = parse_yaml("root:\r\n  a: 1\r\n  children:\r\n  - B: {x: 😀y}\r").root
    child = root.children[0]
    assert (child.line, child.column, cut(child, child.value_span("x"))) == (4, 5, "😀y")


def test_missing_attribute_is_located_at_tag():
    root = parse_yaml("root").root
    assert root.name_span("a") == root.value_span("a") == root.value_part_span("a", 0, 1) == root.tag_span()


SURPRISES = {
    "duplicate-key": ("root:\n  a: 1\n  a: 2\n", 3, 3, "first on line 2"),
    "yaml-anchor": ("root:\n  a: &x 1\n", 2, 6, "'&x' is a YAML anchor"),
    "yaml-tag": ("root:\n  a: !ready x\n", 2, 6, "string that begins with ! in quotes"),
    "yaml-merge": ("root:\n  <<: {a: 1}\n", 2, 3, "write out the attributes"),
    "yaml-directive": ("%YAML 1.1\n---\nroot\n", 1, 1, "begin with %"),
    "second-document": ("root\n---\nroot\n", 2, 1, "a tree file has only one"),
    "missing-value": ("root:\n  name:\n", 2, 3, "write name: '' for an empty string"),
    "wrong-character": ('root:\n  a: "\\0"\n', 2, 6, "U\\+0000"),
    "wrong-name": ("root:\n  a b: 1\n", 2, 3, "'a b' cannot be the name of an attribute"),
    "empty-file": ("# nothing\n", 1, 1, "the file is empty"),
}


@pytest.mark.parametrize("code", SURPRISES)
def test_yaml_only_feature_is_reported_at_its_location(code):
    text, line, column, words = SURPRISES[code]
    assert findings_of(text) == [(code, line, column)]
    with pytest.raises(TreeError, match=words):
        parse_yaml(text)


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("- A\n", (1, 1), "a tree file begins with 'root:', but this is a list"),
        ("root:\n  - A\n", (2, 3), "put a list of nodes under 'children:'"),
        ("- root:\n", (1, 1), "delete the '- ' before 'root:'"),
        ("root: text\n", (1, 7), "the content of 'root' must be attributes"),
        ("root:\n  children:\n  - A: B\n", (3, 8), "write a child node below 'children:', as '- B'"),
        ("root:\n  children:\n  - A: [B]\n", (3, 8), "put a list of nodes under 'children:'"),
        ("root:\n  children:\n    A:\n", (2, 3), "begin each node with '- '"),
        ("root:\n  children:\n  - - A\n", (3, 5), "write the node's tag, and put a list of nodes under its"),
        ("root:\n  a: 1\nb: 2\n", (3, 1), "a tree file has one top-level key, but 'b' is beside 'root'"),
        ("root:\n  a: [1]\n", (2, 3), "must be a string, but is a list"),
        ("root:\n  a: {goal}\n", (2, 6), "did you mean \"'{goal}'\"?"),
        ("root:\n  a: {b: c}\n", (2, 3), "must be a string, but is a mapping"),
        ("root:\n  Sleep:\n    msec: 1\n", (2, 3), "write nodes under 'children:', or put"),
        ("root:\n  children: A\n", (2, 3), "'children' must be a list of nodes"),
        ("root:\n  children:\n", (2, 3), "write the nodes, or delete the line"),
        ("root:\n  children:\n  - [A]\n", (3, 5), "a node is expected, but this is a list"),
        ("root:\n  children:\n  -\n", (3, 3), "there is nothing after this '-'"),
        ("root:\n  children:\n  - {}\n", (3, 5), "these braces are empty"),
        ("root:\n  children:\n  - A:\n    x: 1\n", (4, 5), "'x' is beside 'A', not below it"),
        ("root:\n  ? [a]\n  : b\n", (2, 5), "a key must be a name"),
        ("root:\n  $text: a\n", (2, 3), "only in the ports of a TreeNodesModel"),
    ],
)
def test_wrong_shape_is_reported_with_right_one(text, place, words):
    assert findings_of(text) == [("wrong-shape", *place)]
    assert words in message_of(text)


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("root:\n\ta: 1\n", (2, 1), "indent with spaces"),
        ("root:\n  a: b: c\n", (2, 7), "put a string that contains ': ' in quotes"),
        ("root:\n  a: @x\n", (2, 6), "a string cannot begin with @"),
        ("root:\n  a: 'x\n", (2, 6), "the part that begins here has no end"),
        ("root:\n  a: 1\n b: 2\n", (3, 2), "this does not belong to the lines above it"),
        ("root:\n  a: [x\nb: c", (2, 6), "is malformed"),
        ('root:\n  a: "x" y\n', (2, 10), "quote the whole string"),
        ("root:\n  a: - b\n", (2, 6), "put a string that begins with '- ' in quotes"),
        ("root\n...\nx: y\n...\n", (3, 1), "continues after the end"),
        ("root: {, }\n", (1, 8), "something is missing here"),
        ("root:\n  children:\n  - A\n  B\n", (4, 3), "begin a node with '- '"),
        ("root:\n  children:\n  - A\n  B\n  - C\n", (4, 3), "begin a node with '- '"),
    ],
)
def test_malformed_yaml_is_reported_with_cause(text, place, words):
    assert findings_of(text)[-1] == ("malformed-yaml", *place)
    assert words in message_of(text)


def test_all_findings_are_reported_in_file_order():
    text = "root:\n  name:\n  children:\n    - A: {x: 1, x: 2}\n    - B: {y: {goal}}\n    - [C]\n  z: *a\n"
    codes = [code for code, *_ in findings_of(text)]
    assert codes == ["missing-value", "duplicate-key", "wrong-shape", "wrong-shape", "yaml-anchor"]


def test_forbidden_character_is_named():
    assert findings_of("root: {a: 'x\x07'}") == [("wrong-character", 1, 13)]
    assert "U+2028" in message_of("root: {a: x\u2028}")


def test_nesting_depth_is_limited():
    parse_yaml("{root: {children: [" + "{A: {children: [" * (MAX_DEPTH - 1) + "]}}" * (MAX_DEPTH - 1) + "]}}")
    deep = "{root: {children: [" + "{A: {children: [" * MAX_DEPTH + "]}}" * MAX_DEPTH + "]}}"
    assert [code for code, *_ in findings_of(deep)] == ["too-deep"]


@pytest.mark.unmeasured
@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
def test_deep_nesting_of_brackets_is_rejected(opening):
    assert findings_of(opening * 50_000)[-1][0] == "too-deep"


def test_file_over_size_limit_is_rejected_without_parsing(tmp_path):
    path = tmp_path / "large.yaml"
    with path.open("wb") as stream:
        stream.truncate(TREE.limit + 1)
    with pytest.raises(TreeError, match="larger than"):
        read_tree_file(path)


def test_missing_file_raises_error_with_reason(tmp_path):
    with pytest.raises(UnreadableFileError, match=r"nowhere\.yaml: No such file"):
        read_tree_file(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_byte_order_mark_selects_encoding(encoding):
    assert parse_yaml("root: {name: é}".encode(encoding)).root.attributes == {"name": "é"}


def test_port_description_is_its_text():
    text = "root:\n  children:\n  - TreeNodesModel:\n      children:\n      - Action:\n          ID: A\n          children:\n          - input_port: {name: x, $text: Where to go}\n"
    in_xml = '<root><TreeNodesModel><Action ID="A"><input_port name="x">Where to go</input_port></Action></TreeNodesModel></root>'
    assert parse_yaml(text).root == parse_xml(in_xml).root


COMMENTED = """\
# Before the root,
# in two lines.

root:  # beside the root
  BTCPP_format: 4  # beside an attribute
  # above an attribute
  name: x
  # before A
  children:
    # also before A
    - A  # beside A

    - B:  # beside B
        code: |  # beside code
          a # b
        # in B
    # behind B
# behind the root
"""


def test_comments_are_kept_with_adjacent_parts():
    tree_file = parse_yaml(COMMENTED)
    assert [(one.text, one.index) for one in tree_file.comments] == [
        ("Before the root,\nin two lines.", 0),
        ("behind the root", 1),
    ]
    root = tree_file.root
    assert [(one.text, one.index, one.attribute, one.trailing) for one in root.comments] == [
        ("beside the root", 0, None, True),
        ("beside an attribute", 0, "BTCPP_format", True),
        ("above an attribute", 0, "name", False),
        ("before A", 0, None, False),
        ("also before A", 0, None, False),
        ("behind B", 2, None, False),
    ]
    first, second = root.children
    assert [(one.text, one.trailing) for one in first.comments] == [("beside A", True)]
    assert second.attributes == {"code": "a # b\n"}
    assert [(one.text, one.attribute, one.trailing) for one in second.comments] == [
        ("beside B", None, True),
        ("beside code", "code", True),
        ("in B", None, False),
    ]


def test_number_sign_within_string_is_not_comment():
    root = parse_yaml("root: {a: x#y, b: 'x # y', c: \"# z\"}").root
    assert (root.attributes, root.comments) == ({"a": "x#y", "b": "x # y", "c": "# z"}, ())


@given(tree_files())
def test_every_span_covers_its_part(tree_file):
    for element in parse_yaml(write_yaml(tree_file)).root.iterate():
        assert cut(element, element.tag_span()) == element.tag
        for name in element.attributes:
            assert cut(element, element.name_span(name)) == name


@given(
    st.binary(max_size=200)
    | st.text(max_size=200)
    | st.text(st.sampled_from(list("ab:-?#'\"{}[],|>&*!\n \t")), max_size=60)
)
def test_arbitrary_input_is_parsed_or_rejected(data):
    try:
        parse_yaml(data)
    except TreeError as error:
        assert error.findings  # noqa: PT017 - either outcome is right


def test_missing_root_is_reported_once_and_file_is_read():
    text = "BTCPP_format: 4\nmain_tree_to_execute: A\nchildren:\n- BehaviorTree: {ID: A, children: [B]}\n"
    assert findings_of(text) == [("wrong-root", 1, 1)]
    assert "write 'root:' above, and indent the following lines" in message_of(text)
    assert [each.tag for each in beginning_of(text).tree_file.root.iterate()] == ["root", "BehaviorTree", "B"]


def test_each_alias_is_reported_once():
    text = "root:\n  children:\n  - A: *a\n  - *b\n  - B: {x: *c}\n"
    assert [code for code, *_ in findings_of(text)] == ["yaml-anchor"] * 3


def test_tagged_value_is_omitted():
    assert beginning_of("root:\n  a: !x y\n  b: 1\n").tree_file.root.attributes == {"b": "1"}


CUT_SHORT = {
    "behind a quotation mark": "root:\n  a: 1\n  children:\n  - B: {c: 2}\n  - D:\n      e: 'x\n",
    "behind a key": "root:\n  a: 1\n  children:\n  - B: {c: 2}\n  - D:\n      e: @x\n",
    "behind a forgotten dash": "root:\n  a: 1\n  children:\n  - B: {c: 2}\n  - D\n  E\n",
    "in brackets": "root:\n  a: 1\n  children:\n  - B: {c: 2}\n  - D: {f: [\n",
}


def beginning_of(text):
    with pytest.raises(TreeError) as caught:
        parse_yaml(text, "test.yaml")
    return caught.value.beginning if isinstance(caught.value, UnfinishedFileError) else None


@pytest.mark.parametrize("name", CUT_SHORT)
def test_content_before_syntax_error_is_read(name):
    beginning = beginning_of(CUT_SHORT[name])
    root = beginning.tree_file.root
    assert (root.attributes, root.children[0].attributes) == ({"a": "1"}, {"c": "2"})
    assert (1, 1, "root") in beginning.unfinished
    assert not any(tag == "B" for *_, tag in beginning.unfinished)
    assert [code for code, *_ in findings_of(CUT_SHORT[name])] == ["malformed-yaml"]


@pytest.mark.parametrize("text", ["? {a: b\n", "? [a, {b: c\n", "? ? {a: [b\n"])
def test_file_malformed_within_key_is_reported(text):
    assert [code for code, *_ in findings_of(f"root:\n  {text}")] == ["malformed-yaml"]


@given(st.text(st.sampled_from(list("ab:-#&*!|>'\"{}[], \n  ")), max_size=60))
def test_arbitrary_content_of_root_is_parsed_or_rejected(text):
    try:
        said = parse_yaml(f"root:\n  {text}").root.tag
    except TreeError as error:
        said = str(error)
    assert said


@pytest.mark.parametrize(
    ("value", "column"),
    [
        ("zone #3", 11),
        ("zone  #3", None),
        ("zone # three", None),
        ("5 #3", None),
        ("'zone #3'", None),
        ("zone#3", None),
    ],
)
def test_string_cut_by_comment_is_reported(value, column):
    findings = parse_yaml(f"root:\n  a: {value}\n").findings
    assert [(each.code, each.span.line, each.span.column) for each in findings] == (
        [("cut-text", 2, column)] if column else []
    )
