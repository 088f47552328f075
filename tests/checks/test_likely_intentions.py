"""Tests that one error has one finding, which names the likely intention."""

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.binding.attributes import CONDITIONS, NOTES
from sar_compiler.nodes.registry import default_registry
from sar_compiler.nodes.values import join_with_commas
from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form, Severity, TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import Forest, load_forest
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from tests.trees import document, forest_of


def places(findings):
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in findings]


def findings_in(text):
    return places(check(forest_of(text), default_registry()))


# Each: the text of the tree (its first line is line 3), then code, line, column and suggestion.
IN_A_TREE = {
    "a node's name of BehaviorTree.CPP 3": (
        "<SequenceStar><LogNoDetection/><NavigateToBase/></SequenceStar>",
        ("unknown-node", 3, 1, "SequenceWithMemory"),
    ),
    "a misspelt explicit form": (
        '<Decorater ID="Inverter"><NavigateToBase/></Decorater>',
        ("unknown-node", 3, 1, "Decorator"),
    ),
    "an explicit form in the wrong case": (
        '<action ID="NavigateToBase"/>',
        ("unknown-node", 3, 1, "Action"),
    ),
    "an ID in the wrong case": ('<Action Id="NavigateToBase"/>', ("unknown-attribute", 3, 9, "ID")),
    "an ID of a subtree in the wrong case": ('<SubTree id="Main"/>', ("unknown-attribute", 3, 10, "ID")),
    "an ID of a subtree in another attribute": (
        '<SubTree goal="{goal}" tree="Main"/>',
        ("unknown-attribute", 3, 24, "ID"),
    ),
    "a subtree that has the name of a tree, and no ID": (
        '<SubTree name="Main"/>',
        ("missing-attribute", 3, 1, None),
    ),
    "a condition without its underscore": (
        '<NavigateToBase skipIf="true"/>',
        ("unknown-attribute", 3, 17, "_skipIf"),
    ),
    "a condition in words with underscores": (
        '<NavigateToBase _skip_if="true"/>',
        ("unknown-attribute", 3, 17, "_skipIf"),
    ),
    "an attribute of the other library": (
        '<Retry num_attempts="3"><NavigateToBase/></Retry>',
        ("unknown-attribute", 3, 8, "num_failures"),
    ),
    "an attribute of a like node": (
        '<Delay msec="100"><NavigateToBase/></Delay>',
        ("unknown-attribute", 3, 8, "delay_msec"),
    ),
    "an attribute that may be one of two": (
        '<Timeout seconds="5"><NavigateToBase/></Timeout>',
        ("unknown-attribute", 3, 10, None),
    ),
    "two attributes that do not go together": (
        '<Timeout duration="3" msec="3000"><NavigateToBase/></Timeout>',
        ("conflicting-attributes", 3, 23, None),
    ),
    "an output without braces": (
        '<LoopInt queue="1;2" value="each"><NavigateToBase/></LoopInt>',
        ("wrong-value", 3, 29, "{each}"),
    ),
    "a policy as an enumeration is written": (
        '<Parallel policy="SUCCESS_ON_ALL"><Sleep msec="500"/><NavigateToBase/></Parallel>',
        ("wrong-value", 3, 19, "SuccessOnAll"),
    ),
    "a key that is written in the line above, without its braces": (
        '<Sequence><Script code="pause := 5"/>\n<Sleep msec="pause"/></Sequence>',
        ("wrong-value", 4, 14, "{pause}"),
    ),
    "a key that a node writes by its name, without braces": (
        '<Sequence><SetBlackboard output_key="pause" value="5"/>\n<Sleep msec="pause"/></Sequence>',
        ("wrong-value", 4, 14, "{pause}"),
    ),
    "a word that is no key": ('<Sleep msec="long"/>', ("wrong-value", 3, 14, None)),
    "a key as shells write it": ('<Sleep msec="${pause}"/>', ("wrong-value", 3, 14, "{pause}")),
    "a key in two pairs of braces": ('<Sleep msec="{{pause}}"/>', ("unwritten-key", 3, 14, "{pause}")),
    "a key as shells write it in a script": (
        '<ScriptCondition code="${pause}"/>',
        ("script-error", 3, 24, None),
    ),
    "an if in a script": ('<Script code="if (@a == 1) { @b := 2 }"/>', ("script-error", 3, 15, None)),
    "a loop in a script": ('<Script code="@a := 1; while (@a) @a = 0"/>', ("script-error", 3, 24, None)),
    "a decimal comma in a script": ('<Script code="@b := 1,5"/>', ("script-error", 3, 22, None)),
    "an include in a tree": (
        '<Sequence><NavigateToBase/>\n<include path="a.xml"><Foo/></include></Sequence>',
        ("unknown-node", 4, 1, None),
    ),
    "a model in a tree": (
        '<Sequence><NavigateToBase/>\n<TreeNodesModel><Action ID="X"><input_port name="y"/></Action></TreeNodesModel></Sequence>',
        ("unknown-node", 4, 1, None),
    ),
    "a sharing of the blackboard of BehaviorTree.CPP 3": (
        '<SubTree ID="Main" __shared_blackboard="true"/>',
        ("unknown-attribute", 3, 20, "_autoremap"),
    ),
}


