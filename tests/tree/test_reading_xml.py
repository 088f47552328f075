"""Tests of the XML reader: it returns elements with locations, or reports one finding."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.opener import TREE, UnreadableFileError
from sar_compiler.tree.content import MAX_DEPTH
from sar_compiler.tree.diagnostic import Severity, Span, TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.model import Element
from sar_compiler.tree.xml import parse_xml


def finding_of(data):
    with pytest.raises(TreeError) as caught:
        parse_xml(data, "test.xml")
    assert len(caught.value.findings) == 1
    finding = caught.value.findings[0]
    return finding.code, finding.span.line, finding.span.column


def test_element_has_line_and_column_of_its_tag():
    root = parse_xml("<root>\n  <A/>\n\t<B\n/></root>").root
    assert [(e.tag, e.line, e.column) for e in root.iterate()] == [("root", 1, 1), ("A", 2, 3), ("B", 3, 2)]


def test_parsed_element_equals_constructed_element():
    source = parse_xml("<A/>").source
    read = parse_xml('<root a="1"><B/></root>').root
    made = Element("root", {"a": "1"}, (Element("B", {}, (), source, 1, 1),), source, 1, 1)
    assert read == made


def test_attribute_has_spans_of_name_and_value():
    root = parse_xml('<root first = "1"\n   second=\'a"b\'/>').root
    assert root.name_span("first") == Span(1, 7, 1, 12)
    assert root.value_span("first") == Span(1, 16, 1, 17)
    assert root.name_span("second") == Span(2, 4, 2, 10)
    assert root.value_span("second") == Span(2, 12, 2, 15)


def test_columns_count_characters_not_bytes():
    child = parse_xml('<root a="äöü"><Ä ß="é"/></root>').root.children[0]
    assert (child.line, child.column) == (1, 15)
    assert child.value_span("ß") == Span(1, 21, 1, 22)


def test_attribute_name_is_not_found_in_longer_name():
    root = parse_xml('<root survivor_id="id=" id="x"/>').root
    assert root.name_span("id") == Span(1, 25, 1, 27)


def test_greater_than_sign_in_value_does_not_end_tag():
    root = parse_xml('<root a="1>2" b="3"/>').root
    assert root.value_span("b") == Span(1, 18, 1, 19)


def test_entities_in_values_are_resolved():
    assert parse_xml('<root a="&lt;&amp;&#65;"/>').root.attributes == {"a": "<&A"}


def test_comments_processing_instructions_and_text_are_not_elements():
    root = parse_xml("<root><!-- <A/> --><?x y?>text<![CDATA[<B/>]]><C/></root>").root
    assert [child.tag for child in root.children] == ["C"]


def test_windows_and_old_mac_line_ends_count_as_lines():
    root = parse_xml(b"<root>\r\n<A/>\r<B/></root>").root
    assert [(child.line, child.column) for child in root.children] == [(2, 1), (3, 1)]
    assert root.children[1].source.line(3) == "<B/></root>"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
def test_file_is_read_in_its_encoding(encoding):
    declared = {"latin-1": "ISO-8859-1", "utf-16-be": "UTF-16BE"}.get(encoding)
    head = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    data = (head + '<root name="é"/>').encode(encoding)
    if encoding == "utf-16-be":
        data = b"\xfe\xff" + data
    assert parse_xml(data).root.attributes["name"] == "é"


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", ("empty-file", 1, 1)),
        (b" \n\t", ("empty-file", 1, 1)),
        (b"hello", ("malformed-xml", 1, 1)),
        (b"<root>\n  <A>\n", ("malformed-xml", 3, 1)),
        (b"<root>\n  <A></B>\n</root>", ("malformed-xml", 2, 6)),
        (b"<root a=1/>", ("malformed-xml", 1, 9)),
        (b'<root a="1" a="2"/>', ("malformed-xml", 1, 13)),
        (b"<root/>\n<root>", ("malformed-xml", 2, 1)),
        (b"<!-- a -->\n<?xml version='1.0'?><root/>", ("malformed-xml", 2, 1)),
        (b'<!DOCTYPE root [<!ENTITY a "b">]>\n<root/>', ("doctype", 1, 1)),
        (b"<root>\xff</root>", ("wrong-encoding", 1, 7)),
        (b'<?xml version="1.0" encoding="klingon"?><root/>', ("wrong-encoding", 1, 1)),
        (b'<?xml version="1.0" encoding="undefined"?><root/>', ("wrong-encoding", 1, 1)),
        ("<root/>".encode("utf-16-le"), ("wrong-encoding", 1, 2)),
    ],
)
def test_invalid_file_has_one_finding_at_error_location(data, expected):
    assert finding_of(data) == expected


def test_missing_end_tag_is_reported_with_line_of_start_tag():
    with pytest.raises(TreeError, match=r"does not close <A>, which was opened on line 2"):
        parse_xml("<root>\n<A>\n</root>")


def test_unquoted_value_is_reported():
    with pytest.raises(TreeError, match="must be in quotes"):
        parse_xml("<root a=1/>")


def test_too_deep_nesting_is_reported_at_limit():
    assert finding_of("<a>" * (MAX_DEPTH + 1)) == ("too-deep", 1, 3 * MAX_DEPTH + 1)
    parse_xml("<a>" * MAX_DEPTH + "</a>" * MAX_DEPTH)


def test_file_over_size_limit_is_rejected_without_parsing(tmp_path):
    path = tmp_path / "large.xml"
    with path.open("wb") as stream:
        stream.truncate(TREE.limit + 1)
    with pytest.raises(TreeError, match=f"larger than {TREE.limit // 2**20} MiB"):
        read_tree_file(path)


def test_doctype_entities_are_never_expanded():
    bomb = '<!DOCTYPE r [<!ENTITY a "xxxxxxxxxx"><!ENTITY b "&a;&a;&a;&a;">]><r v="&b;"/>'
    assert finding_of(bomb)[0] == "doctype"


def test_missing_file_raises_error_with_reason(tmp_path):
    with pytest.raises(UnreadableFileError, match=r"cannot read .*nowhere\.xml: No such file"):
        read_tree_file(tmp_path / "nowhere.xml")


def test_folder_raises_unreadable_file_error(tmp_path):
    with pytest.raises(UnreadableFileError, match="Is a directory"):
        read_tree_file(tmp_path)


NAMES = st.text(st.sampled_from("abcäß_"), min_size=1, max_size=4)
VALUES = st.text(
    st.characters(codec="utf-8", exclude_characters='<&"\r\n\t\x00', exclude_categories=["C"]), max_size=8
)


@given(st.dictionaries(NAMES, VALUES, max_size=5), st.sampled_from(["", "\n", "  \n\t"]))
def test_every_span_covers_its_part(attributes, space):
    text = (
        f"{space}<root"
        + "".join(f' {space}{name}{space} = "{value}"' for name, value in attributes.items())
        + "/>"
    )
    root = parse_xml(text).root

    def cut(span):
        source = root.source
        return source.text[
            source.offset(span.line, span.column) : source.offset(span.end_line, span.end_column)
        ]

    assert cut(root.tag_span()) == "<root"
    for name, value in attributes.items():
        assert cut(root.name_span(name)) == name
        assert cut(root.value_span(name)) == value


@given(st.binary(max_size=200) | st.text(max_size=200))
def test_arbitrary_bytes_are_parsed_or_rejected(data):
    try:
        parse_xml(data)
    except TreeError as error:
        rendered = error.args[0]
    else:
        rendered = "a file"
    assert rendered


def test_comments_are_kept_with_adjacent_elements():
    text = """<!-- before -->
