"""Tests of findings about errors in XML files, YAML files and included files."""

import re
from pathlib import Path

import pytest

from sar_compiler.checks import MOST, check
from sar_compiler.nodes.language.other_engines import REPLACEMENTS
from sar_compiler.nodes.palettes import load_palettes
from sar_compiler.nodes.registry import default_registry, subtree
from sar_compiler.tree.diagnostic import Severity, TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import Forest, load_forest
from sar_compiler.tree.yaml import parse_yaml
from tests.trees import document, forest_of


def places(findings):
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in findings]


# Each: the text of the tree (its first line is line 3), then code, line, column and suggestion.
IN_XML = {
    "a misspelt special attribute": ('<Success _skipif="true"/>', ("unknown-attribute", 3, 10, "_skipIf")),
    "an attribute that is much like a condition": (
        '<Success _failIf="true"/>',
        ("unknown-attribute", 3, 10, "_failureIf"),
    ),
    "an attribute that BehaviorTree.CPP 3 had": (
        '<Parallel threshold="2"><Success/><Failure/></Parallel>',
        ("unknown-attribute", 3, 11, "success_count"),
    ),
    "an attribute of a variant that BehaviorTree.CPP 3 had": (
        '<Parallel policy="SuccessOnAll" failure_threshold="1"><Success/><Failure/></Parallel>',
        ("unknown-attribute", 3, 33, "failure_count"),
    ),
    "what only a subtree can have": ('<Success _autoremap="true"/>', ("unknown-attribute", 3, 10, None)),
    "a misspelt status": (
        '<Precondition if="1 == 1" else="FAILED"><Success/></Precondition>',
        ("wrong-value", 3, 33, "FAILURE"),
    ),
    "a misspelt policy": (
        '<Parallel policy="SuccessOnAl"><Success/><Failure/></Parallel>',
        ("wrong-value", 3, 19, "SuccessOnAll"),
    ),
    "a selected child that is not there": (
        '<Parallel policy="SuccessOnSelected" selected="lift"><Success name="left"/><Failure/></Parallel>',
        ("wrong-value", 3, 48, "left"),
    ),
    "a number with something left over": (
        '<Delay delay_msec="12abc"><Success/></Delay>',
        ("wrong-value", 3, 20, None),
    ),
    "too few children": (
        '<Switch2 variable="a" case_1="b" case_2="c"><Success/></Switch2>',
        ("missing-child", 3, 1, None),
    ),
    "more failures than children": (
        '<ParallelAll max_failures="3"><Success/><Failure/></ParallelAll>',
        ("out-of-reach", 3, 28, None),
    ),
    "a tree in itself": ('<SubTree ID="Main"/>', ("recursive-tree", 3, 14, None)),
    "a tree that is not there": ('<SubTree ID="Mian"/>', ("unknown-tree", 3, 14, "Main")),
    "an operator of another language": (
        '<Success _skipIf="true and false"/>',
        ("script-error", 3, 24, "&&"),
    ),
    "an action that is said to have children": (
        '<Decorator ID="AlwaysSuccess"/>',
        ("wrong-kind", 3, 1, "Action"),
    ),
    "an action that is said to be a control without children": (
        '<Control ID="AlwaysSuccess"/>',
        ("wrong-kind", 3, 1, "Action"),
    ),
    "a decorator that is said to have several children": (
        '<Control ID="Inverter"><AlwaysSuccess/><Failure/></Control>',
        ("too-many-children", 3, 40, None),
    ),
    "an output that is given a value": (
        '<LoopInt queue="1;2" value="3"><Success/></LoopInt>',
        ("wrong-value", 3, 29, None),
    ),
    "a duration that is none": (
        '<Timeout duration="soon"><Running/></Timeout>',
        ("wrong-value", 3, 20, None),
    ),
}


@pytest.mark.parametrize("name", IN_XML)
def test_language_error_is_reported_with_location(name):
    body, expected = IN_XML[name]
    errors = [f for f in check(forest_of(document(body)), default_registry()) if f.severity.value == "error"]
    assert places(errors) == [expected]


# Content that BehaviorTree.CPP ignores: it is reported, and the tree can be run.
IGNORED_BY_BTCPP = {
    "text between nodes": ("<Sequence>\n<Success/>\nnow <Failure/></Sequence>", ("stray-text", 5, 1, None)),
    "an action that is said to be a condition": (
        '<Condition ID="AlwaysSuccess"/>',
        ("wrong-kind", 3, 1, "Action"),
    ),
    "a decorator that is said to be a control": (
        '<Control ID="Inverter"><AlwaysSuccess/></Control>',
        ("wrong-kind", 3, 1, "Decorator"),
    ),
    "a control that is said to be a decorator": (
        '<Decorator ID="Sequence"><AlwaysSuccess/></Decorator>',
        ("wrong-kind", 3, 1, "Control"),
    ),
}