@pytest.mark.parametrize("name", IN_A_TREE)
def test_error_in_tree_has_one_finding_with_suggestion(name):
    body, expected = IN_A_TREE[name]
    findings = [f for f in findings_in(document(body)) if f[0] != "recursive-tree"]
    assert findings == [expected]


def test_root_in_wrong_case_gets_suggestion():
    text = '<Root BTCPP_format="4"><BehaviorTree ID="Main"><NavigateToBase/></BehaviorTree></Root>'
    assert findings_in(text) == [("wrong-root", 1, 1, "root")]


def test_misspelt_tree_element_is_not_also_reported_as_missing():
    text = '<root BTCPP_format="4">\n<BehaviourTree ID="Main"><NavigateToBase/></BehaviourTree></root>'
    assert findings_in(text) == [("unknown-element", 2, 1, "BehaviorTree")]


def test_misspelt_tree_element_is_not_reported_at_its_use():
    text = document('<SubTree ID="Side"/>').replace(
        "</root>", '<Behaviortree ID="Side"><NavigateToBase/></Behaviortree></root>'
    )
    assert [code for code, *_ in findings_in(text)] == ["unknown-element"]


SUBTREE = (
    '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">\n{main}\n</BehaviorTree>'
    '<BehaviorTree ID="Rest">\n{rest}\n</BehaviorTree></root>'
)


@pytest.mark.parametrize(
    ("written", "meant"), [("autoremap", "_autoremap"), ("skipIf", "_skipIf"), ("onsuccess", "_onSuccess")]
)
def test_subtree_attribute_without_underscore_gets_suggestion(written, meant):
    text = SUBTREE.format(main=f'<SubTree ID="Rest" {written}="true"/>', rest="<NavigateToBase/>")
    assert findings_in(text) == [("unused-argument", 2, 20, meant)]


def test_unwritten_key_passed_to_subtree_is_found_at_argument():
    main = '<Sequence><Script code="pause := 5"/>\n<SubTree ID="Rest" time="{puase}"/><ScriptCondition code="pause == 5"/></Sequence>'
    text = SUBTREE.format(main=main, rest='<Sleep msec="{time}"/>')
    assert findings_in(text) == [("unwritten-key", 3, 26, "{pause}")]


def test_key_in_misspelt_argument_is_not_also_reported_as_unread():
    main = '<Sequence><Script code="pause := 5"/>\n<SubTree ID="Rest" tiem="{pause}"/></Sequence>'
    text = SUBTREE.format(main=main, rest='<Sleep msec="{time}"/>')
    assert findings_in(text) == [("unused-argument", 3, 20, "time")]


def test_tree_with_name_instead_of_id_is_not_also_missing():
    text = SUBTREE.format(main='<SubTree ID="Rest"/>', rest="<NavigateToBase/>").replace(
        'ID="Rest">\n', 'name="Rest">\n'
    )
    assert [(code, suggestion) for code, _, _, suggestion in findings_in(text)] == [
        ("unknown-attribute", "ID")
    ]


def test_main_tree_with_name_instead_of_id_is_not_also_missing():
    text = SUBTREE.format(main='<SubTree ID="Rest"/>', rest="<NavigateToBase/>").replace(
        'ID="Main">', 'name="Main">'
    )
    assert [(code, suggestion) for code, _, _, suggestion in findings_in(text)] == [
        ("unknown-attribute", "ID")
    ]


def test_string_for_output_of_subtree_is_found_at_argument():
    main = '<SubTree ID="Rest"\nfound="yes"/>'
    model = '<TreeNodesModel><SubTree ID="Rest"><output_port name="found"/></SubTree></TreeNodesModel>'
    text = SUBTREE.format(main=main, rest='<Script code="found := 1"/>').replace("</root>", f"{model}</root>")
    assert ("unwritten-key", 3, 8, "{yes}") in findings_in(text)
    assert not any(code == "unwritten-key" for code, *_ in findings_in(text.replace('"yes"', '"{yes}"')))


INCLUDING = (
    '<root BTCPP_format="4" main_tree_to_execute="Main">\n<include {include}/>\n'
    '<BehaviorTree ID="Main"><SubTree ID="Part"/></BehaviorTree></root>'
)
PART = '<root BTCPP_format="4">\n<BehaviorTree ID="Part"><NavigateToBase/></BehaviorTree>{end}'


