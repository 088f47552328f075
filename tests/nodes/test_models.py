"""Tests of `TreeNodesModel`: described nodes, and the ports of subtrees."""

import re

import pytest
from py_trees import behaviours, composites, decorators

from sar_compiler.checks import check, check_palettes
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.models import undeclared_names
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import Severity, TreeError
from sar_compiler.tree.xml import parse_xml
from tests.trees import document, errors, forest, forest_of

REGISTRY = default_registry()


def palette(*models, trees=""):
    """Return a file with models. The first model is in line 2."""
    return f'<root BTCPP_format="4"><TreeNodesModel>\n{chr(10).join(models)}\n</TreeNodesModel>{trees}</root>'


TREE = '<BehaviorTree ID="A"><Success/></BehaviorTree>'


def locate_errors(text, *palettes):
    findings = errors(forest_of(text), REGISTRY, [parse_xml(each, "palette.xml") for each in palettes])
    return [(f.code, f.source.path, f.span.line, f.suggestion) for f in findings]


def model_warnings(text, *palettes):
    """Return the warnings about the models themselves."""
    findings = check(forest_of(text), REGISTRY, [parse_xml(each, "palette.xml") for each in palettes])
    assert {finding.severity for finding in findings} <= {Severity.WARNING}
    return [(f.code, f.source.path, f.span.line, f.suggestion) for f in findings]


FLY = '<Action ID="Fly"><input_port name="height" type="double" default="1.0">Metres</input_port></Action>'


def test_node_described_in_file_may_be_used():
    assert locate_errors(palette(FLY, trees='<BehaviorTree ID="A"><Fly height="2.5"/></BehaviorTree>')) == []


def test_node_described_in_palette_may_be_used():
    assert (
        locate_errors(document('<Sequence><Fly/><Action ID="Fly" height="{h}"/></Sequence>'), palette(FLY))
        == []
    )


@pytest.mark.parametrize(
    ("body", "code", "suggestion"),
    [
        ('<Fly height="high"/>', "wrong-value", None),
        ('<Fly hieght="1"/>', "unknown-attribute", "height"),
        ("<Fly><Success/></Fly>", "child-of-leaf", None),
        ("<Flu/>", "unknown-node", "Fly"),
        ('<Decorator ID="Fly"/>', "wrong-kind", "Action"),
    ],
)
def test_described_node_is_checked_against_its_model(body, code, suggestion):
    assert locate_errors(document(body), palette(FLY)) == [(code, "test.xml", 3, suggestion)]


def test_described_node_written_as_other_kind_of_leaf_is_warning():
    body = '<Condition ID="Fly"/>'
    assert model_warnings(document(body), palette(FLY)) == [("wrong-kind", "test.xml", 3, "Action")]


TYPES = {
    "int": ("3", "3.5"),
    "unsigned int": ("3", "x"),
    "double": ("1e3", "1e"),
    "bool": ("true", "yes"),
    "std::string": ("anything", None),
    "std::vector<double>": ("1;2.5", "1;x"),
    "std::vector<std::string>": ("a;b", None),
    "geometry_msgs::msg::PoseStamped": ("whatever", None),
    "": ("whatever", None),
}


@pytest.mark.parametrize("name", TYPES)
def test_port_has_declared_type(name):
    right, wrong = TYPES[name]
    written = name.replace("<", "&lt;")
    model = palette(f'<Action ID="Do"><input_port name="x" type="{written}"/></Action>')
    assert locate_errors(document(f'<Do x="{right}"/>'), model) == []
    if wrong is not None:
        assert [code for code, *_ in locate_errors(document(f'<Do x="{wrong}"/>'), model)] == ["wrong-value"]


def test_output_port_of_described_node_must_be_key():
    model = palette('<Action ID="Do"><output_port name="x"/></Action>')
    assert locate_errors(document('<Do x="{x}"/>'), model) == []
    assert locate_errors(document('<Do x="x"/>'), model) == [("wrong-value", "test.xml", 3, "{x}")]