@pytest.mark.parametrize("name", IGNORED_BY_BTCPP)
def test_content_that_btcpp_ignores_is_reported_but_no_error(name):
    body, expected = IGNORED_BY_BTCPP[name]
    findings = check(forest_of(document(body)), default_registry())
    assert expected in places(findings)
    assert "error" not in {finding.severity.value for finding in findings}


# The text of the tree starts in line 6.
HEAD = "root:\n  children:\n  - BehaviorTree:\n      ID: Main\n      children:\n"
IN_YAML = {
    "a node that is not there": (
        "      - Sequnce:\n          children: [Success, Failure]\n",
        ("unknown-node", 6, 9, "Sequence"),
    ),
    "a flag that is neither": (
        "      - Sequence:\n          memory: ture\n          children: [Success, Failure]\n",
        ("wrong-value", 7, 19, "true"),
    ),
    "a child that is never ticked": (
        "      - Selector:\n          children:\n          - Success\n          - Failure\n",
        ("unreachable-node", 9, 13, None),
    ),
    "a goal that is sent again": (
        (
            "      - Selector:\n          memory: false\n          children:\n          - Sequence:\n"
            "              children: [ZonesRemaining, NavigateToZone]\n          - NavigateToBase\n"
        ),
        ("repeated-effect", 11, 13, None),
    ),
    "a variable that nobody makes": (
        "      - ScriptCondition:\n          code: battery < 20\n",
        ("unwritten-key", 7, 17, None),
    ),
    "an assignment in a condition": (
        (
            "      - Sequence:\n          children:\n          - Script:\n              code: a := 1\n"
            "          - Failure:\n              _skipIf: a = 1\n"
        ),
        ("assignment-as-condition", 11, 26, "=="),
    ),
    "a key without its closing brace": (
        "      - Delay:\n          delay_msec: '{wait'\n          children: [Success]\n",
        ("wrong-value", 7, 24, "{wait}"),
    ),
}


@pytest.mark.parametrize("name", IN_YAML)
def test_error_in_yaml_is_reported_with_location(name):
    text, expected = IN_YAML[name]
    try:
        findings = check(Forest.from_file(parse_yaml(HEAD + text, "test.yaml")), default_registry())
    except TreeError as error:
        findings = list(error.findings)
    assert places(findings) == [expected]


TREE = '<BehaviorTree ID="Main"><Success/></BehaviorTree></root>'


def test_file_without_format_version_is_warning():
    (finding,) = check(forest_of(f"<!-- old -->\n<root>{TREE}"), default_registry())
    assert (finding.severity, *places([finding])[0]) == (Severity.WARNING, "missing-format", 2, 1, None)
    assert 'BTCPP_format="4"' in (finding.hint or "")


def test_included_file_without_format_version_is_reported(tmp_path):
    (tmp_path / "main.xml").write_text(MAIN.format(form="xml"))
    (tmp_path / "parts.xml").write_text(f"<root>{TREE.replace('Main', 'Part')}")
    (finding,) = check(load_forest(tmp_path / "main.xml", read_tree_file), default_registry())
    assert (finding.code, Path(finding.source.path).name) == ("missing-format", "parts.xml")


@pytest.mark.parametrize(
    "text",
    [
        f'<root BTCPP_format="4">{TREE}',
        '<root><TreeNodesModel><Action ID="Fly"/></TreeNodesModel></root>',
    ],
)
def test_file_with_format_version_or_without_trees_has_no_findings(text):
    assert check(forest_of(text), default_registry()) == []


def test_node_name_of_older_version_is_named_as_such():
    (finding,) = check(forest_of(document("<SequenceStar><Success/></SequenceStar>")), default_registry())
    assert finding.message == "there is no node 'SequenceStar' any more, only in BehaviorTree.CPP 3"


@pytest.mark.parametrize("tag", REPLACEMENTS)
def test_hint_for_node_of_other_engine_has_existing_nodes_and_attributes(tag):
    (finding, *_) = check(forest_of(document(f"<{tag}/>")), default_registry())
    assert finding.message == f"there is no node '{tag}', which is known from {REPLACEMENTS[tag].engine}"
    hint = finding.hint or ""
    assert hint.startswith(REPLACEMENTS[tag].hint)
    written = re.findall(r"<(\w+)([^>]*)", hint)
    of_ros = load_palettes(["ros:jazzy"]) if "--model ros:jazzy" in hint else []
    specs = [subtree(), *default_registry().specs(), *of_ros]
    assert written
    for name, attributes in written:
        assert name in {spec.tag for spec in specs}
        names = {each.name for spec in specs if spec.tag == name for each in spec.attributes} | {"ID"}
        assert set(re.findall(r"(\w+)=", re.sub('"[^"]*"', "", attributes))) <= names


REMAP = '<remap internal="goal" external="target"/>'