<root> <!-- beside root -->
  <A/> <!-- beside A -->
  <!--
    Before B,
      in lines.
  -->

  <!-- also before B -->
  <B><C/></B> <!-- at the end -->
</root>
<!-- behind -->"""
    tree_file = parse_xml(text)
    assert [(one.text, one.index) for one in tree_file.comments] == [("before", 0), ("behind", 1)]
    assert [(one.text, one.index, one.trailing, one.after_blank_line) for one in tree_file.root.comments] == [
        ("beside root", 0, True, False),
        ("Before B,\n  in lines.", 1, False, False),
        ("also before B", 1, False, True),
        ("at the end", 2, False, False),
    ]
    first, second = tree_file.root.children
    assert [(one.text, one.trailing) for one in first.comments] == [("beside A", True)]
    assert second.comments == ()


def test_comments_do_not_affect_equality():
    assert parse_xml("<root><!-- a --><A/></root>").root == parse_xml("<root><A/></root>").root


def test_only_ports_of_model_have_text():
    port = '<input_port name="x"> Where <![CDATA[to]]> go </input_port>'
    root = parse_xml(f"<root><A>a</A><TreeNodesModel>{port}</TreeNodesModel><B>b</B></root>").root
    assert [element.text for element in root.iterate()] == ["", "", "", "Where to go", ""]


# BehaviorTree.CPP 4.8.2, 4.9.0, 4.9.1 and 4.10 differ in whether they accept such files.
@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("<root><?note x?><BehaviorTree/></root>", [7]),
        ("<root><BehaviorTree><A><?note x?></A></BehaviorTree><?more?></root>", [24]),
        ("<root><BehaviorTree/></root><?note x?>", [29]),
        ('<?xml version="1.0"?><?note x?><root><BehaviorTree/></root>', []),
    ],
)
def test_first_processing_instruction_after_root_start_is_warning(text, columns):
    found = parse_xml(text).findings
    assert [(each.code, each.severity, each.span.column) for each in found] == [
        ("processing-instruction", Severity.WARNING, column) for column in columns
    ]
