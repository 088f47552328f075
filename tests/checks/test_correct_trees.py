"""Tests that intended constructs have no findings."""

from pathlib import Path

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import load_registry
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import load_forest
from sar_compiler.tree.xml import parse_xml
from tests.checks.test_wrong_trees import REGISTRY
from tests.trees import document, forest_of

LEAVES = [
    "examples.drive_to_goal.leaves",
    "examples.decorators.leaves",
    "examples.photo_patrol.photo_patrol.leaves",
]
SHIPPED = sorted(
    [*Path("trees").glob("*.xml"), *Path("trees").glob("*.yaml"), *Path("examples").rglob("*.xml")]
)


@pytest.mark.parametrize("path", SHIPPED, ids=str)
def test_shipped_trees_have_no_findings(path):
    findings = check(load_forest(path, read_tree_file), load_registry(LEAVES))
    assert [finding.render() for finding in findings] == []


INTENDED = {
    "a condition that is watched while something is done": (
        '<Sequence memory="false"><Ready/><Drive/></Sequence>'
    ),
    "what is only done where a condition does not hold": (
        "<ReactiveSequence><Fallback><Ready/><Beep/></Fallback><Drive/></ReactiveSequence>"
    ),
    "work that is only done where a condition does not hold": (
        "<ReactiveSequence><Fallback><Ready/><Look/></Fallback><Drive/></ReactiveSequence>"
    ),
    "an action that is done once, before one that takes time": (
        '<ReactiveSequence><Beep oneshot="ON_COMPLETION"/><Drive/></ReactiveSequence>'
    ),
    "an action under a condition, before one that takes time": (
        '<Sequence><Script code="b := false"/><ReactiveSequence><Beep _skipIf="b"/><Drive/></ReactiveSequence></Sequence>'
    ),
    "an action behind the one that takes time": "<ReactiveSequence><Drive/><Beep/></ReactiveSequence>",
    "a fallback that is tried while the first way is barred": (
        "<ReactiveFallback><Sequence><Ready/><Look/></Sequence><Sequence><Ready/><Drive/></Sequence></ReactiveFallback>"
    ),
    "work until a condition holds": "<ReactiveFallback><Ready/><Drive/></ReactiveFallback>",
    "a recovery that is over in a tick": "<ReactiveFallback><Drive/><Beep/></ReactiveFallback>",
    "leaves of which nothing is known": (
        '<ReactiveSequence><Unknown/><Unknown name="b"/><ReactiveFallback><Unknown/><Unknown name="b"/></ReactiveFallback>'
        "</ReactiveSequence>"
    ),
    "decorators around leaves of which nothing is known": (
        '<Sequence><Retry num_failures="3"><Unknown/></Retry><Timeout duration="5"><Unknown/></Timeout>'
        "<Inverter><Unknown/></Inverter><RunningIsFailure><Unknown/></RunningIsFailure></Sequence>"
    ),
    "rounds that a failure ends": '<Repeat num_cycles="-1"><Drive/></Repeat>',
    "one step of a round that is done once": (
        '<Repeat num_cycles="5"><Sequence><Beep oneshot="ON_COMPLETION"/><Drive/></Sequence></Repeat>'
    ),
    "trying again until it has worked once": (
        '<Retry num_failures="3"><Drive oneshot="ON_SUCCESSFUL_COMPLETION"/></Retry>'
    ),
    "a time limit for several attempts": (
        '<Timeout duration="60"><Retry num_failures="3"><Timeout duration="15"><Drive/></Timeout></Retry></Timeout>'
    ),
    "work beside what watches": '<Parallel policy="SuccessOnOne"><Drive/><Wait/></Parallel>',
    "work that ends together": '<Parallel policy="SuccessOnAll"><Drive/><Look/></Parallel>',
    "a failure that is taken for a success, with something behind it": (
        "<Sequence><ForceSuccess><Look/></ForceSuccess><Drive/></Sequence>"
    ),
    "two nodes beside each other that were given no name": "<Sequence><Drive/><Look/><Drive/></Sequence>",
    "a control of one, with a condition of its own": (
        '<Sequence><Script code="a := 1"/><Sequence _skipIf="a == 1"><Drive/></Sequence></Sequence>'
    ),
    "a robot that never stops": "<KeepRunningUntilFailure><Beep/></KeepRunningUntilFailure>",
    "rounds without an end at the very top": '<Repeat num_cycles="-1"><Beep/></Repeat>',
    "an empty name": '<Sequence name=""><Drive name=""/><Drive name=""/></Sequence>',
    "a last resort behind all that can fail": "<Fallback><Drive/><Look/><Beep/></Fallback>",
}


