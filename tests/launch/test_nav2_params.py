"""Tests of Nav2's parameters, as Nav2's nodes read them, against the needs of Jazzy's Nav2 (1.3.13)."""

from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from sar_compiler.missions.parameter_file import check_parameter_file
from tests.launch.launch_file import ROOT, LaunchFile, texts
from tests.ros.conftest import Ros

PARAMS = ROOT / "config" / "nav2_params.yaml"
MAP = ROOT / "maps" / "disaster_zone.yaml"

# The nodes that bringup_launch.py starts, by localization_launch.py and navigation_launch.py.
SERVERS = [
    "map_server", "amcl", "controller_server", "smoother_server", "planner_server", "route_server",
    "behavior_server", "velocity_smoother", "collision_monitor", "bt_navigator", "waypoint_follower",
    "docking_server",
]  # fmt: skip
# All their parameters have usable defaults; map_server's file is the launch argument `map`.
WITHOUT_SECTION = {"map_server", "smoother_server", "route_server", "waypoint_follower"}
COSTMAPS = ["local_costmap", "global_costmap"]

# Without these, the start of Nav2 fails: they have no default in its sources.
REQUIRED = {
    "collision_monitor": ["polygons", "observation_sources", "FootprintApproach.type", "FootprintApproach.action_type"],
    "docking_server": ["dock_plugins", "simple_charging_dock.plugin"],
}  # fmt: skip

# Publishers and subscribers of velocity commands; each has its own parameter, which is false by default.
VELOCITY_SERVERS = [
    "controller_server",
    "behavior_server",
    "velocity_smoother",
    "collision_monitor",
    "docking_server",
]
ODOMETRY_SERVERS = ["controller_server", "bt_navigator", "velocity_smoother"]


