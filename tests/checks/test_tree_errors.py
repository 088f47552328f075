"""Tests that each error in a tree file has one finding, with its location."""

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import Forest
from tests.trees import document, forest_of


@pytest.fixture(scope="module")
def registry() -> Registry:
    return default_registry()


def findings_in(text, registry):
    findings = check(forest_of(text), registry)
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in findings]


# Each: the text of the tree (its first line is line 3), then code, line, column and suggestion.
IN_A_TREE = {
    "more successes than children": (
        '<Parallel success_count="3"><Success/><Failure/></Parallel>',
        "out-of-reach",
        3,
        26,
        None,
    ),
    "two children that interrupt each other": (
        "<ReactiveSequence><AsyncSequence><Success/></AsyncSequence>\n<AsyncSequence><Success/></AsyncSequence></ReactiveSequence>",
        "interrupted-child",
        4,
        1,
        None,
    ),
    "a condition that says nothing": ('<ScriptCondition code=""/>', "script-error", 3, 24, None),
    "an unknown tag": ("<Sequnce><Success/></Sequnce>", "unknown-node", 3, 1, "Sequence"),
    "a tag in the wrong case": ("<inverter><Success/></inverter>", "unknown-node", 3, 1, "Inverter"),
    "a tag like nothing known": ("<Xyzzy/>", "unknown-node", 3, 1, None),
    "a tree in a tree": ("<Sequence><BehaviorTree/></Sequence>", "unknown-node", 3, 11, None),
    "an unknown attribute": ('<Success nmae="a"/>', "unknown-attribute", 3, 10, "name"),
    "a misspelt memory attribute": (
        '<Sequence memroy="true"><Success/></Sequence>',
        "unknown-attribute",
        3,
        11,
        "memory",
    ),
    "memory neither true nor false": (
        '<Sequence\n memory="ture"><Success/></Sequence>',
        "wrong-value",
        4,
        10,
        "true",
    ),
    "a number that is none": ('<Timeout duration="fast"><Running/></Timeout>', "wrong-value", 3, 20, None),
    "a duration in words": (
        '<Timeout duration="30 sec"><Running/></Timeout>',
        "wrong-value",
        3,
        20,
        "30s",
    ),
    "a duration with a decimal comma": ('<Timer duration="1,5"/>', "wrong-value", 3, 18, "1.5"),
    "a duration with a unit that is none": ('<Timer duration="2m"/>', "wrong-value", 3, 18, None),
    "a duration where a number of times is meant": (
        '<Retry num_failures="5s"><Success/></Retry>',
        "wrong-value",
        3,
        22,
        None,
    ),
    "an integer with an exponent": (
        '<Retry num_failures="1e3"><Success/></Retry>',
        "wrong-value",
        3,
        22,
        "1000",
    ),
    "a comma that means thousands or a fraction": (
        '<Retry num_failures="1,000"><Success/></Retry>',
        "wrong-value",
        3,
        22,
        None,
    ),
    "a number of too many digits": (
        f'<Retry num_failures="{"9" * 5000}"><Success/></Retry>',
        "wrong-value",
        3,
        22,
        None,
    ),
    "a mistake behind a lone carriage return": (
        "<Sequence>\r<Sucess/></Sequence>",
        "unknown-node",
        4,
        1,
        "Success",
    ),
    "a fraction for an integer": (
        '<Retry num_failures="2.5"><Success/></Retry>',
        "wrong-value",
        3,
        22,
        None,
    ),
    "a missing attribute": ("<Retry><Success/></Retry>", "missing-attribute", 3, 1, None),
    "a decorator without a child": ('<Inverter name="a"/>', "missing-child", 3, 1, None),
    "a decorator with two children": (
        "<Inverter>\n<Success/>\n<Failure/></Inverter>",
        "too-many-children",
        5,
        1,
        None,
    ),
    "a switch without a child for all other cases": (
        '<Switch2 variable="x" case_1="1" case_2="2">\n<Success/>\n<Failure/></Switch2>',
        "missing-child",
        3,
        1,
        None,
    ),
    "a catch with nothing to try": ("<TryCatch><Success/></TryCatch>", "missing-child", 3, 1, None),
    "a leaf with a child": ("<ZonesRemaining><Success/></ZonesRemaining>", "child-of-leaf", 3, 17, None),
    "an empty composite": ("<Sequence></Sequence>", "empty-control", 3, 1, None),
    "a tree without a node": ("", "missing-child", 2, 1, None),
    "a tree with two nodes": ("<Success/>\n<Failure/>", "too-many-children", 4, 1, None),
    "a wrong policy": ('<OneShot policy="ONCE"><Success/></OneShot>', "wrong-value", 3, 18, None),
    "a misspelt policy": (
        '<OneShot policy="ON_COMPLETON"><Success/></OneShot>',
        "wrong-value",
        3,
        18,
        "ON_COMPLETION",
    ),
    "no policy": ("<OneShot><Success/></OneShot>", "missing-attribute", 3, 1, None),
    "a wrong oneshot attribute": (
        '<Success oneshot="on_completion"/>',
        "wrong-value",
        3,
        19,
        "ON_COMPLETION",
    ),
    "a reactive node that is told to remember": (
        '<ReactiveFallback memory="true"><Success/></ReactiveFallback>',
        "conflicting-attributes",
        3,
        27,
        "false",
    ),
    "a key where the tag says the value": (
        '<ReactiveFallback memory="{a}"><Success/></ReactiveFallback>',
        "wrong-value",
        3,
        27,
        None,
    ),
    "a reference to a node that is not there": (
        '<Sequence><DetectSurvivor/><IsSurvivorDetected detect_node="DetectSurvivr"/></Sequence>',
        "unknown-reference",
        3,
        61,
        "DetectSurvivor",
    ),
    "a reference to a node of another kind": (
        '<Sequence><DetectSurvivor/><AdvanceZone/><NotifyBase detect_node="AdvanceZone"/></Sequence>',
        "wrong-reference",
        3,
        67,
        "DetectSurvivor",
    ),
    "a reference to one of two nodes of the same name": (
        '<Sequence><DetectSurvivor/><DetectSurvivor/><NotifyBase detect_node="DetectSurvivor"/></Sequence>',
        "ambiguous-reference",
        3,
        70,
        None,
    ),
    "no reference where there are two to choose from": (
        '<Sequence><DetectSurvivor name="a"/><DetectSurvivor name="b"/><NotifyBase/></Sequence>',
        "ambiguous-reference",
        3,
        63,
        None,
    ),
    "no node to refer to": ("<NotifyBase/>", "missing-reference", 3, 1, None),
}