WRONG_MODELS = {
    "an unknown kind": ('<Acton ID="X"/>', "Action"),
    "no ID": ("<Action/>", None),
    "a port that is none": ('<Action ID="X"><input_prt name="a"/></Action>', "input_port"),
    "a port without a name": ('<Action ID="X"><input_port/></Action>', None),
    "a port called as every node's name": ('<Action ID="X"><input_port name="name"/></Action>', None),
    "a node that is called SubTree": ('<Action ID="SubTree"/>', None),
    "a port whose name cannot be an attribute": ('<Action ID="X"><input_port name="he*ght"/></Action>', None),
    "a port called as a condition": ('<Action ID="X"><input_port name="_skipIf"/></Action>', None),
}


@pytest.mark.parametrize("name", WRONG_MODELS)
def test_error_in_model_is_located_and_reported_as_warning(name):
    model, suggestion = WRONG_MODELS[name]
    assert model_warnings(palette(model, trees=TREE)) == [("wrong-model", "test.xml", 2, suggestion)]


WRONG_SUBTREES = {
    "no ID": ("<SubTree/>", "missing-attribute"),
    "a port without a name": ('<SubTree ID="B"><input_port/></SubTree>', "missing-attribute"),
    "a port whose name cannot be an attribute": (
        '<SubTree ID="B"><input_port name="go al" default="1"/></SubTree>',
        "wrong-value",
    ),
}


@pytest.mark.parametrize("name", WRONG_SUBTREES)
def test_error_in_subtree_model_is_reported_as_error(name):
    model, code = WRONG_SUBTREES[name]
    assert locate_errors(palette(model, trees=TREE)) == [(code, "test.xml", 2, None)]


def test_port_with_unknown_element_name_accepts_literal_and_key():
    model = palette('<Action ID="Do"><bidirectional_port name="x"/></Action>')
    assert locate_errors(document('<Sequence><Do x="1"/><Do x="{x}"/></Sequence>'), model) == []


ARM = palette('<Action ID="Grip"><input_port name="strength"/></Action>')
MADE = '<MetadataFields><Metadata made="from use"/></MetadataFields>'
ARM_AS_USED = palette(f'<Action ID="Grip"><input_port name="strength" type="int"/>{MADE}</Action>')


@pytest.mark.parametrize(
    ("model", "attribute", "severity"),
    [
        (ARM, "strenght", "error"),
        (ARM, "server_timeout", "warning"),
        (ARM_AS_USED, "strenght", "warning"),
        (ARM_AS_USED, "server_timeout", "info"),
    ],
)
def test_severity_of_unknown_attribute_depends_on_model(model, attribute, severity):
    findings = check(
        forest_of(document(f'<Grip {attribute}="1"/>')), REGISTRY, [parse_xml(model, "palette.xml")]
    )
    assert [(each.code, each.severity.value) for each in findings] == [("unknown-attribute", severity)]


def test_key_in_undeclared_attribute_is_not_reported_as_unread():
    tree = document(
        '<Sequence><SetBlackboard output_key="x" value="1"/><Grip server_timeout="{x}"/></Sequence>'
    )
    findings = check(forest_of(tree), REGISTRY, [parse_xml(ARM, "palette.xml")])
    assert [each.code for each in findings] == ["unknown-attribute"]


def test_types_of_palette_made_from_use_are_not_checked():
    assert locate_errors(document('<Grip strength="very"/>'), ARM_AS_USED) == []


def test_model_in_file_takes_precedence_over_palette():
    own = '<TreeNodesModel><Action ID="Grip"><input_port name="force"/></Action></TreeNodesModel>'
    tree = document('<Grip force="1"/>').replace("</root>", f"{own}</root>")
    findings = check(forest_of(tree), REGISTRY, [parse_xml(ARM, "palette.xml")])
    assert [each.code for each in findings] == ["wrong-model"]


def test_node_only_named_like_py_trees_node_is_reported_once():
    tree = document('<ForEach vector_in="{a}" out="{b}" index="{i}"><AlwaysSuccess/></ForEach>')
    assert locate_errors(tree) == [("unknown-node", "test.xml", 3, None)]


def test_node_whose_name_is_no_valid_tag_is_written_in_explicit_form():
    model = palette('<Action ID="go there"><input_port name="x" type="int"/></Action>')
    assert locate_errors(document('<Action ID="go there" x="1"/>'), model) == []
    assert locate_errors(document('<Action ID="go there" x="a"/>'), model) == [
        ("wrong-value", "test.xml", 3, None)
    ]


