"""Tests of findings while a text is incomplete: findings elsewhere stay and move with their text."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.lsp.open_text import Edit, OpenText, PlacedFinding, edit_between
from sar_compiler.tree.diagnostic import Diagnostic, Source, Span
from sar_compiler.tree.model import NO_SPANS

BEFORE = '<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">\n<Sequence memroy="true">\n'
BEHIND = (
    '<Sleep msec="5 x"/>\n</Sequence>\n</BehaviorTree>\n'
    '<BehaviorTree ID="Idle">\n<Success/>\n</BehaviorTree>\n</root>\n'
)
TAGS = [
    '<Sleep msec="10"/>',
    "<Inverter><Success/></Inverter>",
    "<Fallback>\n<Failure/>\n</Fallback>\n",
    "<!-- a note -->",
]
ELSEWHERE = [("unknown-attribute", "memroy"), ("wrong-value", "5 x")]
OF_THE_WHOLE = [("unused-tree", "Idle")]
"""A finding that a rule derives from the whole file, if there is no error."""

YAML_BEFORE = "root:\n  children:\n  - BehaviorTree:\n      ID: Main\n      children:\n      - Sequence:\n          memroy: true\n          children:\n"
YAML_BEHIND = "          - Sleep: {msec: 5 x}\n          - Success\n"


def text_at(text, place):
    """Return the text at a range."""
    line = text.split("\n")[place.start.line]
    return line[place.start.character : place.end.character]


def codes_with_text(published, text):
    return [(each.code, text_at(text, each.range)) for each in published.diagnostics]


def type_text(editor, path, before, tag, behind):
    """Type a tag character by character; yield each text with all that the server publishes for it."""
    editor.open(path, before + behind)
    for count in range(1, len(tag) + 1):
        start = before + tag[: count - 1]
        place = (start.count("\n"), len(start) - start.rfind("\n") - 1)
        published = editor.change(path, count + 1, (place, place, tag[count - 1]))
        yield before + tag[:count] + behind, published


@pytest.mark.parametrize("tag", TAGS)
@pytest.mark.parametrize("wanted", [ELSEWHERE, OF_THE_WHOLE], ids=["errors", "conclusions"])
def test_findings_elsewhere_stay_while_tag_is_typed(tag, wanted, editor, tmp_path):
    before, behind = BEFORE, BEHIND
    if wanted is OF_THE_WHOLE:
        before, behind = before.replace("memroy", "memory"), behind.replace("5 x", "5")
    for text, published in type_text(editor, tmp_path / "tree.xml", before, tag, behind):
        for each in published:
            assert [found for found in wanted if found not in codes_with_text(each, text)] == [], text


def test_findings_elsewhere_stay_while_node_is_typed_in_yaml(editor, tmp_path):
    path = tmp_path / "tree.yaml"
    for text, published in type_text(
        editor, path, YAML_BEFORE, '          - Timeout: {msec: "3s"\n', YAML_BEHIND
    ):
        for each in published:
            found = codes_with_text(each, text)
            assert ("unknown-attribute", "memroy") in found, text
            assert ("wrong-value", "5 x") in found, text


def test_only_current_findings_are_shown_after_tag_is_complete(editor, tmp_path):
    *_, (text, (*_, checked)) = type_text(editor, tmp_path / "tree.xml", BEFORE, '<Sleep msec="10"/>', BEHIND)
    assert sorted(codes_with_text(checked, text)) == sorted(ELSEWHERE)


def test_fixed_finding_disappears_while_tag_is_incomplete(editor, tmp_path):
    path = tmp_path / "tree.xml"
    editor.open(path, BEFORE + BEHIND)
    editor.change(path, 2, ((3, 0), (3, 0), "<Sle"))
    text = f"{BEFORE}<Sle{BEHIND}".replace("memroy", "memory")
    *_, checked = editor.change(path, 3, ((2, 10), (2, 16), "memory"))
    found = codes_with_text(checked, text)
    assert ("unknown-attribute", "memory") not in found
    assert ("wrong-value", "5 x") in found


UNWRITTEN = '<ScriptCondition code="nobody_writes == 1"/>\n</Sequence>\n</BehaviorTree>\n</root>\n'


def test_unknown_tag_hides_findings_only_after_edit_elsewhere_or_save(editor, tmp_path):
    path, before = tmp_path / "tree.xml", BEFORE.replace("memroy", "memory") + "<Failure/>\n"
    unknown, silenced = ("unknown-node", "<Sle"), ("unwritten-key", "nobody_writes")
    assert silenced in codes_with_text(editor.open(path, before + UNWRITTEN), before + UNWRITTEN)
    *_, checked = editor.change(path, 2, ((4, 0), (4, 0), "<Sle/>"))
    text = f"{before}<Sle/>{UNWRITTEN}"
    assert {unknown, silenced} <= {*codes_with_text(checked, text)}
    *_, checked = editor.change(path, 3, ((0, 0), (0, 0), "<!-- -->"))
    text = f"<!-- -->{text}"
    assert (unknown in codes_with_text(checked, text), silenced in codes_with_text(checked, text)) == (
        True,
        False,
    )
    editor.change(path, 4, ((4, 0), (4, 6), ""))
    editor.change(path, 5, ((4, 0), (4, 0), "<Sle/>"))

    def last():
        # Late results for another file may come in between.
        return next(each for each in reversed(editor.published) if each.uri == path.as_uri())

    assert silenced in codes_with_text(last(), text)
    editor.save(path)
    editor.wait_until(lambda: silenced not in codes_with_text(last(), text), "it is never silenced")


@given(st.text("ab\n", max_size=20), st.text("ab\n", max_size=20))
def test_edit_between_two_texts_converts_one_to_the_other(old, new):
    edit = edit_between(old, new)
    came = new[edit.start : edit.start + edit.length]
    assert old[: edit.start] + came + old[edit.end :] == new
    assert len(new) - len(old) == edit.growth


FOUND = Diagnostic("unknown-node", "", Source("tree.xml", "", NO_SPANS), Span(1, 1, 1, 1))
STRETCH = st.tuples(st.integers(0, 30), st.integers(0, 30)).map(sorted)


@given(STRETCH, STRETCH, st.text("xyz", max_size=5))
def test_finding_moves_with_its_text_and_is_touched_by_edits_in_it(place, edited, came):
    text = "".join(map(chr, range(ord("A"), ord("A") + 30)))
    (start, end), (first, last) = place, edited
    after = text[:first] + came + text[last:]
    moved = PlacedFinding(FOUND, start, end).after_edit(Edit(first, last, len(came)))
    assert moved.is_touched == (last > start and first <= end)
    assert 0 <= moved.start <= moved.end <= len(after)
    if not moved.is_touched:
        assert after[moved.start : moved.end] == text[start:end]


def test_tick_error_stays_after_check_until_its_text_is_edited():
    path, text = Path("tree.xml"), "<A/>\n<B/>\n"
    opened = OpenText(path, text, 1)
    raised = [
        Diagnostic(code, "", Source(str(path), text, NO_SPANS), Span(line, 1, line, 5))
        for line, code in enumerate(("wrong-value", "unknown-node"), 1)
    ]
    opened.set_tick_errors(raised)
    opened.change(text.replace("B", "BB"), 2)
    opened.set_findings(None, [])
    assert [each.finding.code for each in opened.shown] == ["wrong-value"]