@pytest.mark.parametrize("name", IN_A_TREE)
def test_error_in_tree_is_reported_with_location(name, registry):
    body, *expected = IN_A_TREE[name]
    assert findings_in(document(body), registry) == [tuple(expected)]


TREE = '<BehaviorTree ID="A"><Success/></BehaviorTree>'
OTHER = '<BehaviorTree ID="B"><Success/></BehaviorTree>'
USING = '<BehaviorTree ID="B"><SubTree ID="A"/></BehaviorTree>'

IN_A_FILE = {
    "a prefix that is not bound": (
        f'<root BTCPP_format="4" xsi:noNamespaceSchemaLocation="a.xsd">\n{TREE}</root>',
        "schema",
        1,
        1,
        None,
    ),
    "another root": (f"<trees>{TREE}</trees>", "wrong-root", 1, 1, None),
    "a root attribute that is unknown": (
        f'<root BTCPP_format="4" main_tree_to_exec="A">{TREE}</root>',
        "unknown-attribute",
        1,
        24,
        "main_tree_to_execute",
    ),
    "an element beside the trees": (
        f'<root BTCPP_format="4">{TREE}<BehaviourTree/></root>',
        "unknown-element",
        1,
        70,
        "BehaviorTree",
    ),
    "no tree": ('<root BTCPP_format="4"/>', "no-tree", 1, 1, None),
    "a main tree that is not there": (
        f'<root BTCPP_format="4"\nmain_tree_to_execute="MainTree">{TREE.replace("A", "Maintree")}</root>',
        "missing-main-tree",
        2,
        23,
        "Maintree",
    ),
    "a second model": (
        f'<root BTCPP_format="4">{TREE}<TreeNodesModel/>\n<TreeNodesModel/></root>',
        "duplicate-model",
        2,
        1,
        None,
    ),
    "two trees of one ID": (
        f'<root BTCPP_format="4" main_tree_to_execute="A">{TREE}\n{TREE}</root>',
        "duplicate-tree-id",
        2,
        19,
        None,
    ),
    "the ID of a node": (
        '<root BTCPP_format="4"><BehaviorTree ID="Sequence"><Success/></BehaviorTree></root>',
        "wrong-tree-id",
        1,
        42,
        None,
    ),
    "the ID of what uses trees": (
        '<root BTCPP_format="4"><BehaviorTree ID="SubTree"><Success/></BehaviorTree></root>',
        "wrong-tree-id",
        1,
        42,
        None,
    ),
    "an empty ID": (
        '<root BTCPP_format="4"><BehaviorTree ID=""><Success/></BehaviorTree></root>',
        "missing-tree-id",
        1,
        42,
        None,
    ),
    "no ID where there are several trees": (
        f'<root BTCPP_format="4" main_tree_to_execute="A">{TREE}\n<BehaviorTree><Success/></BehaviorTree></root>',
        "missing-tree-id",
        2,
        1,
        None,
    ),
    "an attribute that trees do not have": (
        '<root BTCPP_format="4"><BehaviorTree id="A"><Success/></BehaviorTree></root>',
        "unknown-attribute",
        1,
        38,
        "ID",
    ),
}


