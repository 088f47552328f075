"""`<Action ID="Say">`: the form that names the kind of a node as well."""

import pytest

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Severity
from tests.trees import errors, forest

REGISTRY = default_registry()


def found(body):
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in errors(forest(body), REGISTRY)]


@pytest.mark.parametrize(
    "body",
    [
        '<Action ID="AdvanceZone"/>',
        '<Condition ID="ZonesRemaining" name="any?"/>',
        '<Control ID="Sequence" memory="false"><Success/></Control>',
        '<Control ID="ReactiveSequence"><Action ID="Success"/></Control>',
        '<Decorator ID="RetryUntilSuccessful" num_attempts="3"><Failure/></Decorator>',
        '<Decorator ID="Timeout" duration="3" oneshot="ON_COMPLETION"><Success/></Decorator>',
    ],
)
def test_a_node_may_be_written_with_its_kind(body):
    assert found(body) == []


@pytest.mark.parametrize(
    ("kind", "tag", "read"),
    [
        ("Control", "Success", (1, 2, 3)),
        ("Decorator", "Success", (1,)),
        ("Action", "Inverter", (0,)),
        ("Condition", "Success", (0,)),
    ],
)
def test_a_wrong_kind_is_an_error_where_behaviortree_cpp_wants_other_children(kind, tag, read):
    for children in range(4):
        findings = check(forest(f'<{kind} ID="{tag}">{"<Success/>" * children}</{kind}>'), REGISTRY)
        (finding,) = [each for each in findings if each.code == "wrong-kind"]
        assert (finding.severity is Severity.WARNING) == (children in read)


def test_both_forms_compile_to_the_same():
    compact = preview_tree(bind_main(forest('<Sequence memory="false"><Success/></Sequence>'), REGISTRY)).root
    body = '<Control ID="Sequence" memory="false"><Action ID="Success"/></Control>'
    explicit = preview_tree(bind_main(forest(body), REGISTRY)).root
    assert [(type(a), a.name) for a in compact.iterate()] == [(type(b), b.name) for b in explicit.iterate()]


MISTAKES = {
    "a wrong kind": ('<Decorator ID="AdvanceZone"/>', "wrong-kind", 1, "Action"),
    "no ID": ("<Action/>", "missing-attribute", 1, None),
    "an empty ID": ('<Action ID=""/>', "missing-attribute", 13, None),
    "an ID of no node": ('<Action ID="AdvanseZone"/>', "unknown-node", 13, "AdvanceZone"),
    "an ID in the compact form": ('<AdvanceZone ID="AdvanceZone"/>', "unknown-attribute", 14, None),
    "a misspelt attribute": (
        '<Control ID="Sequence" memry="true"><Success/></Control>',
        "unknown-attribute",
        24,
        "memory",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_the_explicit_form_is_found_where_it_stands(name):
    body, code, column, suggestion = MISTAKES[name]
    assert found(body) == [(code, 3, column, suggestion)]


@pytest.mark.parametrize(
    "attributes",
    [
        'ID="ScriptCondition" code="true"',
        'ID="CheckBlackboardVariableExists" variable_name="@a"',
        'ID="CheckBlackboardVariableValue" variable="@a" operator="eq" value="1"',
        'ID="CheckBlackboardVariableValues" checks="a eq 1;b eq 2" operator="and"',
        'ID="CompareBlackboardVariables" var1_key="@a" var2_key="@b" operator="eq"',
    ],
)
def test_a_leaf_that_only_asks_the_blackboard_is_a_condition(attributes):
    assert found(f"<Condition {attributes}/>") == []
    findings = check(forest(f"<Action {attributes}/>"), REGISTRY)
    assert [(f.span.line, f.span.column, f.suggestion) for f in findings if f.code == "wrong-kind"] == [
        (3, 1, "Condition")
    ]
