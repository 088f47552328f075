"""What RViz shows."""

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
    """Return the values of all that is a topic."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if str(key).endswith("Topic"):
            yield value["Value"]
        elif isinstance(value, dict | list):
            yield from topics(value)


def test_every_topic_is_relative_so_that_the_view_moves_with_rviz_into_a_namespace():
    assert not [topic for topic in topics(VIEW) if topic.startswith("/")]


def test_every_topic_is_one_that_somebody_publishes_or_listens_to():
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
def test_the_mission_is_seen(kind, topic):
    shown = [display for display in DISPLAYS.values() if display["Enabled"]]
    assert (f"rviz_default_plugins/{kind}", topic) in [
        (display["Class"], display.get("Topic", {}).get("Value")) for display in shown
    ]


def test_survivors_are_seen_as_frames_with_their_names():
    (frames,) = [each for each in DISPLAYS.values() if each["Class"] == "rviz_default_plugins/TF"]
    assert (frames["Enabled"], frames["Show Names"], frames["Frames"]["All Enabled"]) == (True, True, True)


def test_the_global_costmap_is_there_but_off():
    assert DISPLAYS["Global costmap"]["Enabled"] is DISPLAYS["Global costmap"]["Value"] is False


@pytest.mark.parametrize("name", ["Map", "Global costmap", "Robot pose", "Zones and survivors"])
def test_what_is_published_once_is_seen_by_an_rviz_that_comes_later(name):
    assert DISPLAYS[name]["Topic"]["Durability Policy"] == "Transient Local"


def test_it_is_seen_from_above_in_the_frame_of_the_map():
    assert MANAGER["Global Options"]["Fixed Frame"] == "map"
    assert MANAGER["Views"]["Current"]["Class"] == "rviz_default_plugins/TopDownOrtho"


@pytest.mark.parametrize(("tool", "topic"), [("SetInitialPose", "initialpose"), ("SetGoal", "goal_pose")])
def test_a_pose_can_be_set_by_hand(tool, topic):
    assert TOOLS[f"rviz_default_plugins/{tool}"]["Topic"]["Value"] == topic
