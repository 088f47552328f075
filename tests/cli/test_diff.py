"""Tests of `sar-compile diff`, and of the conversions for BehaviorTree.CPP and Groot2."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.command_runner import run

SHIPPED = Path("trees/search_and_rescue.xml")


@pytest.fixture
def changed_tree(tmp_path):
    path = tmp_path / "changed.xml"
    text = SHIPPED.read_text(encoding="utf-8")
    path.write_text(text.replace('<Sequence name="Patrol" memory="true">', '<Sequence name="Patrol">'))
    return path


def test_equal_trees_have_status_0_and_no_output(capsys):
    assert run(capsys, "diff", SHIPPED, "trees/search_and_rescue.yaml") == (0, "", "")


def test_different_trees_have_status_1_and_one_line_per_difference(capsys, changed_tree):
    status, out, err = run(capsys, "diff", "search_and_rescue", changed_tree)
    assert (status, err) == (1, "")
    path = "SearchAndRescue/MissionOrReturnToBase/Patrol"
    assert out.startswith(f'changed  {path}: memory "true" -> not written  (')
    assert out.endswith(f"search_and_rescue.xml:13, {changed_tree}:13)\n")
    assert out.count("\n") == 1


def test_differences_are_printed_as_json(capsys, changed_tree):
    status, out, _ = run(capsys, "diff", SHIPPED, changed_tree, "--format", "json")
    (told,) = json.loads(out)
    assert status == 1
    assert told == {
        "change": "changed",
        "path": "SearchAndRescue/MissionOrReturnToBase/Patrol",
        "old": {"tag": "Sequence", "place": f"{SHIPPED}:13"},
        "new": {"tag": "Sequence", "place": f"{changed_tree}:13"},
        "what": "memory",
        "before": "true",
        "after": None,
        "inner": 0,
    }
    assert run(capsys, "diff", SHIPPED, SHIPPED, "--format", "json") == (0, "[]\n", "")


@pytest.mark.parametrize(
    ("before", "after", "is_changed"),
    [
        ("uint32_t", "unsigned int", False),
        ("std::string", "std::__cxx11::basic_string&lt;char&gt;", False),
        ("Pose", "geometry_msgs::msg::Pose", False),
        ("int", "unsigned int", True),
        ("double", "float", True),
    ],
)
def test_alias_of_port_type_is_no_difference(capsys, tmp_path, before, after, is_changed):
    files = [tmp_path / "before.xml", tmp_path / "after.xml"]
    for path, name in zip(files, (before, after), strict=True):
        port = f'<input_port name="at" type="{name}"/>'
        path.write_text(f'<root><TreeNodesModel><Action ID="Go">{port}</Action></TreeNodesModel></root>')
    status, out, _ = run(capsys, "diff", *files)
    assert (status, "type" in out) == (int(is_changed), is_changed)


def test_missing_file_has_status_2(capsys):
    assert run(capsys, "diff", SHIPPED, "nowhere.xml") == (
        2,
        "",
        "sar-compile: cannot read nowhere.xml: No such file or directory\n",
    )


def test_malformed_file_has_status_1_and_findings(capsys, tmp_path):
    path = tmp_path / "cut.xml"
    path.write_text("<root>", encoding="utf-8")
    status, out, err = run(capsys, "diff", SHIPPED, path)
    assert (status, out) == (1, "")
    assert f"{path}:1:7: error[malformed-xml]" in err


def test_mission_converted_to_btcpp_is_valid(capsys, tmp_path):
    output = tmp_path / "mission.xml"
    status, out, err = run(capsys, "convert", SHIPPED, "--to", "btcpp", "-o", output)
    assert (status, out) == (0, "")
    assert err.count("info[reference]") == 3
    assert "<ReactiveFallback" in output.read_text(encoding="utf-8")
    assert run(capsys, "validate", output) == (0, f"{output}: no findings\n", "")


def test_incomplete_conversion_has_status_1_and_output(capsys, tmp_path):
    path = tmp_path / "waits.xml"
    path.write_text('<root><BehaviorTree><Success oneshot="ON_SUCCESSFUL_COMPLETION"/></BehaviorTree></root>')
    status, out, err = run(capsys, "convert", path, "--to", "btcpp")
    assert status == 1
    assert f"{path}:1:39: warning[no-counterpart]: oneshot:" in err
    assert '<OneShot name="SuccessOneShot" policy="ON_SUCCESSFUL_COMPLETION">' in out


def test_converted_tree_describes_custom_leaves(capsys):
    arguments = ["convert", "examples/drive_to_goal/drive_to_goal.xml", "--to", "btcpp"]
    _, out, _ = run(capsys, *arguments, "--nodes", "examples.drive_to_goal.leaves")
    assert '<Condition ID="GoalNotReached" editable="true">' in out


def test_groot2_palette_can_be_used_as_model(capsys, tmp_path):
    status, out, _ = run(capsys, "nodes", "--format", "groot2")
    assert status == 0
    described = tmp_path / "nodes.xml"
    described.write_text(out, encoding="utf-8")
    assert run(capsys, "validate", "--model", described, SHIPPED) == (0, f"{SHIPPED}: no findings\n", "")


def test_palette_of_one_node_contains_only_that_node(capsys):
    status, out, _ = run(capsys, "nodes", "ZonesRemaining", "--format", "groot2")
    assert status == 0
    assert out.splitlines()[2:-1] == [
        "  <TreeNodesModel>",
        '    <Condition ID="ZonesRemaining" editable="true"/>',
        "  </TreeNodesModel>",
    ]


def test_commands_run_without_ros(changed_tree):
    program = (
        "import sys; sys.modules['rclpy'] = None\n"
        "from sar_compiler.cli.compile import main\n"
        "main(['nodes', '--format', 'groot2']), main(['convert', sys.argv[1], '--to', 'btcpp'])\n"
        "sys.exit(main(['diff', sys.argv[1], sys.argv[2]]))"
    )
    command = [sys.executable, "-c", program, str(SHIPPED), str(changed_tree)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 1