@pytest.mark.parametrize("name", IN_A_FILE)
def test_error_outside_trees_is_reported_with_location(name, registry):
    text, *expected = IN_A_FILE[name]
    assert findings_in(text, registry) == [tuple(expected)]


@pytest.mark.parametrize(
    ("text", "code", "column"),
    [
        (f'<root BTCPP_format="3">{TREE}</root>', "wrong-format", 21),
        (f'<root BTCPP_format="4">{TREE}<Sequence/></root>', "unknown-element", 70),
    ],
)
def test_content_outside_trees_that_btcpp_ignores_is_warning(text, code, column, registry):
    findings = check(forest_of(text), registry)
    assert [(f.code, f.span.column) for f in findings if f.severity is Severity.WARNING] == [(code, column)]
    assert Severity.ERROR not in {f.severity for f in findings}


def test_all_errors_are_reported_at_once_in_file_order(registry):
    body = '<Selector memory="no">\n<Sequence/>\n<Inverter colour="red"><Sucess/></Inverter>\n</Selector>'
    assert [code for code, *_ in findings_in(document(body), registry)] == [
        "wrong-value",
        "empty-control",
        "unknown-attribute",
        "unknown-node",
    ]


def test_unused_trees_are_checked(registry):
    text = f'<root BTCPP_format="4" main_tree_to_execute="A">{TREE}\n<BehaviorTree ID="B"><Sucess/></BehaviorTree></root>'
    assert [(code, line) for code, line, *_ in findings_in(text, registry)] == [("unknown-node", 2)]


@pytest.mark.parametrize("broken", ["<DetectSurviver/>", '<Xyzzy name="DetectSurvivor"/>'])
def test_misspelt_node_causes_no_second_finding_at_references(broken, registry):
    body = f'<Sequence>{broken}<NotifyBase detect_node="DetectSurvivor"/></Sequence>'
    assert [code for code, *_ in findings_in(document(body), registry)] == ["unknown-node"]


def test_message_names_remedy(registry):
    text = document("<Retry><NotifyBase/></Retry>")
    retry, notify = [f.render() for f in check(forest_of(text), registry)]
    assert retry.endswith('write num_failures="..." (an integer)')
    assert notify.endswith("add a <DetectSurvivor> to the tree")


CORRECT = {
    "durations with their units": (
        '<Sequence><Delay delay_msec="0.5s"><Timer duration="250ms"/></Delay><Sleep msec="2min"/>'
        '<Timeout duration="1min"><Sleep msec="1500"/></Timeout><DetectSurvivor timeout_sec="500ms"/></Sequence>'
    ),
    "lone carriage returns": "<Sequence>\r\t<Success/>\r\t<Failure/>\r</Sequence>",
    "a leaf with nothing but a comment in it": "<Success>\n<!-- why not -->\n</Success>",
    "names that are not tags": '<Success name="Is it fine? / yes!"/>',
    "a key of the blackboard": '<Timeout duration="{@patience}"><Running/></Timeout>',
    "a reactive node that says so twice": '<ReactiveSequence memory="false"><Success/><Failure/></ReactiveSequence>',
    "a oneshot on any node": '<Sequence oneshot="ON_SUCCESSFUL_COMPLETION"><Success oneshot="ON_COMPLETION"/><Failure/></Sequence>',
    "a reference found by itself": "<Sequence><DetectSurvivor/><NotifyBase/></Sequence>",
    "a reference by name to one of two": (
        '<Sequence><DetectSurvivor name="a"/><DetectSurvivor/><NotifyBase detect_node="a"/></Sequence>'
    ),
}


@pytest.mark.parametrize("name", CORRECT)
def test_correct_tree_has_no_findings(name, registry):
    assert findings_in(document(CORRECT[name]), registry) == []


@pytest.mark.parametrize(
    "text",
    [
        f'<root BTCPP_format="4">{TREE}</root>',
        f'<root BTCPP_format="4" main_tree_to_execute="B">{TREE}{USING}</root>',
        '<root BTCPP_format="4"><BehaviorTree><Success/></BehaviorTree></root>',
        f'<root BTCPP_format="4" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="a.xsd">{TREE}</root>',
        f'<root BTCPP_format="4">{TREE}<TreeNodesModel><Action ID="X"><input_port name="y"/></Action></TreeNodesModel></root>',
        f'<?xml version="2.0"?>\n<root BTCPP_format="4">{TREE}</root>',
        f'<?xml version="1.0" encoding="ISO-8859-1"?><root BTCPP_format="4">{TREE}</root>',
    ],
)
def test_correct_file_has_no_findings(text, registry):
    assert findings_in(text, registry) == []


def test_shipped_tree_has_no_findings(registry):
    assert check(Forest.from_file(read_tree_file("trees/search_and_rescue.xml")), registry) == []
