"""`TreeNodesModel`: nodes that are only described, and what subtrees need."""

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
    """Return a file with a model; the model's lines begin in line 2."""
    return f'<root BTCPP_format="4"><TreeNodesModel>\n{chr(10).join(models)}\n</TreeNodesModel>{trees}</root>'


TREE = '<BehaviorTree ID="A"><Success/></BehaviorTree>'


def found(text, *palettes):
    findings = errors(forest_of(text), REGISTRY, [parse_xml(each, "palette.xml") for each in palettes])
    return [(f.code, f.source.path, f.span.line, f.suggestion) for f in findings]


def slips(text, *palettes):
    """Return what is said of the models themselves, in warnings."""
    findings = check(forest_of(text), REGISTRY, [parse_xml(each, "palette.xml") for each in palettes])
    assert {finding.severity for finding in findings} <= {Severity.WARNING}
    return [(f.code, f.source.path, f.span.line, f.suggestion) for f in findings]


FLY = '<Action ID="Fly"><input_port name="height" type="double" default="1.0">Metres</input_port></Action>'


def test_a_node_that_the_file_describes_may_be_used():
    assert found(palette(FLY, trees='<BehaviorTree ID="A"><Fly height="2.5"/></BehaviorTree>')) == []


def test_a_node_that_a_palette_describes_may_be_used():
    assert found(document('<Sequence><Fly/><Action ID="Fly" height="{h}"/></Sequence>'), palette(FLY)) == []


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
def test_a_described_node_is_checked_by_its_description(body, code, suggestion):
    assert found(document(body), palette(FLY)) == [(code, "test.xml", 3, suggestion)]


def test_a_described_node_that_is_written_as_another_kind_of_leaf_is_told_of():
    body = '<Condition ID="Fly"/>'
    assert slips(document(body), palette(FLY)) == [("wrong-kind", "test.xml", 3, "Action")]


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
def test_a_port_has_the_type_that_it_is_said_to_have(name):
    right, wrong = TYPES[name]
    written = name.replace("<", "&lt;")
    model = palette(f'<Action ID="Do"><input_port name="x" type="{written}"/></Action>')
    assert found(document(f'<Do x="{right}"/>'), model) == []
    if wrong is not None:
        assert [code for code, *_ in found(document(f'<Do x="{wrong}"/>'), model)] == ["wrong-value"]


def test_an_output_of_a_described_node_must_be_a_key():
    model = palette('<Action ID="Do"><output_port name="x"/></Action>')
    assert found(document('<Do x="{x}"/>'), model) == []
    assert found(document('<Do x="x"/>'), model) == [("wrong-value", "test.xml", 3, "{x}")]


SLIPS = {
    "an unknown kind": ('<Acton ID="X"/>', "Action"),
    "no ID": ("<Action/>", None),
    "a port that is none": ('<Action ID="X"><input_prt name="a"/></Action>', "input_port"),
    "a port without a name": ('<Action ID="X"><input_port/></Action>', None),
    "a port called as every node's name": ('<Action ID="X"><input_port name="name"/></Action>', None),
    "a node that is called SubTree": ('<Action ID="SubTree"/>', None),
    "a port whose name cannot be an attribute": ('<Action ID="X"><input_port name="he*ght"/></Action>', None),
    "a port called as a condition": ('<Action ID="X"><input_port name="_skipIf"/></Action>', None),
}


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_in_a_model_is_a_warning_where_it_stands(name):
    model, suggestion = SLIPS[name]
    assert slips(palette(model, trees=TREE)) == [("wrong-model", "test.xml", 2, suggestion)]


WRONG_SUBTREES = {
    "no ID": ("<SubTree/>", "missing-attribute"),
    "a port without a name": ('<SubTree ID="B"><input_port/></SubTree>', "missing-attribute"),
    "a port whose name cannot be an attribute": (
        '<SubTree ID="B"><input_port name="go al" default="1"/></SubTree>',
        "wrong-value",
    ),
}


