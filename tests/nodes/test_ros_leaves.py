"""Tests of the checks of ROS leaves: types, fields, values and keys, with and without ROS."""

from pathlib import Path

import pytest

from sar_compiler.analysis.simulated_tree import compile_simulated
from sar_compiler.errors import SarError
from sar_compiler.loaded_tree import load
from sar_compiler.nodes import ros_leaves
from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form
from sar_compiler.tree.xml import parse_xml
from tests.trees import document

BOOL = 'type="std_srvs/srv/SetBool"'
POSES = 'type="nav2_msgs/action/NavigateThroughPoses"'
# By name: the XML, and the code, the marked part and the message of the finding.
ERRORS = {
    "a field of the request": (f'<RosService service="a" {BOOL} request="dta: true"/>', "wrong-value", "dta", "request: there is no field 'dta'"),
    "a value": (f'<RosService service="a" {BOOL} request="{{data: 5}}"/>', "wrong-value", "5", "request: data is 5, but must be boolean, true or false"),
    "a field of a list's element": (
        f'<RosAction action="a" {POSES} goal="poses: [{{}}, {{pose: {{positon: {{x: {{@speed}}}}}}}}]"/>',
        "wrong-value", "positon", "goal: there is no field 'poses[1].pose.positon'",
    ),
    "a field of the answer": (f'<RosService service="a" {BOOL} field="mesage" value="{{b}}"/>', "wrong-value", "mesage", "field: there is no field 'mesage'"),
    "one of several": (f'<RosAction action="a" {POSES} fields="error_code: {{c}}, error_mag: {{d}}"/>', "wrong-value", "error_mag", "fields: there is no field 'error_mag'"),
    "of the feedback": (f'<RosAction action="a" {POSES} feedback="distance: {{c}}"/>', "wrong-value", "distance", "feedback: there is no field 'distance'"),
    "that must be true": (f'<RosService service="a" {BOOL} success="ok"/>', "wrong-value", "ok", "success: there is no field 'ok'"),
    "of a message": ('<RosPublish topic="a" type="std_msgs/msg/Int8" message="data: 128"/>', "wrong-value", "128", "message: data is 128, but must be int8, an integer from -128 to 127"),
    "of a topic": ('<RosTopic topic="a" type="std_msgs/msg/Int8" field="date" value="{b}"/>', "wrong-value", "date", "field: there is no field 'date'"),
    "a type": ('<RosTopic topic="a" type="std_msgs/msg/Strin"/>', "unknown-interface", "std_msgs/msg/Strin", "type: std_msgs/msg/Strin is not installed"),
    "no key for a field": (f'<RosService service="a" {BOOL} field="message"/>', "missing-attribute", "<RosService", "field: add the attribute 'value' with the key to which the field is written"),
}  # fmt: skip
SYNTAX_ERRORS = {
    "no YAML": (f'<RosService service="a" {BOOL} request="data: ["/>', "wrong-value", "[", "request: 'data: [' is not YAML"),
    "an alias": (f'<RosService service="a" {BOOL} request="a: &amp;x [1], b: *x"/>', "wrong-value", "&amp;x [1]", "request: a YAML alias (*) is not allowed here"),
    "a field without its key": (f'<RosAction action="a" {POSES} fields="error_code: 5"/>', "wrong-value", "5", "fields: 'error_code' needs the key to which the field is written"),
    "a path": (f'<RosService service="a" {BOOL} success="a b"/>', "wrong-value", "a b", "success: 'a b' is not a field path"),
}  # fmt: skip


def findings(leaf: str, folder: Path, form: Form = Form.XML) -> list[tuple[str, str, str]]:
    """Return the findings about a leaf: the code, the part of the file that is marked, and the message."""
    path = folder / f"tree.{form.value}"
    text = document(f"<Sequence>{leaf}</Sequence>" if leaf.count("<") > 1 else leaf)
    path.write_text(convert(parse_xml(text), form).text, encoding="utf-8")
    lines = path.read_text(encoding="utf-8").split("\n")
    found = load(path, models=["ros:jazzy"]).findings
    return [
        (each.code, lines[each.span.line - 1][each.span.column - 1 : each.span.end_column - 1], each.message)
        for each in found
    ]


@pytest.mark.ros
@pytest.mark.parametrize("form", Form)
@pytest.mark.parametrize("name", ERRORS)
def test_error_is_located_if_ros_is_installed(name: str, form: Form, tmp_path: Path) -> None:
    leaf, code, part, said = ERRORS[name]
    (found,) = findings(leaf, tmp_path, form)
    assert found[:2] == (code, part if form is Form.XML else part.removeprefix("<"))
    assert found[2].startswith(said)


