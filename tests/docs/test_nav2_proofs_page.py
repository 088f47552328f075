"""Tests of the property files in docs/missions/nav2-findings.md on a small tree with the form of Nav2's trees."""

import re
from pathlib import Path

import pytest

import sar_compiler
from sar_compiler import ProofStatus
from tests.docs.markdown import blocks, commands, tables

PAGE = Path("docs/missions/nav2-findings.md")
FILES = {block.file: block.text for block in blocks(PAGE) if block.file}
# Nav2's form without its recovery. The property is about the start of the retry.
TREE = """
<root BTCPP_format="4">
  <BehaviorTree ID="Drive">
    <PipelineSequence>
      <RecoveryNode number_of_retries="1" name="Plan">
        <Fallback>
          <ReactiveSequence>
            <Inverter><GlobalUpdatedGoal/></Inverter>
            <IsPathValid path="{path}"/>
          </ReactiveSequence>
          <ComputePathToPose goal="{goal}" path="{path}"/>
        </Fallback>
        <ClearEntireCostmap service_name="clear"/>
      </RecoveryNode>
      <RecoveryNode number_of_retries="1" name="Follow">
        <FollowPath path="{path}"/>
        <ClearEntireCostmap service_name="clear"/>
      </RecoveryNode>
    </PipelineSequence>
  </BehaviorTree>
</root>
"""


def apply_sed(program):
    """Return the property file after one of the page's `sed` commands."""
    found = re.fullmatch(r"s/(.+)/(.*)/", program)
    assert found
    assert found[1] in FILES["since.yaml"], "the edit changes something"
    return FILES["since.yaml"].replace(found[1], found[2])


def edits():
    return {
        command.words[1]
        for command in commands(PAGE)
        if command.words[0] == "sed" and command.words[2] == "since.yaml"
    }


def is_proved(folder, properties, palette):
    name = "IsPathValid" if palette == "nav2:jazzy" else "ValidatePath"
    (folder / "drive.xml").write_text(TREE.replace("IsPathValid", name), encoding="utf-8")
    (folder / "asked.yaml").write_text(properties, encoding="utf-8")
    result = sar_compiler.load(folder / "drive.xml", models=[palette]).verify(folder / "asked.yaml")
    [asked] = [each for each in result.verdicts if "goal" in each.question]
    assert asked.outcome in {ProofStatus.PROVED, ProofStatus.BROKEN}
    return asked.outcome is ProofStatus.PROVED


def test_new_goal_property_is_violated_without_assumptions(tmp_path):
    assert not is_proved(tmp_path, FILES["new_goal.yaml"], "nav2:jazzy")
    assert not is_proved(tmp_path, FILES["new_goal.yaml"], "nav2:main")


def test_new_goal_property_is_proved_with_assumptions_about_current_nav2(tmp_path):
    assert is_proved(tmp_path, FILES["since.yaml"], "nav2:jazzy")
    assert is_proved(tmp_path, apply_sed("s/IsPathValid/ValidatePath/"), "nav2:main")


@pytest.mark.parametrize("program", ["s/# planning: //", "s/# timeout: //"])
def test_remaining_violation_is_found_with_edited_assumption(tmp_path, program):
    assert program in edits()
    assert not is_proved(tmp_path, apply_sed(program), "nav2:jazzy")


def test_property_is_violated_if_aborting_planner_keeps_the_path(tmp_path):
    emptied = ', then: "path_is_empty = true"'
    assert FILES["since.yaml"].count(emptied) == 1
    assert not is_proved(tmp_path, FILES["since.yaml"].replace(emptied, ""), "nav2:jazzy")


def test_each_finding_has_an_assumption_and_a_section():
    rows = [cells for heading, _, cells in tables(PAGE) if heading == "Findings in Nav2's trees"]
    assert len(rows) == 4
    assert all(len(cells) == 4 and cells[2] and cells[3] and "](#" in cells[0] for cells in rows)