@pytest.mark.parametrize("name", WRONG_SUBTREES)
def test_a_mistake_in_the_model_of_a_subtree_is_an_error_because_it_counts(name):
    model, code = WRONG_SUBTREES[name]
    assert found(palette(model, trees=TREE)) == [(code, "test.xml", 2, None)]


def test_a_port_of_another_name_than_the_three_may_be_read_and_written():
    model = palette('<Action ID="Do"><bidirectional_port name="x"/></Action>')
    assert found(document('<Sequence><Do x="1"/><Do x="{x}"/></Sequence>'), model) == []


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
def test_an_attribute_that_a_description_lacks_weighs_as_much_as_the_description(model, attribute, severity):
    findings = check(
        forest_of(document(f'<Grip {attribute}="1"/>')), REGISTRY, [parse_xml(model, "palette.xml")]
    )
    assert [(each.code, each.severity.value) for each in findings] == [("unknown-attribute", severity)]


def test_what_an_unlisted_attribute_may_read_is_not_taken_for_unread():
    tree = document(
        '<Sequence><SetBlackboard output_key="x" value="1"/><Grip server_timeout="{x}"/></Sequence>'
    )
    findings = check(forest_of(tree), REGISTRY, [parse_xml(ARM, "palette.xml")])
    assert [each.code for each in findings] == ["unknown-attribute"]


def test_a_palette_made_from_use_says_nothing_of_types():
    assert found(document('<Grip strength="very"/>'), ARM_AS_USED) == []


def test_the_files_own_model_wins_over_a_palette():
    own = '<TreeNodesModel><Action ID="Grip"><input_port name="force"/></Action></TreeNodesModel>'
    tree = document('<Grip force="1"/>').replace("</root>", f"{own}</root>")
    findings = check(forest_of(tree), REGISTRY, [parse_xml(ARM, "palette.xml")])
    assert [each.code for each in findings] == ["wrong-model"]


def test_a_node_that_is_only_called_as_one_of_py_trees_is_told_once():
    tree = document('<ForEach vector_in="{a}" out="{b}" index="{i}"><AlwaysSuccess/></ForEach>')
    assert found(tree) == [("unknown-node", "test.xml", 3, None)]


def test_a_node_whose_name_cannot_be_a_tag_is_written_by_its_id():
    model = palette('<Action ID="go there"><input_port name="x" type="int"/></Action>')
    assert found(document('<Action ID="go there" x="1"/>'), model) == []
    assert found(document('<Action ID="go there" x="a"/>'), model) == [("wrong-value", "test.xml", 3, None)]


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
def test_a_model_that_contradicts_the_registry_is_a_warning(name):
    model, suggestion = CONTRADICTIONS[name]
    assert slips(palette(model, trees=TREE)) == [("model-mismatch", "test.xml", 2, suggestion)]


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ('<Action ID="Sequence"/>', "<Sequence> is a Control, but the model declares Action"),
        ('<Condition ID="Sleep"/>', "<Sleep> is an Action, but the model declares Condition"),
    ],
)
def test_another_kind_is_named_with_its_article(model, said):
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
def test_a_model_that_says_what_the_registry_knows_is_none(model):
    assert slips(palette(model, trees=TREE)) == []


DEFAULTS = {
    "of an installed node": '<Decorator ID="Repeat"><input_port name="num_cycles" default="{}"/></Decorator>',
    "of a described node": '<Action ID="Do"><input_port name="x" type="int" default="{}"/></Action>',
}


@pytest.mark.parametrize("which", DEFAULTS)
def test_a_default_that_the_port_does_not_take_is_a_finding_at_the_default(which):
    text = palette(DEFAULTS[which].format("12abc"), trees=TREE)
    (finding,) = check(forest_of(text), REGISTRY)
    column = DEFAULTS[which].index("{}") + 1
    assert (finding.code, finding.span.line, finding.span.column) == ("wrong-model", 2, column)
    assert finding.severity is Severity.WARNING
    assert finding.message == "default: '12abc' is not an integer"
    assert slips(palette(DEFAULTS[which].format("12"), trees=TREE)) == []