def flat(tree: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def sections() -> dict[str, dict[str, Any]]:
    """Return the parameters by the nodes' full names."""
    found: dict[str, dict[str, Any]] = {}
    for name, section in yaml.safe_load(PARAMS.read_text(encoding="utf-8")).items():
        inner = section if "ros__parameters" not in section else {"": section}
        for node, content in inner.items():
            found[f"/{name}/{node}".rstrip("/")] = dict(flat(content["ros__parameters"]))
    return found


SECTIONS = sections()


def costmap(name: str) -> dict[str, Any]:
    return SECTIONS[f"/{name}/{name}"]


def test_parameter_file_passes_check():
    check_parameter_file(PARAMS)


@pytest.mark.ros
@pytest.mark.parametrize("name", SECTIONS)
def test_node_receives_values_of_its_section(name, ros: Ros):
    namespace, _, base = name.rpartition("/")
    node = ros.node(
        base,
        namespace=namespace,
        cli_args=["--ros-args", "--params-file", str(PARAMS)],
        automatically_declare_parameters_from_overrides=True,
    )
    assert {key: node.get_parameter(key).value for key in SECTIONS[name]} == SECTIONS[name]


@pytest.mark.parametrize("server", SERVERS)
def test_every_server_with_required_parameters_has_section(server):
    assert (f"/{server}" in SECTIONS) != (server in WITHOUT_SECTION)


@pytest.mark.parametrize(
    ("server", "name"), [(key, name) for key, names in REQUIRED.items() for name in names]
)
def test_parameter_without_default_is_given(server, name):
    assert SECTIONS[f"/{server}"][name]


def test_every_section_belongs_to_started_node():
    assert set(SECTIONS) == {f"/{name}" for name in set(SERVERS) - WITHOUT_SECTION} | {
        f"/{name}/{name}" for name in COSTMAPS
    }


@pytest.mark.parametrize("server", VELOCITY_SERVERS)
def test_velocity_commands_are_stamped(server):
    assert SECTIONS[f"/{server}"]["enable_stamped_cmd_vel"] is True


@pytest.mark.parametrize("server", ODOMETRY_SERVERS)
def test_odometry_topic_is_filtered_odometry_of_rosbot(server):
    assert SECTIONS[f"/{server}"]["odom_topic"] == "odometry/filtered"


@pytest.mark.parametrize("name", ["default_server_timeout", "wait_for_service_timeout"])
def test_timeouts_of_bt_navigator_are_one_second(name):
    assert SECTIONS["/bt_navigator"][name] == 1000, "milliseconds"


@pytest.mark.parametrize("name", COSTMAPS)
@pytest.mark.parametrize(
    ("key", "value"),
    [("robot_radius", 0.22), ("resolution", 0.05), ("inflation_layer.inflation_radius", 0.55)],
)
def test_costmaps_have_dimensions_of_robot(name, key, value):
    assert costmap(name)[key] == value


@pytest.mark.parametrize("name", COSTMAPS)
def test_every_costmap_layer_has_plugin(name):
    section = costmap(name)
    assert all(f"{layer}.plugin" in section for layer in section["plugins"])
    assert section["plugins"][-1] == "inflation_layer", "inflates what the layers before it have marked"


@pytest.mark.parametrize("name", COSTMAPS)
def test_scan_marks_and_clears_obstacles(name):
    section = costmap(name)
    assert section["obstacle_layer.observation_sources"] == "scan"
    assert section["obstacle_layer.scan.clearing"] is True
    assert section["obstacle_layer.scan.max_obstacle_height"] > 0.0


def test_amcl_uses_scan_and_waits_for_initial_pose():
    assert SECTIONS["/amcl"]["scan_topic"] == "scan"
    assert SECTIONS["/amcl"]["set_initial_pose"] is False


def test_robot_frame_is_base_link_everywhere():
    frames = {
        value
        for section in SECTIONS.values()
        for key, value in section.items()
        if key in {"base_frame_id", "robot_base_frame", "base_frame"}
    }
    assert frames == {"base_link"}


def test_controller_matches_inflation_of_local_costmap():
    controller, local = SECTIONS["/controller_server"], costmap("local_costmap")
    assert (
        controller["FollowPath.inflation_cost_scaling_factor"] == local["inflation_layer.cost_scaling_factor"]
    )
    assert controller["FollowPath.cost_scaling_dist"] <= local["inflation_layer.inflation_radius"]


def test_absolute_topics_are_remapped_by_launch_file():
    absolute = {
        value
        for section in SECTIONS.values()
        for value in section.values()
        if isinstance(value, str) and value.startswith("/")
    }
    remaps = LaunchFile(ROOT / "launch" / "search_and_rescue.launch.py").calls("SetRemap")
    assert absolute == {texts(call.args[0])[0] for call in remaps} == {"/scan"}


@pytest.mark.ros
@pytest.mark.parametrize("name", COSTMAPS)
def test_remapping_resolves_scan_in_namespace_of_costmap(name, ros: Ros):
    """As launched with namespace:=robot1. A relative topic would end in the costmap's namespace."""
    from std_msgs.msg import Empty

    node = ros.node(name, namespace=f"/robot1/{name}", cli_args=["--ros-args", "-r", "/scan:=/robot1/scan"])
    absolute, relative = (
        node.create_subscription(Empty, topic, lambda _: None, 1) for topic in ("/scan", "scan")
    )
    assert absolute.topic_name == "/robot1/scan"
    assert relative.topic_name == f"/robot1/{name}/scan"


def test_map_has_format_of_map_server():
    content = yaml.safe_load(MAP.read_text(encoding="utf-8"))
    assert set(content) == {
        "image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh",
    }  # fmt: skip
    assert (MAP.parent / content["image"]).is_file()
    assert content["resolution"] == costmap("global_costmap")["resolution"]


def test_planner_waits_at_least_ten_minutes_for_initial_pose():
    assert costmap("global_costmap")["initial_transform_timeout"] >= 600.0