OF_PY_TREES = '<MetadataFields><Metadata library="py_trees"/></MetadataFields>'
CONTRADICTIONS = {
    "another kind": ('<Action ID="Sequence"/>', "Control"),
    "a port that the node does not have": (
        '<Decorator ID="Repeat"><input_port name="num_cycle"/></Decorator>',
        "num_cycles",
    ),
    "another direction": ('<Action ID="Sleep"><output_port name="msec"/></Action>', "input_port"),
    "an input where the node writes": (
        '<Decorator ID="LoopString"><input_port name="value"/></Decorator>',
        "output_port",
    ),
    "another type": ('<Action ID="Sleep"><input_port name="msec" type="double"/></Action>', "unsigned int"),
    "a type in place of a list": (
        f'<Action ID="ProbabilisticBehaviour"><input_port name="weights" type="double"/>{OF_PY_TREES}</Action>',
        "std::vector<double>",
    ),
    "a type for the name of a node": (
        '<Action ID="NotifyBase"><input_port name="detect_node" type="bool"/></Action>',
        "std::string",
    ),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_model_contradicting_registry_is_warning(name):
    model, suggestion = CONTRADICTIONS[name]
    assert model_warnings(palette(model, trees=TREE)) == [("model-mismatch", "test.xml", 2, suggestion)]


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ('<Action ID="Sequence"/>', "<Sequence> is a Control, but the model declares Action"),
        ('<Condition ID="Sleep"/>', "<Sleep> is an Action, but the model declares Condition"),
    ],
)
def test_message_about_wrong_kind_has_correct_article(model, said):
    [finding] = check(forest_of(palette(model, trees=TREE)), REGISTRY)
    assert finding.message == said


@pytest.mark.parametrize(
    "model",
    [
        '<Decorator ID="Timeout"><input_port name="msec" type="unsigned int"/></Decorator>',
        '<Control ID="Parallel"><input_port name="success_count" type="int" default="-1"/></Control>',
        '<Action ID="Fly"><MetadataFields><Metadata group="air"/></MetadataFields></Action>',
        '<Condition ID="ScriptCondition"><input_port name="code" type="std::string"/></Condition>',
        '<Decorator ID="RunOnce"><input_port name="then_skip" type="bool" default="true"/></Decorator>',
        '<Decorator ID="LoopInt"><input_port name="queue" type="std::shared_ptr&lt;std::deque&gt;"/></Decorator>',
        '<Decorator ID="LoopInt"><input_port name="if_empty" type="BT::NodeStatus" default="SUCCESS"/></Decorator>',
        '<Action ID="Sleep"><input_port name="msec" type="int" default="{pause}"/></Action>',
        '<Action ID="Sleep"><input_port name="msec" type="unsigned int" default=""/></Action>',
        '<Action ID="StatusQueue"><input_port name="eventually" type="Outcome"/></Action>',
    ],
)
def test_model_consistent_with_registry_is_accepted(model):
    assert model_warnings(palette(model, trees=TREE)) == []


DEFAULTS = {
    "of an installed node": '<Decorator ID="Repeat"><input_port name="num_cycles" default="{}"/></Decorator>',
    "of a described node": '<Action ID="Do"><input_port name="x" type="int" default="{}"/></Action>',
}


@pytest.mark.parametrize("which", DEFAULTS)
def test_invalid_default_of_port_is_located(which):
    text = palette(DEFAULTS[which].format("12abc"), trees=TREE)
    (finding,) = check(forest_of(text), REGISTRY)
    column = DEFAULTS[which].index("{}") + 1
    assert (finding.code, finding.span.line, finding.span.column) == ("wrong-model", 2, column)
    assert finding.severity is Severity.WARNING
    assert finding.message == "default: '12abc' is not an integer"
    assert model_warnings(palette(DEFAULTS[which].format("12"), trees=TREE)) == []


@pytest.mark.parametrize("default", ["{y}", "y", "", "1.5"])
def test_default_of_output_port_is_ignored(default):
    model = f'<Action ID="Do"><output_port name="x" type="int" default="{default}"/></Action>'
    assert model_warnings(palette(model, trees=TREE)) == []