@pytest.mark.parametrize("name", ERRORS)
def test_types_and_fields_are_not_checked_without_ros(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_leaves, "is_ros_installed", lambda: False)
    assert findings(ERRORS[name][0], tmp_path) == []


@pytest.mark.parametrize("name", SYNTAX_ERRORS)
def test_syntax_error_is_located_even_without_ros(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_leaves, "is_ros_installed", lambda: False)
    leaf, code, part, said = SYNTAX_ERRORS[name]
    (found,) = findings(leaf, tmp_path)
    assert found[:2] == (code, part)
    assert found[2].startswith(said)


@pytest.mark.ros
@pytest.mark.parametrize("written", ["no_such_msgs/srv/X", "nav2_msgs/srv/NoSuchService"])
def test_interface_that_may_exist_on_other_computer_is_warning(written: str, tmp_path: Path) -> None:
    path = tmp_path / "tree.xml"
    path.write_text(document(f'<RosService service="a" type="{written}"/>'), encoding="utf-8")
    (found,) = load(path, models=["ros:jazzy"]).findings
    assert (found.code, found.severity.value) == ("unknown-interface", "warning")


def test_keys_within_yaml_are_checked_like_those_of_ports(tmp_path: Path) -> None:
    unwritten = f'<RosService service="a" {BOOL} request="data: {{on}}"/>'
    assert [each[:2] for each in findings(unwritten, tmp_path)] == [("unwritten-key", "on")]
    written = f'<RosTopic topic="b" type="std_msgs/msg/Bool" fields="data: {{on}}"/>{unwritten}'
    assert findings(written, tmp_path) == []
    misspelt = (
        '<RosTopic topic="b" type="std_msgs/msg/Bool" fields="data: { lamp }"/>'
        f'<RosService service="a" {BOOL} request="data: {{lmap}}"/>'
    )
    assert [each[:2] for each in findings(misspelt, tmp_path)] == [("unwritten-key", "lmap")]


def test_subtree_reads_passed_keys(tmp_path: Path) -> None:
    path = tmp_path / "tree.xml"
    inner = f'<RosService service="{{which}}" {BOOL} request="data: {{on}}"/>'
    path.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">'
        '<SubTree ID="Switch" which="switch" on="true"/></BehaviorTree>'
        f'<BehaviorTree ID="Switch">{inner}</BehaviorTree></root>',
        encoding="utf-8",
    )
    tree = load(path, models=["ros:jazzy"])
    assert [each.code for each in tree.findings] == []


def test_uses_contain_only_servers_whose_name_is_known_at_start(tmp_path: Path) -> None:
    path = tmp_path / "tree.xml"
    leaf = '<RosService service="{where}" type="std_srvs/srv/Trigger"/>'
    path.write_text(document(f"<Sequence><Script code=\"where := 'a'\"/>{leaf}</Sequence>"), encoding="utf-8")
    assert load(path, models=["ros:jazzy"]).compile().uses() == []
    path.write_text(document(leaf.replace("{where}", "{@where}")), encoding="utf-8")
    (use,) = load(path, models=["ros:jazzy"]).compile(parameters={"where": "switch"}).uses()
    assert (use.kind, use.name) == ("service", "switch")


def test_request_in_braces_is_key_unless_it_contains_fields(tmp_path: Path) -> None:
    key = f'<RosTopic topic="b" type="std_msgs/msg/Bool" value="{{on}}"/><RosService service="a" {BOOL} request="{{on}}"/>'
    assert findings(key, tmp_path) == []
    (found,) = findings(f'<RosService service="a" {BOOL} request="{{data: [}}"/>', tmp_path)
    assert "is not YAML" in found[2]


def test_simulation_error_names_leaf_that_writes_missing_key(tmp_path: Path) -> None:
    path = tmp_path / "tree.xml"
    leaf = f'<RosAction name="Go" action="a" {POSES} fields="error_code: {{code}}"/>'
    path.write_text(
        document(f'<Sequence>{leaf}<ScriptCondition code="code == 0"/></Sequence>'), encoding="utf-8"
    )
    tree = compile_simulated(load(path, models=["ros:jazzy"]).binding(), {})
    with pytest.raises(SarError) as raised:
        tree.root.tick_once()
    said = "because 'Go' only writes it on a robot. Add to the property file or to the scenario: outcomes: {Go: [{status: SUCCESS, then: \"code := ...\"}]}"
    assert tree.explain(raised.value).endswith(said)
