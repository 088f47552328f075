"""A text of which one tag's attributes have changed is read as any other text is, only faster."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sar_compiler.errors import SarError
from sar_compiler.tree.retyped import TextReader, retyped
from sar_compiler.tree.xml import parse_xml
from tests.chance import rounds

BEFORE = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <!-- a comment -->
    <Sequence><Sleep msec="10"/> <Say text='a > b' /><!-- beside --></Sequence>
  </BehaviorTree>
</root>
"""


def said(tree_file):
    """Return all that a file says, with every place."""
    elements = [
        (each.tag, dict(each.attributes), len(each.children), each.place, each.text, each.comments)
        for each in tree_file.root.iterate()
    ]
    assert {id(each.source) for each in tree_file.root.iterate()} == {id(tree_file.source)}
    return elements, tree_file.comments, tree_file.findings, tree_file.source


def outcome(read, text):
    """Return all that a file says, or why it cannot be read."""
    try:
        return said(read(text, "tree.xml"))
    except SarError as error:
        return type(error), str(error)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('msec="10"', 'msec="101"'),
        ('msec="10"', ""),
        ("<Sleep ", '<Sleep name="x" '),
        ('msec="10"', "msec = '&lt;1'"),
        ('BTCPP_format="4"', 'BTCPP_format="3"'),
        ("' />", "' text2='/' />"),
    ],
)
def test_other_attributes_of_one_tag_are_read_alone(old, new):
    after = BEFORE.replace(old, new)
    found = retyped(parse_xml(BEFORE), after)
    assert found is not None
    assert found.retyped is not None
    assert said(found) == said(parse_xml(after))
    assert found.retyped.before.tag == found.retyped.after.tag
    assert found.retyped.before.attributes != found.retyped.after.attributes


def test_what_follows_an_edit_in_a_later_line_of_its_tag_moves_along():
    before = BEFORE.replace('<Sleep msec="10"/>', '<Sleep name="x"\n msec="10"/>')
    after = before.replace("10", "1000")
    found = retyped(parse_xml(before), after)
    assert found is not None
    assert said(found) == said(parse_xml(after))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<Sleep", "<Sleepy"),
        ("<Sleep", "<Slee"),
        ('msec="10"/>', 'msec="10"></Sleep>'),
        ('msec="10"', 'msec="10" msec="11"'),
        ('msec="10"', 'msec="10'),
        ('msec="10"', 'msec="&nothing;"'),
        ('msec="10"', "msec"),
        ("a comment", "another"),
        ("> <Say", ">x <Say"),
        ('msec="10"', 'msec="10"\n'),
        ('msec="10"', 'msec="\x01"'),
        ("</root>", "</Root>"),
        ("\n", "\n\n"),
        ("' />", "' / >"),
    ],
)
def test_whatever_else_has_changed_is_read_anew(old, new):
    assert retyped(parse_xml(BEFORE), BEFORE.replace(old, new, 1)) is None


@given(st.data())
@settings(max_examples=rounds(300), deadline=None)
def test_a_text_is_read_after_another_as_by_itself(data):
    reader, text = TextReader(), BEFORE
    for _ in range(3):
        start = data.draw(st.integers(0, len(text)))
        end = start + data.draw(st.sampled_from((0, 0, 1, 2, 9)))
        came = data.draw(
            st.sampled_from(("", "1", "x", '"', "'", " ", "/", ">", "<", "=", "\n", ' a="b"', "&amp;"))
        )
        text = text[:start] + came + text[end:]
        assert outcome(reader.read, text) == outcome(parse_xml, text)