@pytest.mark.parametrize("default", ["{y}", "y", "", "1.5"])
def test_the_default_of_an_output_means_nothing(default):
    model = f'<Action ID="Do"><output_port name="x" type="int" default="{default}"/></Action>'
    assert slips(palette(model, trees=TREE)) == []


def test_a_port_that_is_described_twice_is_a_finding():
    text = palette('<Action ID="Do"><input_port name="x"/>\n<input_port name="x"/></Action>', trees=TREE)
    (finding,) = check(forest_of(text), REGISTRY)
    assert (finding.code, finding.span.line, finding.span.column) == ("wrong-model", 3, 19)
    assert finding.message == "the port 'x' is already described on line 2"


def test_a_node_that_is_described_twice_must_be_described_alike():
    other = '<Action ID="Fly"><input_port name="height" type="int"/></Action>'
    assert slips(palette(FLY, FLY, trees=TREE)) == []
    (finding,) = check(forest_of(palette(FLY, other, trees=TREE)), REGISTRY)
    assert (finding.code, finding.span.line) == ("wrong-model", 3)
    assert finding.message == "'Fly' is described differently on line 2"


def test_a_file_that_describes_a_node_otherwise_than_its_palette_is_a_finding_in_the_file():
    other = '<Action ID="Fly"><input_port name="height" type="int"/></Action>'
    assert slips(palette(FLY, trees=TREE), palette(FLY)) == []
    assert slips(palette(other, trees=TREE), palette(FLY)) == [("wrong-model", "test.xml", 2, None)]


def test_a_subtree_that_a_file_describes_twice_is_a_finding():
    mismatch = ("model-mismatch", "test.xml", 2, None)  # the tree does nothing with its port goal
    found = slips(with_subtree('goal="x"', SUBTREE + "\n" + SUBTREE))
    assert found == [mismatch, ("wrong-model", "test.xml", 3, None)]


def test_notes_of_groot_beside_the_models_mean_nothing():
    notes = '<MetadataFields><Metadata group="air"/></MetadataFields>'
    assert found(palette(notes, FLY, trees='<BehaviorTree ID="A"><Fly/></BehaviorTree>')) == []


def test_a_file_that_only_describes_nodes_is_right_by_itself():
    assert found(palette(FLY)) == []
    with pytest.raises(TreeError) as caught:
        bind_main(forest_of(palette(FLY)), REGISTRY)
    assert [finding.code for finding in caught.value.findings] == ["no-tree"]


def test_a_palette_with_a_mistake_has_the_finding_itself():
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
def test_a_node_that_is_declared_by_the_name_of_one_of_py_trees_is_that_node(name, beside):
    model, body = DECLARED[name]
    body = body.replace("{0}", "Fly")
    text = (
        document(body) if beside else palette(model, FLY, trees=f'<BehaviorTree ID="A">{body}</BehaviorTree>')
    )
    palettes = [palette(model, FLY)] if beside else []
    assert slips(text, *palettes) == []
    binding = bind_main(forest_of(text), REGISTRY, None, [parse_xml(each) for each in palettes])
    tag = re.findall('ID="(.*?)"', model)[0]
    (node,) = [node for node in binding.all_nodes() if node.spec.tag == tag]
    assert node.spec.is_only_described
    with pytest.raises(TreeError) as caught:
        compile_tree(binding, {}, {})
    assert [finding.code for finding in caught.value.findings] == ["not-installed"] * 2


def test_whoever_means_the_node_of_py_trees_is_told_to_delete_the_model():
    text = palette('<Action ID="Dummy"/>', trees=TREE.replace("Success", "Dummy"))
    with pytest.raises(TreeError) as caught:
        compile_tree(bind_main(forest_of(text), REGISTRY), {}, {})
    (finding,) = caught.value.findings
    assert "to use py_trees' <Dummy>" in (finding.hint or "")