@pytest.mark.parametrize("where", ["<Sequence>", f"{REMAP}<Sequence>"])
def test_remap_of_version_3_gets_hint_with_subtree_attribute(where):
    inside = "" if REMAP in where else REMAP
    body = f'<Sequence><SubTree ID="Part">{inside}</SubTree><Success/></Sequence>'
    part = f'<BehaviorTree ID="Part">{where}<Success/><Success/></Sequence></BehaviorTree></root>'
    found = check(forest_of(document(body).replace("</root>", part)), default_registry())
    assert [each.code for each in found if each.severity is Severity.ERROR] == ["unknown-node"]
    assert '<SubTree ID="Part" goal="{target}"/>' in (found[0].hint or "")


def test_shared_blackboard_of_tree_gets_hint_with_subtree_attribute():
    text = document("<Success/>").replace('ID="Main"', 'ID="Main" __shared_blackboard="true"')
    (finding,) = check(forest_of(text), default_registry())
    assert (finding.code, finding.severity) == ("ignored-attribute", Severity.WARNING)
    assert (
        finding.hint
        == 'to set this attribute in an element that uses the tree, write <SubTree ID="Main" _autoremap="true"/>'
    )


@pytest.mark.parametrize("place", ["root", "include", "BehaviorTree"])
def test_ignored_attribute_is_warning(place, tmp_path):
    (tmp_path / "parts.xml").write_text(PARTS["xml"].format(body="<Success/>"))
    (tmp_path / "main.xml").write_text(
        MAIN.format(form="xml").replace(f"<{place}", f'<{place} colour="red"', 1)
    )
    (finding,) = check(load_forest(tmp_path / "main.xml", read_tree_file), default_registry())
    assert (finding.code, finding.severity) == ("ignored-attribute", Severity.WARNING)


def test_many_warnings_do_not_hide_error():
    noted = "".join(
        f'<BehaviorTree ID="T{n}" colour="red"><Success/></BehaviorTree>' for n in range(MOST + 1)
    )
    text = f'<root BTCPP_format="4" main_tree_to_execute="Missing">{noted}</root>'
    found = [f.code for f in check(forest_of(text), default_registry()) if f.code != "unused-tree"]
    assert sorted(set(found)) == ["ignored-attribute", "missing-main-tree"]
    assert found.count("ignored-attribute") == MOST + 1


MAIN = (
    '<root BTCPP_format="4" main_tree_to_execute="Main">\n<include path="parts.{form}"/>\n'
    '<BehaviorTree ID="Main"><SubTree ID="Part"/></BehaviorTree>\n</root>\n'
)
PARTS = {
    "xml": '<root BTCPP_format="4">\n<BehaviorTree ID="Part">\n{body}\n</BehaviorTree>\n</root>\n',
    "yaml": "root:\n  children:\n  - BehaviorTree:\n      ID: Part\n      children:\n{body}\n",
}
IN_AN_INCLUDED_FILE = {
    "an unknown node": ("xml", "<Sucess/>", ("unknown-node", 3, 1, "Success")),
    "a child that is never ticked": (
        "xml",
        "<Sequence>\n<Failure/>\n<Success/>\n</Sequence>",
        ("unreachable-node", 5, 1, None),
    ),
    "an action that is repeated": (
        "xml",
        '<Sequence memory="false">\n<AdvanceZone/>\n<NavigateToZone/>\n</Sequence>',
        ("repeated-effect", 4, 1, None),
    ),
    "a key that it is not given": (
        "xml",
        '<ScriptCondition code="far &gt; 1"/>',
        ("unwritten-key", 3, 24, None),
    ),
    "a child in YAML": (
        "yaml",
        "      - Sequence:\n          children:\n          - Failure\n          - Success",
        ("unreachable-node", 9, 13, None),
    ),
}


@pytest.mark.parametrize("name", IN_AN_INCLUDED_FILE)
def test_error_in_included_file_names_that_file(name, tmp_path):
    form, body, expected = IN_AN_INCLUDED_FILE[name]
    (tmp_path / "main.xml").write_text(MAIN.format(form=form))
    (tmp_path / f"parts.{form}").write_text(PARTS[form].format(body=body))
    (finding,) = check(load_forest(tmp_path / "main.xml", read_tree_file), default_registry())
    assert finding.source.path.endswith(f"parts.{form}")
    assert places([finding]) == [expected]


def test_files_that_include_each_other_are_reported(tmp_path):
    for one, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{one}.xml").write_text(
            f'<root BTCPP_format="4" main_tree_to_execute="a">\n<include path="{other}.xml"/>\n'
            f'<BehaviorTree ID="{one}"><Success/></BehaviorTree></root>'
        )
    findings = check(load_forest(tmp_path / "a.xml", read_tree_file), default_registry())
    assert [f.code for f in findings] == ["include-cycle"]


def test_trees_of_included_file_need_not_be_used(tmp_path):
    (tmp_path / "main.xml").write_text(MAIN.format(form="xml"))
    text = (
        PARTS["xml"]
        .format(body="<Success/>")
        .replace("</root>", '<BehaviorTree ID="Other"><Success/></BehaviorTree></root>')
    )
    (tmp_path / "parts.xml").write_text(text)
    assert check(load_forest(tmp_path / "main.xml", read_tree_file), default_registry()) == []
