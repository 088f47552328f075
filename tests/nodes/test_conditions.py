"""Tests of pre- and post-conditions: scripts in attributes that every node may have."""

import pytest

from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.binding.attributes import CONDITIONS
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.language_nodes import Conditions
from tests.trees import errors, forest, forest_of

REGISTRY = default_registry()


def locate_findings(body):
    return [(f.code, f.span.line, f.span.column, f.span.end_column) for f in errors(forest(body), REGISTRY)]


@pytest.mark.parametrize("name", CONDITIONS)
@pytest.mark.parametrize(
    "node", ["<Success {}/>", "<Sequence {}><Success/></Sequence>", "<Inverter {}><Success/></Inverter>"]
)
def test_every_node_may_have_every_condition(name, node):
    body = node.format(f'{name}="a := 1"')
    assert locate_findings(body) == []
    assert type(preview_tree(bind_main(forest(body), REGISTRY)).root) is Conditions


@pytest.mark.parametrize("name", CONDITIONS)
def test_script_error_is_located_within_attribute_value(name):
    body = f'<Success {name}="ok; 1 == % 2"/>'
    column = body.index("%") + 1
    assert locate_findings(body) == [("script-error", 3, column, column + 1)]


def test_location_of_script_error_is_correct_after_entities_and_line_breaks():
    body = '<Success\n  _skipIf="a &amp;&amp; b &gt; 1 &amp;&amp;\n c.d"/>'
    assert locate_findings(body) == [("script-error", 5, 2, 5)]


@pytest.mark.parametrize("script", ["", "  "])
def test_empty_condition_is_error(script):
    assert [code for code, *_ in locate_findings(f'<Success _skipIf="{script}"/>')] == ["script-error"]


def test_empty_script_node_is_accepted():
    assert locate_findings('<Script code=""/>') == []


def test_misspelt_condition_is_reported_with_suggestion():
    (finding,) = errors(forest('<Success _skipif="true"/>'), REGISTRY)
    assert (finding.code, finding.suggestion) == ("unknown-attribute", "_skipIf")


@pytest.mark.parametrize("name", ["_description", "_uid", "_fullpath"])
def test_attributes_of_editors_are_ignored(name):
    assert locate_findings(f'<Success {name}="{{ any &lt; thing"/>') == []
    assert (
        type(preview_tree(bind_main(forest(f'<Success {name}="x"/>'), REGISTRY)).root).__name__ == "Success"
    )


def test_behavior_tree_element_has_no_conditions():
    (finding,) = errors(
        forest_of('<root><BehaviorTree ID="A" _skipIf="true"><Success/></BehaviorTree></root>'), REGISTRY
    )
    assert (finding.code, finding.span.column) == ("unknown-attribute", 28)


def subtree(attributes):
    return forest_of(
        '<root main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>'
        f'<Script code="go := false"/><SubTree ID="B" {attributes}/></Sequence></BehaviorTree>'
        '<BehaviorTree ID="B"><Script code="@ran := 1"/></BehaviorTree></root>'
    )


def test_conditions_of_subtree_use_keys_of_outer_tree():
    tree = compile_tree(bind_main(subtree('_skipIf="!go"'), REGISTRY), {}, {})
    tree.root.tick_once()
    assert not tree.instance.scope.resolve("ran").exists
    tree = compile_tree(bind_main(subtree('_skipIf="go"'), REGISTRY), {}, {})
    tree.root.tick_once()
    assert tree.instance.scope.resolve("ran").exists


def test_condition_error_in_reused_tree_is_reported_once():
    trees = forest_of(
        '<root main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence><SubTree ID="B"/><SubTree ID="B"/></Sequence>'
        '</BehaviorTree><BehaviorTree ID="B"><Success _skipIf="a ==="/></BehaviorTree></root>'
    )
    assert [finding.code for finding in errors(trees, REGISTRY)] == ["script-error"]
