"""Tests of recovery: malformed XML that BehaviorTree.CPP accepts, and beginnings of other malformed files."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form, Severity, TreeError
from sar_compiler.tree.model import OpenTag, UnfinishedFileError
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.xml_recovery import recover
from sar_compiler.tree.xml_writer import write_xml
from tests.fuzz.bounds import at_most
from tests.tree.strategies import tree_files


def cut(source, span):
    return source.text[source.offset(span.line, span.column) : source.offset(span.end_line, span.end_column)]


# Each entry: the raw value, the parsed value, and the findings as (raw text, suggestion).
RAW = {
    "an and": ("a && b", "a && b", [("&&", "&amp;&amp;")]),
    "a less-than": ("a < b", "a < b", [("<", "&lt;")]),
    "both, beside what is well written": (
        "a &lt; b && c < d",
        "a < b && c < d",
        [("&&", "&amp;&amp;"), ("<", "&lt;")],
    ),
    "an ampersand before a semicolon": ("a & b; c", "a & b; c", [("&", "&amp;")]),
    "an ampersand before a reference": ("&&amp;", "&&", [("&", "&amp;")]),
    "an entity of HTML": ("a&nbsp;b", "a&nbsp;b", [("&nbsp;", None)]),
    "a reference without its semicolon": ("a &lt b", "a &lt b", [("&", "&amp;")]),
    "tags": ("<b/> <c>", "<b/> <c>", [("<", "&lt;"), ("<", "&lt;")]),
    "a line break in it": ("a &&\n b", "a &&  b", [("&&", "&amp;&amp;")]),
    "a reference to what stand-ins are taken from": (
        "&#xE000;&#57345; & &#x0E002;",
        "\ue000\ue001 & \ue002",
        [("&", "&amp;")],
    ),
    "what stand-ins are taken from": ("\ue000\ue001 & \ue002", "\ue000\ue001 & \ue002", [("&", "&amp;")]),
}


@pytest.mark.parametrize("name", RAW)
def test_raw_characters_are_recovered_and_reported_at_their_location(name):
    written, said, told = RAW[name]
    tree_file = parse_xml(f'<root>\n  <A é="1" b="{written}" c="2"/>\n  <B d=\'3\'/>\n</root>')
    first, second = tree_file.root.children
    assert first.attributes == {"é": "1", "b": said, "c": "2"}
    assert cut(tree_file.source, first.value_span("b")) == written
    assert cut(tree_file.source, first.value_span("c")) == "2"
    assert (second.line, second.column) == (3 + written.count("\n"), 3)
    assert {(each.code, each.severity) for each in tree_file.findings} == {("loose-xml", Severity.WARNING)}
    assert [(cut(tree_file.source, each.span), each.suggestion) for each in tree_file.findings] == told


def test_late_declaration_is_reported_and_later_locations_are_unchanged():
    tree_file = parse_xml('\n\n <?xml version="1.0"\nencoding="UTF-8"?>\n<root b="&&">\n  <A/>\n</root>')
    assert [(each.code, each.span.line, each.span.column) for each in tree_file.findings] == [
        ("loose-xml", 3, 2),
        ("loose-xml", 5, 10),
    ]
    (child,) = tree_file.root.children
    assert (child.line, child.column) == (6, 3)


def test_location_in_recovered_value_is_that_of_raw_text():
    element = parse_xml('<root a="x && y; &lt; z"/>').root
    value = element.attributes["a"]
    assert cut(element.source, element.value_part_span("a", value.index("z"), len(value))) == "z"
    assert cut(element.source, element.value_part_span("a", value.index("&"), value.index("&") + 2)) == "&&"


@pytest.mark.parametrize(
    ("before", "behind", "told"),
    [
        ("<![CDATA[a <b> ]]>", "", ["<![CDATA[a <b> ]]>"]),
        ("// a\n<![CDATA[b\nc]]>", "", ["// a", "<![CDATA[b"]),
        ("", "<!-- a --><![CDATA[b]]>", ["<![CDATA[b]]>"]),
        ("", "text\n<a/>", ["text", "<a/>"]),
        ("", '<other a="1 & 2"/>', ['<other a="1 & 2"/>']),
        ("", "<root>\n<a>b & c<![CDATA[d]]><e/></a></root>\n<f/>", ["<root>", "<f/>"]),
    ],
)
def test_content_outside_root_is_ignored_and_reported(before, behind, told):
    tree_file = parse_xml(f'{before}\n<root a="x &amp; y"><b/>\n<c/></root>\n{behind}')
    assert [(child.tag, child.line) for child in tree_file.root.children] == [
        ("b", 2 + before.count("\n")),
        ("c", 3 + before.count("\n")),
    ]
    assert tree_file.root.attributes == {"a": "x & y"}
    assert [each.code for each in tree_file.findings] == ["stray-text"] * len(told)
    assert [cut(each.source, each.span) for each in tree_file.findings] == told


@pytest.mark.parametrize("behind", ["text", "<other>", "</root>", "<a/> text", "<![CDATA[a", "<a></b>"])
def test_unreadable_content_after_root_is_malformed(behind):
    with pytest.raises(TreeError) as caught:
        parse_xml(f"<root><b/></root>\n{behind}")
    assert caught.value.findings[-1].code == "malformed-xml"


def test_text_before_root_is_reported_by_line_and_later_locations_are_unchanged():
    tree_file = parse_xml("// a & b\n<!-- c -- d -->\n  // e >\n<root>\n  <A/>\n</root>")
    stray, dashes, other = tree_file.findings
    assert [each.code for each in tree_file.findings] == ["stray-text", "loose-xml", "stray-text"]
    assert [cut(each.source, each.span) for each in (stray, dashes, other)] == ["// a & b", "--", "// e >"]
    assert {each.severity for each in tree_file.findings} == {Severity.WARNING}
    (child,) = tree_file.root.children
    assert (child.line, child.column) == (5, 3)


def test_text_after_root_cannot_be_recovered():
    with pytest.raises(TreeError) as caught:
        parse_xml("<root></root>\n// end\n")
    (finding,) = caught.value.findings
    assert (finding.span.line, finding.span.column) == (2, 1)
    assert finding.message.endswith("text is not allowed after </root>")


def test_comment_with_double_hyphens_is_recovered():
    tree_file = parse_xml("<root><!-- a -- b ---><A/></root>")
    assert [comment.text for comment in tree_file.root.comments] == ["a -- b -"]
    assert [(each.span.column, each.suggestion) for each in tree_file.findings] == [(14, "- -"), (19, "- ")]


def test_nested_comment_is_reported_at_its_beginning():
    tree_file = parse_xml("<root><!-- a <A/>\n<!-- b --></root>")
    (finding,) = tree_file.findings
    assert (finding.message, finding.span.line) == ("a comment begins inside another comment", 2)
    assert tree_file.root.children == ()


def test_text_in_node_model_is_recovered():
    text = '<root><TreeNodesModel><A ID="B"><input_port name="x">this & that</input_port></A></TreeNodesModel></root>'
    assert [each.text for each in parse_xml(text).root.iterate()][-1] == "this & that"


def test_recovered_file_is_written_as_valid_xml():
    text = '<root a="x &&&lt; y" b="a <\n  b &amp;&amp; c &quot;"/>'
    written = convert(parse_xml(text), Form.XML).text
    assert parse_xml(written).findings == ()
    assert parse_xml(written).root == parse_xml(text).root
    assert 'b="a &lt;\n  b &amp;&amp; c &quot;"' in written


@given(tree_files())
def test_well_formed_file_needs_no_recovery(tree_file):
    read = parse_xml(write_xml(tree_file))
    assert read.findings == ()
    assert recover(read.source) is None


STRICT = {"&": "&amp;", "<": "&lt;", "&&": "&amp;&amp;"}


@given(st.lists(st.sampled_from([*STRICT, "&amp;", "&lt;", "&#65;", "a", "b;", "é", "\n", '"']), max_size=8))
def test_raw_and_escaped_characters_have_same_value(parts):
    loose, strict = " ".join(parts), " ".join(STRICT.get(each, each) for each in parts)
    head, tail = "<root><A/>\n<B a='", "' b='1'/><C/></root>"
    read, meant = parse_xml(head + loose + tail), parse_xml(head + strict + tail)
    assert read.root == meant.root
    assert bool(read.findings) == (loose != strict)
    value, last = read.root.children[1], read.root.children[2]
    assert cut(read.source, value.value_span("a")) == loose
    assert read.source.text.startswith("<C/>", read.source.offset(last.line, last.column))


@pytest.mark.parametrize(
    "text",
    [
        '<root a="' + "&" * 1_000_000 + '"/>',
        '<root a="' + "& < &lt;" * 400_000 + '"/>',
        "<root>" + '<A b="&&"/>' * 3000 + "</root>",
        "<root>" + "&#1" * 1_000_000 + "</root>",
        "<root><!--" + "--" * 1_000_000 + "></root>",
    ],
    ids=["one value", "many stretches", "many elements", "half references", "a comment"],
)
def test_recovery_of_large_file_has_bounded_work(text):
    with at_most(calls=400_000):
        tree_file = parse_xml(text)
    assert 0 < len(tree_file.findings) <= 1000


@pytest.mark.parametrize(
    "end",
    [
        "",
        "<A b",
        "<A b='",
        "<!--",
        "<![CDATA[",
        "<A " + "b " * 300_000,
        "</A>",
        "<A b='" + "&" * 1_000_000 + "' c/>",
    ],
)
def test_unrecoverable_large_file_has_bounded_work(end):
    with at_most(calls=400_000), pytest.raises(TreeError) as caught:
        parse_xml('<root><A b="' + "&" * 1_000_000 + '"/>' + end)
    assert [each.code for each in caught.value.findings][-1] == "malformed-xml"


def test_entities_are_not_expanded_during_recovery():
    bomb = '<!DOCTYPE r [<!ENTITY a "xxxxxxxxxx">]><r v="&a;&&"/>'
    with pytest.raises(TreeError) as caught:
        parse_xml(bomb)
    assert [each.code for each in caught.value.findings] == ["doctype"]


# Each entry: the text after <A b="1"/> and a line break, then column, message and advice.
WORDS = {
    "an attribute without a value": ("<B c/>", 4, "the attribute 'c' has no value", 'write c="..."'),
    "one before others": ("<B c d='1'/>", 4, "the attribute 'c' has no value", 'write c="..."'),
    "a comment in a tag": (
        "<B <!-- c --> d='1'/>",
        4,
        "a comment is not allowed in a tag",
        "move the comment before",
    ),
    "a comment without an end": (
        "<!-- c <B/>",
        1,
        "the comment that begins here has no -->",
        "write --> after it",
    ),
    "an attribute that stands twice": (
        "<B c='1' d='2' c='3'/>",
        16,
        "the attribute 'c' is given twice in this tag",
        "delete one of the two",
    ),
    "a character of terminals": (
        "<B c='\x1b'/>",
        7,
        "the character U+001B is not allowed in XML",
        "delete it",
    ),
    "a tag without an end": ("<B c='1'", 1, "the tag that begins here has no >", ""),
    "a tag in a tag": ("<B c='1' <C/>", 1, "the tag that begins here has no >", ""),
    "a value without an end": ("<B c='1", 6, "the value that begins here has no closing quotation mark", ""),
    "a value without an end before a tag": (
        "<B c='1></B>",
        6,
        "the value that begins here has no closing quotation mark",
        "",
    ),
    "attributes without a blank between": ("<B c='1'd='2'/>", 9, "a space is missing", ""),
    "an invisible character": (
        "<B c\u200b='1'/>",
        5,
        "U+200B (zero width space) is invisible",
        "delete it",
    ),
    "a blank of other kinds": (
        "<B\u00a0c='1'/>",
        3,
        "U+00A0 (no-break space) looks like a space",
        "replace it by a space",
    ),
    "a comma behind a tag": (
        "<B, c='1'/>",
        3,
        "a , is not allowed between the attributes",
        "replace it by a space",
    ),
    "a comma behind an attribute": (
        "<B c='1', d='2'/>",
        9,
        "a , is not allowed between",
        "replace it by a space",
    ),
    "a blank behind the sign": ("< B/>", 1, "a tag's name must directly follow the <", ""),
}


@pytest.mark.parametrize("name", WORDS)
def test_malformed_xml_is_reported_with_cause_and_advice(name):
    written, column, message, advice = WORDS[name]
    with pytest.raises(UnfinishedFileError) as caught:
        parse_xml(f'<root>\n<A b="1"/>\n{written}\n</root>')
    (finding,) = caught.value.findings
    assert (finding.span.line, finding.span.column) == (3, column)
    assert message in finding.message
    assert finding.advice.startswith(advice)
    beginning = caught.value.beginning
    assert beginning is not None
    assert [each.tag for each in beginning.tree_file.root.iterate()] == ["root", "A"]
    assert beginning.unfinished == (OpenTag(1, 1, "root"),)


def test_raw_characters_are_reported_before_and_after_other_error():
    with pytest.raises(TreeError) as caught:
        parse_xml('<root>\n<A b="&&"/>\n<B c="<" d="&" e/>\n</root>')
    assert [(each.code, each.span.line, each.span.column) for each in caught.value.findings] == [
        ("loose-xml", 2, 7),
        ("loose-xml", 3, 13),
        ("malformed-xml", 3, 7),
    ]


@given(st.text(st.sampled_from(list("<>&;/=\"' -!abr\n#[]")), max_size=60))
def test_arbitrary_content_is_parsed_or_rejected(text):
    try:
        findings = parse_xml(f"<root>{text}</root>").findings
    except TreeError as error:
        findings = error.findings
        assert findings
    for each in findings:
        assert each.render()
