"""Tests that the interface packages in the environment match those of real robots."""

import json
import sys
from pathlib import Path

import pytest

HASHES = {
    "bond/msg/Status": "RIHS01_87eaccffa254ffffadc0b61600452e8251740f06c25659a2dbda4927fdb1f70a",
    "btcpp_ros2_interfaces/action/ExecuteTree": "RIHS01_41ad97f7d3ed46952d9b8bb0eb72f2cf49a9afbe7c40580e03f09d7007d5376a",
    "btcpp_ros2_interfaces/srv/GetTrees": "RIHS01_680c22e9faaa7a63539f1a87b6e80f78f1533243064e9dfdefb8943acbb2ac40",
    "nav2_msgs/action/ComputePathToPose": "RIHS01_b11d50c914791956069419b8f4ad441e3c66fcfbd9461f8e87110b77dc6febe9",
    "nav2_msgs/action/NavigateThroughPoses": "RIHS01_4e680a34fd27772095da6ffdb32ae348adbc3d948248d38cf8d5ca3fc7a3a6c4",
    "nav2_msgs/action/NavigateToPose": "RIHS01_a56dba8a3234a1215e610180dc703ae25bbf406dded8b54887891c9732857eab",
    "nav2_msgs/msg/BehaviorTreeLog": "RIHS01_9335ecb688a4f61b7eb82a7c10f23eea5f4e8bbdb7edfa048e3539aa928f51b7",
    "tf2_msgs/msg/TFMessage": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "sar_interfaces/srv/AddArea": "RIHS01_9d89368d916da340a6ac5e8b832ca948be4dfea527300b2779f05c075b0691f6",
    "sar_interfaces/srv/AddHint": "RIHS01_b2cc169ef3167487d9f48d813ad8a7ed73644b30c4dba2643f134ada54c9d049",
    "sar_interfaces/srv/AddZone": "RIHS01_a2a58215aff7d7b7cfc5cd5b1f780aeca2a206e56a9e9b14a02d4e416c20261d",
    "sar_interfaces/srv/DetectSurvivor": "RIHS01_6f3526a9b1aa495aea39b4607c4edd8a421d129ba86145b4773984f58ff3efd1",
    "sar_interfaces/srv/JudgeSurvivor": "RIHS01_282eef6397d6c0a4494d89464ece5f809d12af8ebd710c51cccb72fa316994bc",
    "sar_interfaces/srv/ReportSurvivor": "RIHS01_f41fb73195d4507289858a273610a491d932435e72fb41932cf2a7317ce82db2",
}


@pytest.mark.ros
@pytest.mark.parametrize("name", HASHES)
def test_type_hash_matches_the_one_on_the_wire(name):
    description = json.loads((Path(sys.prefix) / "share" / f"{name}.json").read_text(encoding="utf-8"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    assert hashes[name] == HASHES[name]


@pytest.mark.ros
def test_goal_result_has_the_fields_that_leaves_read():
    from nav2_msgs.action import NavigateToPose

    assert NavigateToPose.Result.get_fields_and_field_types() == {
        "error_code": "uint16",
        "error_msg": "string",
    }
    assert NavigateToPose.Result.NONE == 0


def test_stand_in_interfaces_are_outside_the_folder_that_robots_build():
    assert sorted(path.name for path in Path("interfaces").iterdir()) == ["sar_interfaces"]
    assert sorted(path.parent.name for path in Path("pip_interfaces").glob("*/package.xml")) == [
        "bond",
        "btcpp_ros2_interfaces",
        "nav2_msgs",
        "tf2_msgs",
    ]
