"""`TreeNodesModel`: nodes that are only described, and what subtrees need."""

import pytest
from py_trees import behaviours, composites, decorators

from sar_compiler.checks import check, check_palettes
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.xml import parse_xml
from tests.trees import document, errors, forest, forest_of

REGISTRY = default_registry()


def palette(*models, trees=""):
    """Return a file with a model; the model's lines begin in line 2."""
    return f"<root><TreeNodesModel>\n{chr(10).join(models)}\n</TreeNodesModel>{trees}</root>"


TREE = '<BehaviorTree ID="A"><Success/></BehaviorTree>'


def found(text, *palettes):
    findings = errors(forest_of(text), REGISTRY, [parse_xml(each, "palette.xml") for each in palettes])
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
        ('<Condition ID="Fly"/>', "wrong-kind", "Action"),
    ],
)
def test_a_described_node_is_checked_by_its_description(body, code, suggestion):
    assert found(document(body), palette(FLY)) == [(code, "test.xml", 3, suggestion)]


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


MISTAKES = {
    "an unknown kind": ('<Acton ID="X"/>', "unknown-element", "Action"),
    "no ID": ("<Action/>", "missing-attribute", None),
    "a port that is none": ('<Action ID="X"><input_prt name="a"/></Action>', "unknown-element", "input_port"),
    "a port without a name": ('<Action ID="X"><input_port/></Action>', "missing-attribute", None),
    "a port called as every node's name": (
        '<Action ID="X"><input_port name="name"/></Action>',
        "wrong-value",
        None,
    ),
    "a node whose name cannot be a tag": ('<Action ID="go there"/>', "wrong-value", None),
    "a node that is called SubTree": ('<Action ID="SubTree"/>', "wrong-value", None),
    "a port whose name cannot be an attribute": (
        '<Action ID="X"><input_port name="he*ght"/></Action>',
        "wrong-value",
        None,
    ),
    "a port called as a condition": (
        '<Action ID="X"><input_port name="_skipIf"/></Action>',
        "wrong-value",
        None,
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_a_model_is_found_where_it_stands(name):
    model, code, suggestion = MISTAKES[name]
    assert found(palette(model, trees=TREE)) == [(code, "test.xml", 2, suggestion)]


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
        '<Action ID="ProbabilisticBehaviour"><input_port name="weights" type="double"/></Action>',
        "std::vector<double>",
    ),
    "a type for the name of a node": (
        '<Action ID="NotifyBase"><input_port name="detect_node" type="bool"/></Action>',
        "std::string",
    ),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_a_model_that_contradicts_the_registry_is_a_finding(name):
    model, suggestion = CONTRADICTIONS[name]
    assert found(palette(model, trees=TREE)) == [("model-mismatch", "test.xml", 2, suggestion)]


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
        '<Action ID="StatusQueue"><input_port name="eventually" type="Answer"/></Action>',
    ],
)
def test_a_model_that_says_what_the_registry_knows_is_none(model):
    assert found(palette(model, trees=TREE)) == []


DEFAULTS = {
    "of an installed node": '<Decorator ID="Repeat"><input_port name="num_cycles" default="{}"/></Decorator>',
    "of a described node": '<Action ID="Do"><input_port name="x" type="int" default="{}"/></Action>',
}


@pytest.mark.parametrize("which", DEFAULTS)
def test_a_default_that_the_port_does_not_take_is_a_finding_at_the_default(which):
    text = palette(DEFAULTS[which].format("12abc"), trees=TREE)
    (finding,) = check(forest_of(text), REGISTRY)
    column = DEFAULTS[which].index("{}") + 1
    assert (finding.code, finding.span.line, finding.span.column) == ("wrong-value", 2, column)
    assert finding.message == "default: '12abc' is not a whole number"
    assert found(palette(DEFAULTS[which].format("12"), trees=TREE)) == []


def test_the_default_of_an_output_must_be_a_key():
    model = '<Action ID="Do"><output_port name="x" default="{}"/></Action>'
    assert found(palette(model.format("{y}"), trees=TREE)) == []
    assert found(palette(model.format("y"), trees=TREE)) == [("wrong-value", "test.xml", 2, "{y}")]


def test_a_port_that_is_described_twice_is_a_finding():
    text = palette('<Action ID="Do"><input_port name="x"/>\n<input_port name="x"/></Action>', trees=TREE)
    (finding,) = check(forest_of(text), REGISTRY)
    assert (finding.code, finding.span.line, finding.span.column) == ("duplicate-model", 3, 19)
    assert finding.message == "the port 'x' is described in line 2 already"


def test_a_node_that_is_described_twice_must_be_described_alike():
    other = '<Action ID="Fly"><input_port name="height" type="int"/></Action>'
    assert found(palette(FLY, FLY, trees=TREE)) == []
    (finding,) = check(forest_of(palette(FLY, other, trees=TREE)), REGISTRY)
    assert (finding.code, finding.span.line) == ("duplicate-model", 3)
    assert finding.message == "'Fly' is described in line 2 already, differently"


def test_a_file_that_describes_a_node_otherwise_than_its_palette_is_a_finding_in_the_file():
    other = '<Action ID="Fly"><input_port name="height" type="int"/></Action>'
    assert found(palette(FLY, trees=TREE), palette(FLY)) == []
    assert found(palette(other, trees=TREE), palette(FLY)) == [("duplicate-model", "test.xml", 2, None)]


def test_a_subtree_that_a_file_describes_twice_is_a_finding():
    assert found(with_subtree('goal="x"', SUBTREE + "\n" + SUBTREE)) == [
        ("duplicate-model", "test.xml", 3, None)
    ]


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
    ).replace("<root>", '<root main_tree_to_execute="A">')


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