def test_port_described_twice_is_reported():
    text = palette('<Action ID="Do"><input_port name="x"/>\n<input_port name="x"/></Action>', trees=TREE)
    (finding,) = check(forest_of(text), REGISTRY)
    assert (finding.code, finding.span.line, finding.span.column) == ("wrong-model", 3, 19)
    assert finding.message == "the port 'x' is already described on line 2"


def test_contradictory_models_of_node_are_reported():
    other = '<Action ID="Fly"><input_port name="height" type="int"/></Action>'
    assert model_warnings(palette(FLY, FLY, trees=TREE)) == []
    (finding,) = check(forest_of(palette(FLY, other, trees=TREE)), REGISTRY)
    assert (finding.code, finding.span.line) == ("wrong-model", 3)
    assert finding.message == "'Fly' is described differently on line 2"


def test_model_contradicting_palette_is_reported_in_file():
    other = '<Action ID="Fly"><input_port name="height" type="int"/></Action>'
    assert model_warnings(palette(FLY, trees=TREE), palette(FLY)) == []
    assert model_warnings(palette(other, trees=TREE), palette(FLY)) == [("wrong-model", "test.xml", 2, None)]


def test_subtree_described_twice_is_reported():
    mismatch = ("model-mismatch", "test.xml", 2, None)  # the tree does not use its port goal
    warnings = model_warnings(with_subtree('goal="x"', SUBTREE + "\n" + SUBTREE))
    assert warnings == [mismatch, ("wrong-model", "test.xml", 3, None)]


def test_groot_metadata_beside_models_is_ignored():
    notes = '<MetadataFields><Metadata group="air"/></MetadataFields>'
    assert locate_errors(palette(notes, FLY, trees='<BehaviorTree ID="A"><Fly/></BehaviorTree>')) == []


def test_file_with_only_models_is_valid_but_has_no_tree():
    assert locate_errors(palette(FLY)) == []
    with pytest.raises(TreeError) as caught:
        bind_main(forest_of(palette(FLY)), REGISTRY)
    assert [finding.code for finding in caught.value.findings] == ["no-tree"]


def test_error_in_palette_is_reported_only_for_palette():
    wrong = [parse_xml(palette('<Action ID="Sequence"/>'), "palette.xml")]
    (finding,) = check_palettes(wrong, REGISTRY)
    assert (finding.code, finding.source.path, finding.span.line) == ("model-mismatch", "palette.xml", 2)
    assert check(forest("<Success/>"), REGISTRY, wrong) == []


DECLARED = {
    "with other ports": (
        '<Decorator ID="ForEach"><input_port name="list"/></Decorator>',
        '<ForEach list="{l}"><{0}/></ForEach>',
    ),
    "of another kind": ('<Condition ID="Success"/>', "<Sequence><Success/><{0}/></Sequence>"),
    "that seems to be the same": ('<Action ID="Dummy"/>', "<Sequence><Dummy/><{0}/></Sequence>"),
    "called as its kind": (
        '<Condition ID="Condition"/>',
        '<Sequence><Condition ID="Condition" name="c"/><{0}/></Sequence>',
    ),
    "called as another kind": ('<Action ID="Action"/>', '<Sequence><Action ID="Action"/><{0}/></Sequence>'),
    "of a leaf": (
        '<Action ID="Timer"><input_port name="topic"/></Action>',
        '<Sequence><Timer topic="a"/><{0}/></Sequence>',
    ),
}


@pytest.mark.parametrize("name", DECLARED)
@pytest.mark.parametrize("beside", [True, False], ids=["in a palette", "in the file"])
def test_declared_node_replaces_py_trees_node_of_same_name(name, beside):
    model, body = DECLARED[name]
    body = body.replace("{0}", "Fly")
    text = (
        document(body) if beside else palette(model, FLY, trees=f'<BehaviorTree ID="A">{body}</BehaviorTree>')
    )
    palettes = [palette(model, FLY)] if beside else []
    assert model_warnings(text, *palettes) == []
    binding = bind_main(forest_of(text), REGISTRY, None, [parse_xml(each) for each in palettes])
    tag = re.findall('ID="(.*?)"', model)[0]
    (node,) = [node for node in binding.all_nodes() if node.spec.tag == tag]
    assert node.spec.is_only_described
    with pytest.raises(TreeError) as caught:
        compile_tree(binding, {}, {})
    assert [finding.code for finding in caught.value.findings] == ["not-installed"] * 2