@pytest.mark.parametrize("name", INTENDED)
def test_intended_constructs_have_no_findings(name):
    assert [finding.render() for finding in check(forest_of(document(INTENDED[name])), REGISTRY)] == []


# A tree as for Nav2: nodes that only a palette describes, and keys that the navigator writes.
PALETTE = """<root BTCPP_format="4"><TreeNodesModel>
  <Action ID="ComputePath"><input_port name="goal"/><output_port name="path"/><output_port name="error"/></Action>
  <Action ID="FollowPath"><input_port name="path"/><output_port name="error"/></Action>
  <Action ID="ClearCostmap"/><Action ID="Spin"/><Action ID="BackUp"/>
  <Condition ID="GoalUpdated"/><Condition ID="WouldRecoveryHelp"><input_port name="error"/></Condition>
  <Condition ID="PathIsValid"><input_port name="path"/></Condition>
  <Control ID="RecoveryNode"><input_port name="number_of_retries"/></Control>
  <Control ID="PipelineSequence"/><Control ID="RoundRobin"/>
  <Decorator ID="RateController"><input_port name="hz"/></Decorator>
</TreeNodesModel></root>"""
NAVIGATION = """
<RecoveryNode number_of_retries="6" name="NavigateRecovery">
  <PipelineSequence name="NavigateWithReplanning">
    <RateController hz="1.0">
      <RecoveryNode number_of_retries="1" name="ComputePath">
        <Fallback>
          <ReactiveSequence><Inverter><GoalUpdated/></Inverter><PathIsValid path="{path}"/></ReactiveSequence>
          <ComputePath goal="{goal}" path="{path}" error="{planner_error}"/>
        </Fallback>
        <Sequence>
          <WouldRecoveryHelp error="{planner_error}"/>
          <ClearCostmap name="Clear"/>
        </Sequence>
      </RecoveryNode>
    </RateController>
    <FollowPath path="{path}" error="{controller_error}"/>
  </PipelineSequence>
  <ReactiveFallback>
    <GoalUpdated/>
    <RoundRobin>
      <Sequence><ClearCostmap name="Clear"/><ClearCostmap name="Clear"/></Sequence>
      <Fallback><Spin/></Fallback>
      <RetryUntilSuccessful num_attempts="1"><BackUp/></RetryUntilSuccessful>
    </RoundRobin>
  </ReactiveFallback>
</RecoveryNode>"""


def test_tree_of_described_nodes_has_no_findings():
    findings = check(forest_of(document(NAVIGATION)), load_registry(), [parse_xml(PALETTE, "palette.xml")])
    assert [finding.render() for finding in findings] == []


def test_misspelt_key_is_found_in_tree_of_described_nodes():
    text = document(NAVIGATION.replace('<PathIsValid path="{path}"', '<PathIsValid path="{paht}"'))
    (finding,) = check(forest_of(text), load_registry(), [parse_xml(PALETTE, "palette.xml")])
    assert (finding.code, finding.suggestion) == ("unwritten-key", "{path}")


@pytest.mark.parametrize(
    "leaf",
    [
        '<Periodic n="3"/>',
        '<StatusQueue queue="RUNNING;SUCCESS"/>',
        "<ProbabilisticBehaviour/>",
        '<BlackboardToStatus variable_name="{@status}"/>',
        '<WaitForBlackboardVariable variable_name="@status"/>',
        '<WaitForBlackboardVariableValue variable="@status" operator="eq" value="1"/>',
    ],
)
def test_leaf_that_keeps_its_state_may_precede_long_action(leaf):
    text = document(f"<ReactiveSequence>\n{leaf}\n<Drive/>\n</ReactiveSequence>")
    assert [finding.render() for finding in check(forest_of(text), REGISTRY)] == []


@pytest.mark.parametrize("inner", ["<PassThrough><Ready/></PassThrough>", "<Inverter><Ready/></Inverter>"])
def test_decorator_inside_count_has_no_findings(inner):
    text = document(f"<Count>{inner}</Count>")
    assert [finding.render() for finding in check(forest_of(text), REGISTRY)] == []
