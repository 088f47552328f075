"""Tests of the explicit form, `<Action ID="Say">`, which also contains the kind of a node."""

import pytest

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Severity
from tests.trees import errors, forest

REGISTRY = default_registry()


def locate_findings(body):
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
def test_node_may_be_written_in_explicit_form(body):
    assert locate_findings(body) == []


@pytest.mark.parametrize(
    ("kind", "tag", "read"),
    [
        ("Control", "Success", (1, 2, 3)),
        ("Decorator", "Success", (1,)),
        ("Action", "Inverter", (0,)),
        ("Condition", "Success", (0,)),
    ],
)
def test_wrong_kind_is_only_warning_if_it_allows_number_of_children(kind, tag, read):
    for children in range(4):
        findings = check(forest(f'<{kind} ID="{tag}">{"<Success/>" * children}</{kind}>'), REGISTRY)
        (finding,) = [each for each in findings if each.code == "wrong-kind"]
        assert (finding.severity is Severity.WARNING) == (children in read)


def test_compact_and_explicit_form_compile_to_same_tree():
    compact = preview_tree(bind_main(forest('<Sequence memory="false"><Success/></Sequence>'), REGISTRY)).root
    body = '<Control ID="Sequence" memory="false"><Action ID="Success"/></Control>'
    explicit = preview_tree(bind_main(forest(body), REGISTRY)).root
    assert [(type(a), a.name) for a in compact.iterate()] == [(type(b), b.name) for b in explicit.iterate()]


ERRORS = {
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


@pytest.mark.parametrize("name", ERRORS)
def test_error_in_explicit_form_is_located(name):
    body, code, column, suggestion = ERRORS[name]
    assert locate_findings(body) == [(code, 3, column, suggestion)]


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
def test_leaf_that_only_reads_blackboard_is_condition(attributes):
    assert locate_findings(f"<Condition {attributes}/>") == []
    findings = check(forest(f"<Action {attributes}/>"), REGISTRY)
    assert [(f.span.line, f.span.column, f.suggestion) for f in findings if f.code == "wrong-kind"] == [
        (3, 1, "Condition")
    ]