def test_hint_says_how_to_use_py_trees_node_of_same_name():
    text = palette('<Action ID="Dummy"/>', trees=TREE.replace("Success", "Dummy"))
    with pytest.raises(TreeError) as caught:
        compile_tree(bind_main(forest_of(text), REGISTRY), {}, {})
    (finding,) = caught.value.findings
    assert "to use py_trees' <Dummy>" in (finding.hint or "")


def test_model_marked_as_py_trees_describes_py_trees_node():
    described = f'<Action ID="Dummy">{OF_PY_TREES}</Action>'
    text = palette(described, trees='<BehaviorTree ID="A"><Dummy/></BehaviorTree>')
    assert model_warnings(text) == []
    assert compile_tree(bind_main(forest_of(text), REGISTRY), {}, {}).root.name == "Dummy"


@pytest.mark.parametrize("tag", ["Sequence", "Inverter", "AlwaysSuccess", "NavigateToBase"])
def test_model_does_not_redefine_built_in_or_registered_node(tag):
    node = f"<{tag}><Success/></{tag}>" if tag in ("Sequence", "Inverter") else f"<{tag}/>"
    text = palette(f'<Condition ID="{tag}"/>', trees=f'<BehaviorTree ID="A">{node}</BehaviorTree>')
    binding = bind_main(forest_of(text), REGISTRY)
    assert [node.spec.tag for node in binding.all_nodes() if node.spec.is_only_described] == []
    assert ("model-mismatch", 2) in [(f.code, f.span.line) for f in check(forest_of(text), REGISTRY)]


def test_explicit_form_of_undeclared_condition_is_not_py_trees_decorator():
    assert locate_errors(document('<Condition ID="Condition" name="c"/>')) == [
        ("unknown-node", "test.xml", 3, None)
    ]
    assert locate_errors(document('<Decorator ID="Condition" status="SUCCESS"><Success/></Decorator>')) == []
    assert locate_errors(document('<Condition status="SUCCESS"><Success/></Condition>')) == []


def test_explicit_form_needs_id_even_if_node_is_named_like_kind():
    assert locate_errors(document("<Action/>"), palette('<Action ID="Action"/>')) == [
        ("missing-attribute", "test.xml", 3, None)
    ]


def test_tree_of_described_nodes_can_be_previewed_but_not_compiled():
    text = palette(
        FLY,
        '<Control ID="Group"/><Decorator ID="Around"/>',
        trees='<BehaviorTree ID="A"><Group><Fly/><Around><Fly/></Around></Group></BehaviorTree>',
    )
    binding = bind_main(forest_of(text), REGISTRY)
    kinds = [type(node) for node in preview_tree(binding).root.iterate()]
    assert kinds == [behaviours.Dummy, behaviours.Dummy, decorators.PassThrough, composites.Sequence]
    with pytest.raises(TreeError) as caught:
        compile_tree(binding, {}, {})
    assert [f.code for f in caught.value.findings] == ["not-installed"] * 4
    assert "--nodes" in (caught.value.findings[0].hint or "")


SUBTREE = '<SubTree ID="B"><input_port name="goal"/><input_port name="speed" default="0.5"/></SubTree>'


def with_subtree(attributes, model=SUBTREE):
    return palette(
        model,
        trees=f'<BehaviorTree ID="A"><SubTree ID="B" {attributes}/></BehaviorTree>'
        '<BehaviorTree ID="B"><Script code="@seen := speed"/></BehaviorTree>',
    ).replace("<root ", '<root main_tree_to_execute="A" ')


def test_subtree_port_without_default_is_required():
    (finding,) = check(forest_of(with_subtree("")), REGISTRY)
    assert (finding.code, finding.span.line) == ("missing-attribute", 3)
    assert "needs 'goal'" in finding.message
    assert finding.hint == 'write goal="..."'