def findings_with_include(folder, include, end="</root>"):
    (folder / "main.xml").write_text(INCLUDING.format(include=include))
    (folder / "parts.xml").write_text(PART.format(end=end))
    findings = check(load_forest(folder / "main.xml", read_tree_file), default_registry())
    return [
        (f.source.path.rpartition("/")[2], *place)
        for f, place in zip(findings, places(findings), strict=True)
    ]


def test_missing_include_suggests_similar_file(tmp_path):
    assert findings_with_include(tmp_path, 'path="./part.xml"') == [
        ("main.xml", "unreadable-include", 2, 16, "./parts.xml")
    ]


def test_wrong_attribute_for_include_path_gets_suggestion(tmp_path):
    assert findings_with_include(tmp_path, 'file="parts.xml"') == [
        ("main.xml", "unknown-attribute", 2, 10, "path")
    ]


def test_trees_of_malformed_file_are_not_also_missing(tmp_path):
    findings = findings_with_include(tmp_path, 'path="parts.xml"', end="")
    assert [(file, code) for file, code, *_ in findings] == [("parts.xml", "malformed-xml")]


def syntax_error_in(body):
    try:
        (finding,) = parse_xml(f"<root>\n{body}\n</root>").findings
    except TreeError as error:
        (finding,) = error.findings
    return finding.span.line, finding.span.column, finding.suggestion, finding.message


