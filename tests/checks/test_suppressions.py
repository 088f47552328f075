"""Tests that a comment suppresses a finding of its element, and nothing else."""

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import Forest, load_forest
from sar_compiler.tree.yaml import parse_yaml
from tests.trees import document, forest_of

# A sequence of one node has the info 'needless-node'.
NEEDLESS = '<Sequence name="{}"><ZonesRemaining/></Sequence>'


def findings_in(forest):
    return [(each.code, each.span.line, each.span.column) for each in check(forest, default_registry())]


def findings_in_tree(body):
    return findings_in(forest_of(document(body)))


def test_comment_suppresses_finding_of_next_element():
    assert findings_in_tree(NEEDLESS.format("a")) == [("needless-node", 3, 1)]
    assert findings_in_tree(f"<!-- sar: allow needless-node -->\n{NEEDLESS.format('a')}") == []


def test_comment_in_line_of_element_applies_to_that_element():
    body = "<Sequence> <!-- sar: allow needless-node -->\n<ZonesRemaining/></Sequence>"
    assert findings_in_tree(body) == []


def test_comment_before_tree_does_not_apply_to_its_nodes():
    text = document(NEEDLESS.format("a")).replace("<Beh", "<!-- sar: allow needless-node --><Beh")
    assert [code for code, *_ in findings_in(forest_of(text))] == ["unneeded-allow", "needless-node"]


def test_comment_before_tree_applies_to_its_attributes():
    trees = '<BehaviorTree ID="A"><ZonesRemaining/></BehaviorTree>\n{}<BehaviorTree ID="B"><ZonesRemaining/></BehaviorTree>'
    root = f'<root BTCPP_format="4" main_tree_to_execute="A">\n{trees}\n</root>'
    assert findings_in(forest_of(root.format(""))) == [("unused-tree", 3, 19)]
    assert findings_in(forest_of(root.format("<!-- sar: allow unused-tree -->"))) == []


def test_comment_may_have_several_codes_and_reason():
    body = (
        f"<Sequence>{NEEDLESS.format('a')}\n"
        f"<!-- sar: allow needless-node, same-name: both are replaced by a plugin -->\n{NEEDLESS.format('a')}</Sequence>"
    )
    assert findings_in_tree(body) == [("needless-node", 3, 11)]


def test_comment_applies_only_to_next_element():
    body = f"<Sequence>\n<!-- sar: allow needless-node -->{NEEDLESS.format('a')}{NEEDLESS.format('b')}</Sequence>"
    assert [code for code, *_ in findings_in_tree(body)] == ["needless-node"]


def test_unneeded_comment_is_reported_at_its_code():
    body = "<!-- sar: allow needless-node, same-name: why -->\n<ZonesRemaining/>"
    assert findings_in_tree(body) == [("unneeded-allow", 3, 17), ("unneeded-allow", 3, 32)]


def test_comment_after_last_element_is_unneeded():
    (finding,) = check(
        forest_of(document("<ZonesRemaining/>\n<!-- sar: allow same-name -->")), default_registry()
    )
    assert (finding.code, finding.severity) == ("unneeded-allow", Severity.WARNING)
    assert "no element follows" in finding.message


def test_unneeded_comment_is_not_reported_while_there_are_errors():
    assert [code for code, *_ in findings_in_tree("<!-- sar: allow same-name -->\n<Xyzzy/>")] == [
        "unknown-node"
    ]


def test_unknown_code_gets_suggestion():
    (finding,) = check(
        forest_of(document("<!-- sar: allow same-nam -->\n<ZonesRemaining/>")), default_registry()
    )
    assert (finding.code, finding.suggestion, finding.span.column) == ("wrong-allow", "same-name", 17)


def test_error_cannot_be_suppressed():
    body = '<!-- sar: allow unknown-attribute -->\n<ZonesRemaining colour="red"/>'
    assert findings_in_tree(body) == [("wrong-allow", 3, 17), ("unknown-attribute", 4, 17)]


@pytest.mark.parametrize("comment", ["sar: alow same-name", "sar: allow", "sar: allow : why", "sar:"])
def test_malformed_suppression_comment_is_reported(comment):
    assert findings_in_tree(f"<!-- {comment} -->\n<ZonesRemaining/>") == [("wrong-allow", 3, 6)]


def test_text_in_value_is_no_comment():
    assert (
        findings_in_tree('<Sequence name="sar: allow x"><ZonesRemaining/><LogNoDetection/></Sequence>') == []
    )


def test_yaml_comment_suppresses_finding():
    text = (
        "root:\n  BTCPP_format: 4\n  children:\n    - BehaviorTree:\n        ID: Main\n        children:\n"
        "{}          - Sequence:{}\n              children: [ZonesRemaining]\n"
    )

    def of(before, beside):
        return findings_in(Forest.from_file(parse_yaml(text.format(before, beside), "test.yaml")))

    assert of("", "") == [("needless-node", 7, 13)]
    assert of("          # sar: allow needless-node: why\n", "") == []
    assert of("          # as it was\n          # sar: allow needless-node\n", "") == []
    assert of("", "  # sar: allow needless-node") == []
    assert of("          # sar: allow same-name\n", "") == [
        ("unneeded-allow", 7, 24),
        ("needless-node", 8, 13),
    ]


def test_comment_in_included_file_applies_to_that_file(tmp_path):
    inner = document(f"<!-- sar: allow needless-node -->{NEEDLESS.format('a')}", main="Inner")
    (tmp_path / "inner.xml").write_text(inner, encoding="utf-8")
    outer = document('<SubTree ID="Inner"/>').replace("<Beh", '<include path="inner.xml"/><Beh')
    outer = outer.replace('"4"', '"4" main_tree_to_execute="Main"')
    (tmp_path / "outer.xml").write_text(outer, encoding="utf-8")
    assert findings_in(load_forest(tmp_path / "outer.xml", read_tree_file)) == []