@pytest.mark.parametrize("attributes", ['goal="{here}"', 'goal="there"', '_autoremap="true"', 'goal="{=}"'])
def test_required_subtree_port_may_be_given_or_autoremapped(attributes):
    assert locate_errors(with_subtree(attributes)) == []


@pytest.mark.parametrize(("attributes", "seen"), [('goal="x"', 0.5), ('goal="x" speed="2"', 2)])
def test_default_of_subtree_model_is_used_if_port_is_not_given(attributes, seen):
    tree = compile_tree(bind_main(forest_of(with_subtree(attributes)), REGISTRY), {}, {})
    tree.root.tick_once()
    assert tree.instance.scope.resolve("seen").read() == seen


NAVIGATION = palette(
    '<Control ID="PipelineSequence"/>',
    '<Control ID="RecoveryNode"><input_port name="number_of_retries">How often</input_port></Control>',
    '<Control ID="RoundRobin"/>',
    '<Decorator ID="RateController"><input_port name="hz">Rate</input_port></Decorator>',
    '<Condition ID="GoalUpdated"/>',
    '<Action ID="ComputePathToPose"><input_port name="goal">Goal</input_port><input_port name="planner_id"/>',
    '<output_port name="path">Path</output_port><output_port name="error_code_id"/></Action>',
    '<Action ID="FollowPath"><input_port name="path"/><input_port name="controller_id" default="FollowPath"/></Action>',
    '<Action ID="ClearEntireCostmap"><input_port name="service_name"/></Action>',
    '<Action ID="Spin"><input_port name="spin_dist">Radians</input_port></Action>',
    '<Action ID="Wait"><input_port name="wait_duration">Seconds</input_port></Action>',
)

NAVIGATE = """
<RecoveryNode number_of_retries="6" name="NavigateRecovery">
  <PipelineSequence name="NavigateWithReplanning">
    <RateController hz="1.0">
      <RecoveryNode number_of_retries="1" name="ComputePathToPose">
        <ComputePathToPose goal="{goal}" path="{path}" planner_id="GridBased" error_code_id="{compute_path_error}"/>
        <ClearEntireCostmap name="ClearGlobalCostmap-Context" service_name="global_costmap/clear_entirely"/>
      </RecoveryNode>
    </RateController>
    <RecoveryNode number_of_retries="1" name="FollowPath">
      <FollowPath path="{path}" controller_id="FollowPath"/>
      <ClearEntireCostmap name="ClearLocalCostmap-Context" service_name="local_costmap/clear_entirely"/>
    </RecoveryNode>
  </PipelineSequence>
  <ReactiveFallback name="RecoveryFallback">
    <GoalUpdated/>
    <RoundRobin name="RecoveryActions">
      <Sequence name="ClearingActions">
        <ClearEntireCostmap name="ClearLocal" service_name="local_costmap/clear_entirely"/>
      </Sequence>
      <Spin spin_dist="1.57"/>
      <Wait wait_duration="5"/>
    </RoundRobin>
  </ReactiveFallback>
</RecoveryNode>"""


def test_nav2_style_tree_with_palette_is_valid_and_can_be_previewed():
    assert locate_errors(document(NAVIGATE), NAVIGATION) == []
    binding = bind_main(forest(NAVIGATE), REGISTRY, None, [parse_xml(NAVIGATION)])
    assert len(list(preview_tree(binding).root.iterate())) == 16


def test_every_unknown_node_is_reported_without_palette():
    codes = [code for code, *_ in locate_errors(document(NAVIGATE))]
    assert codes == ["unknown-node"] * 14


def test_unescaped_ampersands_in_palette_are_reported():
    model = '<Action ID="Fly"><input_port name="when">low && slow</input_port></Action>'
    [finding] = check_palettes([parse_xml(palette(model), "palette.xml")], REGISTRY)
    assert (finding.source.path, finding.span.line, finding.suggestion) == ("palette.xml", 2, "&amp;&amp;")


def test_undeclared_names_in_long_script_are_found_in_linear_time():
    text = document(f'<Script code="{"a" * 1_000_000} mine := RED"/>')
    assert undeclared_names([parse_xml(text, "long.xml")], []) >= {"RED"}