def test_a_description_of_a_node_of_py_trees_that_is_noted_as_such_is_one():
    described = f'<Action ID="Dummy">{OF_PY_TREES}</Action>'
    text = palette(described, trees='<BehaviorTree ID="A"><Dummy/></BehaviorTree>')
    assert slips(text) == []
    assert compile_tree(bind_main(forest_of(text), REGISTRY), {}, {}).root.name == "Dummy"


@pytest.mark.parametrize("tag", ["Sequence", "Inverter", "AlwaysSuccess", "NavigateToBase"])
def test_what_behaviortree_cpp_or_a_class_has_stays_what_it_is(tag):
    node = f"<{tag}><Success/></{tag}>" if tag in ("Sequence", "Inverter") else f"<{tag}/>"
    text = palette(f'<Condition ID="{tag}"/>', trees=f'<BehaviorTree ID="A">{node}</BehaviorTree>')
    binding = bind_main(forest_of(text), REGISTRY)
    assert [node.spec.tag for node in binding.all_nodes() if node.spec.is_only_described] == []
    assert ("model-mismatch", 2) in [(f.code, f.span.line) for f in check(forest_of(text), REGISTRY)]


def test_the_explicit_form_of_a_condition_that_nobody_declares_is_not_the_decorator_of_py_trees():
    assert found(document('<Condition ID="Condition" name="c"/>')) == [("unknown-node", "test.xml", 3, None)]
    assert found(document('<Decorator ID="Condition" status="SUCCESS"><Success/></Decorator>')) == []
    assert found(document('<Condition status="SUCCESS"><Success/></Condition>')) == []


def test_an_explicit_form_names_its_node_also_where_one_is_called_as_the_kind():
    assert found(document("<Action/>"), palette('<Action ID="Action"/>')) == [
        ("missing-attribute", "test.xml", 3, None)
    ]


def test_a_described_tree_can_be_looked_at_but_not_flown():
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


def test_a_subtree_must_be_given_what_its_model_says_without_a_default():
    (finding,) = check(forest_of(with_subtree("")), REGISTRY)
    assert (finding.code, finding.span.line) == ("missing-attribute", 3)
    assert "needs 'goal'" in finding.message
    assert finding.hint == 'write goal="..."'


@pytest.mark.parametrize("attributes", ['goal="{here}"', 'goal="there"', '_autoremap="true"', 'goal="{=}"'])
def test_a_subtree_that_is_given_it_or_remaps_everything_is_right(attributes):
    assert found(with_subtree(attributes)) == []


@pytest.mark.parametrize(("attributes", "seen"), [('goal="x"', 0.5), ('goal="x" speed="2"', 2)])
def test_the_default_of_a_model_counts_where_nothing_is_written(attributes, seen):
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


def test_a_tree_in_the_manner_of_nav2_is_right_with_its_palette_and_drawn():
    assert found(document(NAVIGATE), NAVIGATION) == []
    binding = bind_main(forest(NAVIGATE), REGISTRY, None, [parse_xml(NAVIGATION)])
    assert len(list(preview_tree(binding).root.iterate())) == 16


def test_without_its_palette_every_unknown_node_is_a_finding_of_its_own():
    codes = [code for code, *_ in found(document(NAVIGATE))]
    assert codes == ["unknown-node"] * 14


def test_what_a_palette_has_only_for_the_reader_of_the_library_is_told():
    model = '<Action ID="Fly"><input_port name="when">low && slow</input_port></Action>'
    [finding] = check_palettes([parse_xml(palette(model), "palette.xml")], REGISTRY)
    assert (finding.source.path, finding.span.line, finding.suggestion) == ("palette.xml", 2, "&amp;&amp;")


def test_names_are_found_in_a_long_script_in_linear_time():
    text = document(f'<Script code="{"a" * 1_000_000} mine := RED"/>')
    assert undeclared_names([parse_xml(text, "long.xml")], []) >= {"RED"}
