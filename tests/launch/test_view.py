"""Tests of the RViz configuration."""

from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from tests.launch.launch_file import ROOT
from tests.launch.topics import KNOWN

VIEW = yaml.safe_load((ROOT / "rviz" / "search_and_rescue.rviz").read_text(encoding="utf-8"))
MANAGER = VIEW["Visualization Manager"]
DISPLAYS = {display["Name"]: display for display in MANAGER["Displays"]}
TOOLS = {tool["Class"]: tool for tool in MANAGER["Tools"]}


def topics(tree: Any) -> Iterator[str]:
    """Return the values of all topics."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if str(key).endswith("Topic"):
            yield value["Value"]
        elif isinstance(value, dict | list):
            yield from topics(value)


def test_every_topic_is_relative():
    assert not [topic for topic in topics(VIEW) if topic.startswith("/")]


def test_every_topic_is_known():
    assert set(topics(VIEW)) <= KNOWN


@pytest.mark.parametrize(
    ("kind", "topic"),
    [
        ("Map", "map"),
        ("LaserScan", "scan"),
        ("Path", "plan"),
        ("MarkerArray", "search_and_rescue/markers"),
        ("PoseWithCovariance", "amcl_pose"),
        ("Polygon", "local_costmap/published_footprint"),
    ],
)
def test_mission_is_displayed(kind, topic):
    shown = [display for display in DISPLAYS.values() if display["Enabled"]]
    assert (f"rviz_default_plugins/{kind}", topic) in [
        (display["Class"], display.get("Topic", {}).get("Value")) for display in shown
    ]


def test_survivors_are_displayed_as_named_frames():
    (frames,) = [each for each in DISPLAYS.values() if each["Class"] == "rviz_default_plugins/TF"]
    assert (frames["Enabled"], frames["Show Names"], frames["Frames"]["All Enabled"]) == (True, True, True)


def test_global_costmap_is_off_by_default():
    assert DISPLAYS["Global costmap"]["Enabled"] is DISPLAYS["Global costmap"]["Value"] is False


@pytest.mark.parametrize("name", ["Map", "Global costmap", "Robot pose", "Zones and survivors"])
def test_latched_topics_have_transient_local_durability(name):
    assert DISPLAYS[name]["Topic"]["Durability Policy"] == "Transient Local"


def test_view_is_from_above_in_map_frame():
    assert MANAGER["Global Options"]["Fixed Frame"] == "map"
    assert MANAGER["Views"]["Current"]["Class"] == "rviz_default_plugins/TopDownOrtho"


@pytest.mark.parametrize(("tool", "topic"), [("SetInitialPose", "initialpose"), ("SetGoal", "goal_pose")])
def test_pose_and_goal_can_be_set_by_hand(tool, topic):
    assert TOOLS[f"rviz_default_plugins/{tool}"]["Topic"]["Value"] == topic