MALFORMED = {
    "ampersands of a script": ('<A code="a && b"/>', 2, 12, "&amp;&amp;", "&amp;"),
    "an ampersand in a text": ('<A name="a & b"/>', 2, 12, "&amp;", "&amp;"),
    "an ampersand before a word": ('<A name="a &b"/>', 2, 12, "&amp;", "&amp;"),
    "a comparison in a script": ('<A code="a > 1; a < 3"/>', 2, 19, "&lt;", "&lt;"),
    "a value without an end": ('<A name="x>\n<B/></A>', 2, 9, None, "no closing quotation mark"),
    "a value without quotes": ("<A name=x/>", 2, 9, None, "must be in quotes"),
    "an entity of HTML": ('<A code="a &lt; b" name="a&nbsp;b"/>', 2, 27, None, "'&nbsp;'"),
    "two hyphens in a comment": ("<!-- a -- b -->", 2, 8, "- -", "comment"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_xml_syntax_error_has_location_and_suggestion(name):
    body, line, column, suggestion, words = MALFORMED[name]
    *place, message = syntax_error_in(body)
    assert place == [line, column, suggestion]
    assert words in message


@pytest.mark.parametrize("name", ["child", "nodes"])
def test_wrong_name_for_children_in_yaml_gets_suggestion(name):
    text = (
        "root:\n  children:\n  - BehaviorTree:\n      children:\n      - Sequence:\n"
        f"          {name}:\n          - LogNoDetection\n          - NavigateToBase\n"
    )
    with pytest.raises(TreeError) as caught:
        check(Forest.from_file(parse_yaml(text, "test.yaml")), default_registry())
    assert places(caught.value.findings) == [("wrong-shape", 6, 11, "children")]


NOTED = (
    '<root BTCPP_format="4" main_tree_to_execute="Main" {0}><BehaviorTree ID="Main" {0}>'
    '<Sequence {0}><LogNoDetection {0}/><SubTree ID="Home" {0}/></Sequence></BehaviorTree>'
    '<BehaviorTree ID="Home"><Action ID="NavigateToBase" {0}/></BehaviorTree></root>'
)


@pytest.mark.parametrize(
    "note", [*NOTES, "_hidden", "_id", "_note", "_x", "_position", "_größe", "_skip_list", "_on"]
)
def test_editor_note_is_accepted_in_every_element(note):
    assert findings_in(NOTED.format(f'{note}="1"')) == []
    yaml = convert(parse_xml(NOTED.format(f'{note}="1"')), Form.YAML).text
    assert yaml.count(note) == 6
    assert check(Forest.from_file(parse_yaml(yaml, "test.yaml")), default_registry()) == []


@pytest.mark.parametrize(
    "name", ["_skipWhen", "_onExit", "_whileNot", "_successWhen", "_failureOn", "_postScript"]
)
@pytest.mark.parametrize("node", ["<NavigateToBase {}/>", '<SubTree ID="Rest" {}/>'])
def test_note_named_like_condition_is_warning(node, name):
    text = SUBTREE.format(main=node.format(f'{name}="true"'), rest="<NavigateToBase/>")
    [finding] = [each for each in check(forest_of(text), default_registry()) if each.code != "unused-tree"]
    assert (finding.code, finding.severity) == ("unknown-attribute", Severity.WARNING)
    assert (finding.span.line, finding.span.column) == (2, node.index("{") + 1)
    assert finding.hint == f"known conditions: {join_with_commas(CONDITIONS)}"


LIKE_NOTES = {
    "_onlyIf": ("ready == 1", 'write _skipIf="!(ready == 1)"'),
    "_if": ("ready", 'write _skipIf="!(ready)"'),
    "_when": ("ready", 'write _skipIf="!(ready)"'),
    "_unless": ("ready", 'write _skipIf="ready"'),
    "_precondition": ("ready", f"known conditions: {join_with_commas(CONDITIONS)}"),
    "_condition": ("ready", f"known conditions: {join_with_commas(CONDITIONS)}"),
    "_guard": ("ready == 1", f"known conditions: {join_with_commas(CONDITIONS)}"),
    "_needs": ("ready", f"known conditions: {join_with_commas(CONDITIONS)}"),
    "_timeout": ("5", "put the node into a decorator: <Timeout>"),
    "_timeoutMs": ("5000", "put the node into a decorator: <Timeout>"),
    "_repeat": ("3", "put the node into a decorator: <Repeat>"),
    "_retry": ("{tries}", "put the node into a decorator: <RetryUntilSuccessful>"),
    "_run_once": ("true", "put the node into a decorator: <RunOnce>"),
}


@pytest.mark.parametrize("name", LIKE_NOTES)
def test_note_that_seems_to_control_node_is_warning_with_hint(name):
    value, hint = LIKE_NOTES[name]
    text = document(f'<Sequence><Script code="ready := 1"/><NavigateToBase {name}="{value}"/></Sequence>')
    [finding] = [
        each for each in check(forest_of(text), default_registry()) if each.severity is not Severity.INFO
    ]
    assert (finding.code, finding.severity, finding.hint) == ("unknown-attribute", Severity.WARNING, hint)


@pytest.mark.parametrize(
    "value", ["see issue 5", "left to right", "-12", "a-b", "1;2", "other", "x", "#fff", "1 < 2"]
)
def test_note_whose_value_is_no_condition_is_accepted(value):
    text = document(
        f'<Sequence><Script code="ready := 1"/><NavigateToBase _mine="{value.replace("<", "&lt;")}"/></Sequence>'
    )
    assert "unknown-attribute" not in [code for code, *_ in findings_in(text)]


@pytest.mark.parametrize("place", ["root", "BehaviorTree", "include"])
def test_condition_outside_node_is_unknown_attribute(place):
    text = (
        '<root BTCPP_format="4"><include path="a.xml"/><BehaviorTree ID="A"><Success/></BehaviorTree></root>'
    )
    codes = [code for code, *_ in findings_in(text.replace(f"<{place}", f'<{place} _skipIf="true"'))]
    assert "unknown-attribute" in codes


@pytest.mark.parametrize(
    ("former", "today"),
    [
        ("Chooser", "Selector"),
        ("FallbackStar", "Fallback"),
        ("ReactiveSelector", "ReactiveFallback"),
        ("SequenceStar", "SequenceWithMemory"),
        ("SubTreePlus", "SubTree"),
        *((f"BlackboardCheck{kind}", "Precondition") for kind in ("Bool", "Double", "Int", "String")),
    ],
)
def test_former_node_name_suggests_current_name(former, today):
    assert findings_in(document(f"<{former}><Success/></{former}>"))[0] == ("unknown-node", 3, 1, today)


@pytest.mark.parametrize("tag", ["CheckCondition", "LogTextAction", "NavigateToPose", "IsSurvivorFound"])
def test_foreign_node_does_not_suggest_mission_leaf(tag):
    [(code, _, _, suggestion)] = findings_in(document(f"<{tag}/>"))
    assert (code, suggestion) == ("unknown-node", None)


def test_mission_leaf_is_suggested_beside_another_leaf_of_mission():
    [alone] = findings_in(document("<NavigateZones/>"))
    beside = findings_in(document("<Sequence><NavigateToBase/>\n<NavigateZones/></Sequence>"))
    assert (alone[3], [each[3] for each in beside]) == (None, ["NavigateToZone"])


def test_small_typo_in_mission_leaf_gets_suggestion():
    assert findings_in(document("<NavigateToBse/>")) == [("unknown-node", 3, 1, "NavigateToBase")]


def test_tag_that_is_tree_id_gets_subtree_hint():
    text = SUBTREE.format(main="<Rest/>", rest="<NavigateToBase/>")
    [finding] = [each for each in check(forest_of(text), default_registry()) if each.code == "unknown-node"]
    assert finding.message == "there is no node 'Rest', but there is a tree of this name"
    assert (finding.suggestion, finding.hint) == (None, 'write <SubTree ID="Rest"/>')
