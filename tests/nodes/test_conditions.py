"""Pre- and post-conditions: scripts in attributes that every node may have."""

import pytest

from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.binding.attributes import CONDITIONS
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.language_nodes import Conditions
from tests.trees import errors, forest, forest_of

REGISTRY = default_registry()


def found(body):
    return [(f.code, f.span.line, f.span.column, f.span.end_column) for f in errors(forest(body), REGISTRY)]


@pytest.mark.parametrize("name", CONDITIONS)
@pytest.mark.parametrize(
    "node", ["<Success {}/>", "<Sequence {}><Success/></Sequence>", "<Inverter {}><Success/></Inverter>"]
)
def test_every_node_may_have_every_condition(name, node):
    body = node.format(f'{name}="a := 1"')
    assert found(body) == []
    assert type(preview_tree(bind_main(forest(body), REGISTRY)).root) is Conditions


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_mistake_in_a_script_is_found_at_its_place_in_the_value(name):
    body = f'<Success {name}="ok; 1 == % 2"/>'
    column = body.index("%") + 1
    assert found(body) == [("script-error", 3, column, column + 1)]


def test_the_place_is_right_behind_entities_and_line_breaks():
    body = '<Success\n  _skipIf="a &amp;&amp; b &gt; 1 &amp;&amp;\n c.d"/>'
    assert found(body) == [("script-error", 5, 2, 5)]


@pytest.mark.parametrize("script", ["", "  "])
def test_a_condition_must_not_be_empty(script):
    assert [code for code, *_ in found(f'<Success _skipIf="{script}"/>')] == ["script-error"]


def test_an_empty_script_node_is_none():
    assert found('<Script code=""/>') == []


def test_a_misspelt_condition_is_a_finding_with_the_right_one():
    (finding,) = errors(forest('<Success _skipif="true"/>'), REGISTRY)
    assert (finding.code, finding.suggestion) == ("unknown-attribute", "_skipIf")


@pytest.mark.parametrize("name", ["_description", "_uid", "_fullpath"])
def test_the_notes_of_an_editor_mean_nothing(name):
    assert found(f'<Success {name}="{{ any &lt; thing"/>') == []
    assert (
        type(preview_tree(bind_main(forest(f'<Success {name}="x"/>'), REGISTRY)).root).__name__ == "Success"
    )


def test_the_root_of_a_file_has_no_conditions():
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


def test_the_conditions_of_a_subtree_see_the_keys_around_it():
    tree = compile_tree(bind_main(subtree('_skipIf="!go"'), REGISTRY), {}, {})
    tree.root.tick_once()
    assert not tree.instance.scope.resolve("ran").exists
    tree = compile_tree(bind_main(subtree('_skipIf="go"'), REGISTRY), {}, {})
    tree.root.tick_once()
    assert tree.instance.scope.resolve("ran").exists


def test_a_condition_is_parsed_once_however_often_its_tree_is_used():
    trees = forest_of(
        '<root main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence><SubTree ID="B"/><SubTree ID="B"/></Sequence>'
        '</BehaviorTree><BehaviorTree ID="B"><Success _skipIf="a ==="/></BehaviorTree></root>'
    )
    assert [finding.code for finding in errors(trees, REGISTRY)] == ["script-error"]
